"""Elevator and flap lost, for the terminal."""

from typing import Any

from beaver_ftc.studies.matrix.pitch_cases import LAWS, LOST, SETTLED_S

Document = dict[str, Any]
WIDTH = 25
LEGEND = (
    f"cell: RMS pitch rate in deg/s, and swing of the pitch attitude in deg, from {SETTLED_S:g} s on;\n"
    "without engine power > with it. lost: the aircraft departed. *: outside the validated envelope for a\n"
    "while, even with power."
)


def as_text(document: Document) -> str:
    """A table for each law, then what the linear model says, and the totals."""
    speeds = [found["airspeed_mps"] for found in document["margins"]]
    tables = [line for law in LAWS for line in [*_table(document, law, speeds), ""]]
    return "\n".join([*tables, LEGEND, "", *_margins(document["margins"]), "", _totals(document)])


def _table(document: Document, law: str, speeds: list[float]) -> list[str]:
    rows = {(row["lost"], row["airspeed_mps"]): row for row in document["flights"] if row["law"] == law}
    head = f"{law:25}" + "".join(f"{f'{V:g} m/s':{WIDTH}}" for V in speeds)
    lines = [f"{name:18}" + "".join(f"{_cell(rows[name, V]):{WIDTH}}" for V in speeds) for name, _, _ in LOST]
    return [line.rstrip() for line in (head, *lines)]


def _cell(row: Document) -> str:
    star = "*" if row["with"]["outside_share"] > 0.0 else ""
    return f"{_half(row['without'])} > {_half(row['with'])}{star}"


def _half(outcome: Document) -> str:
    if outcome["departure"]:
        return f"lost {outcome['departure']['time_s']:.1f} s"
    return f"{outcome['q_rms_deg_s']:.2f} {outcome['theta_swing_deg']:4.1f}"


def _margins(found: list[Document]) -> list[str]:
    heads = (
        "airspeed",
        "phugoid damping",
        "gain margin",
        "phase margin",
        "power to attitude",
        "its range as elevator",
    )
    return [_row(heads), *(_margin(one) for one in found)]


def _margin(one: Document) -> str:
    alone, damped = one["phugoid_damping"]
    gain = "unlimited" if one["gain_margin_db"] is None else f"{one['gain_margin_db']:.1f} dB"
    phase = "unlimited" if one["phase_margin_deg"] is None else f"{one['phase_margin_deg']:.0f} deg"
    closed, opened = one["worth_deg"]
    cells = (
        f"{one['airspeed_mps']:g} m/s",
        f"{alone:.2f} > {damped:.2f}",
        gain,
        phase,
        f"zero at +{one['attitude_zero_rad_s']:.2f} rad/s",
        f"{closed:+.1f} to {opened:+.1f} deg",
    )
    return _row(cells)


def _row(cells: tuple[str, ...]) -> str:
    return "".join(f"{cell:{width}}" for cell, width in zip(cells, (11, 18, 14, 15, 22, 0), strict=True))


def _totals(document: Document) -> str:
    return (
        f"{len(document['flights'])} pairs of faults flown: {document['saved']} aircraft kept that are lost "
        f"without engine power, {document['harmed']} lost that are kept without"
    )
