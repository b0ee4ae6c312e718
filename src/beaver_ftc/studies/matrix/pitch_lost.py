"""Elevator and flap lost at once: the same flights with engine power on pitch and without.

The report also has the linear margins of engine power as a pitch effector (power_margins.py).
"""

from collections.abc import Sequence
from functools import partial
from math import degrees
from typing import NamedTuple

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import as_json, metrics
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.study import Study
from beaver_ftc.studies.matrix.fault_matrix import AIRSPEEDS_MPS, AT_S, REFERENCE, UNCERTAINTY, trimmed_deg
from beaver_ftc.studies.matrix.power_margins import margins
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import aligned, tabulated, values_of

NAME = "pitch-lost"
DURATION_S = 100.0
COLUMNS = ("t_s", "q_rad_s", "theta_rad", "phi_rad", "airspeed_mps", "envelope_valid")
SETTLED_S = 30.0  # swing and RMS rate count from this time on, when the transient of the faults is over
LAWS = ("fault-tolerant-published", "oracle-published")

# Jam of the elevator, deg from its trim (None: it floats), and position of the flap, deg.
LOST: dict[str, tuple[float | None, float]] = {
    "elevator at trim": (0.0, 0.0), "elevator +1 deg": (1.0, 0.0), "elevator -1 deg": (-1.0, 0.0),
    "elevator +2 deg": (2.0, 0.0), "elevator -2 deg": (-2.0, 0.0), "elevator floats": (None, 0.0),
    "elevator -4 deg": (-4.0, 0.0), "elevator -8 deg": (-8.0, 0.0),
    "flap 10 deg down": (0.0, 10.0), "flap 20 deg down": (0.0, 20.0),
}  # fmt: skip
LEGEND = (
    f"cell: RMS pitch rate in deg/s, and swing of the pitch attitude in deg, from {SETTLED_S:g} s on;\n"
    "without engine power > with it. lost: the aircraft departed. *: outside the validated envelope for a\n"
    "while, even with power."
)


class PitchCase(NamedTuple):
    """A pair of faults at one airspeed under one law."""

    lost: str
    airspeed_mps: float
    law: str


def scenario_of(case: PitchCase, enabled: bool) -> Scenario:
    """The flight of a case, with engine power on pitch or without."""
    off_deg, flap_deg = LOST[case.lost]
    elevator: Document = {"type": "float"}
    if off_deg is not None:
        elevator = {"type": "stuck", "position_deg": trimmed_deg(case.airspeed_mps, "elevator") + off_deg}
    flap = {"type": "stuck", "position_deg": flap_deg}
    faults = ({"actuator": "elevator", **elevator}, {"actuator": "flap", **flap})
    return Scenario.model_validate(
        {
            "name": NAME,
            "duration_s": DURATION_S,
            "initial": {"airspeed_mps": case.airspeed_mps},
            "reference": REFERENCE,
            "uncertainty": UNCERTAINTY,
            "faults": [{**fault, "at_s": AT_S} for fault in faults],
            "fdi": {"fault_class": "all"},
            "control": {"law": case.law, "power": {"enabled": enabled}},
        }
    )


def fly_case(case: PitchCase) -> Document:
    """The row of a case: the outcomes without engine power on pitch and with it."""
    without, powered = (_outcome(scenario_of(case, enabled)) for enabled in (False, True))
    return {**case._asdict(), "without": without, "with": powered}


def _outcome(scenario: Scenario) -> Document:
    """The outcome of a flight. RMS pitch rate and swing of the pitch attitude are from SETTLED_S on, null if
    the aircraft was lost. Range of airspeed, largest bank and share of time outside the validated envelope
    are from the fault on."""
    log = Columns(*COLUMNS)
    document = metrics(fly(scenario, log))
    settled, after_fault = log.since(SETTLED_S), log.since(AT_S)
    lost = document["departure"] is not None
    return {
        "q_rms_deg_s": None if lost else degrees(float(np.sqrt(np.mean(settled["q_rad_s"] ** 2)))),
        "theta_swing_deg": None if lost else degrees(float(np.ptp(settled["theta_rad"]))),
        "airspeed_mps": [float(after_fault["airspeed_mps"].min()), float(after_fault["airspeed_mps"].max())],
        "bank_deg": degrees(float(np.abs(after_fault["phi_rad"]).max())),
        "outside_share": float(np.mean(after_fault["envelope_valid"] < 0.5)),
        "departure": document["departure"],
        "engine_power": document["engine_power"],
    }


def pitch_lost_study(airspeeds_mps: tuple[float, ...] | None) -> Study:
    """Every pair of faults at these airspeeds under both laws."""
    airspeeds_mps = airspeeds_mps or AIRSPEEDS_MPS
    cases = [PitchCase(name, V, law) for law in LAWS for name in LOST for V in airspeeds_mps]
    return Study(NAME, cases, fly_case, partial(document_of, airspeeds_mps=airspeeds_mps), FILES)


def document_of(rows: list[Document], airspeeds_mps: Sequence[float]) -> Document:
    """All flights, the linear margins, and how many aircraft engine power saved, or lost that were kept
    without it."""
    harmed = [row for row in rows if row["with"]["departure"] and not row["without"]["departure"]]
    return {
        "margins": [margins(V) for V in airspeeds_mps],
        "flights": rows,
        "saved": sum(bool(row["without"]["departure"] and not row["with"]["departure"]) for row in rows),
        "harmed": len(harmed),
        "passed": not harmed,
    }


def as_text(document: Document) -> str:
    """A table for each law, the margins of the linear model, and the totals."""
    speeds = values_of(document["margins"], "airspeed_mps")
    flights = {(row["law"], row["lost"], row["airspeed_mps"]): row for row in document["flights"]}
    tables = [
        aligned([
            [law, *(f"{V:g} m/s" for V in speeds)],
            *([name, *(_cell(flights[law, name, V]) for V in speeds)] for name in LOST),
        ])
        for law in LAWS
    ]  # fmt: skip
    totals = (
        "{} pairs of faults flown: {saved} aircraft kept that are lost without engine power, {harmed} lost "
        "that are kept without"
    ).format(len(document["flights"]), **document)
    head, rows = tabulated(MARGINS, document["margins"])
    linear = aligned([head, *rows])
    return "\n\n".join([*tables, LEGEND, linear, totals])


def _cell(row: Document) -> str:
    """Both outcomes of a case."""
    star = "*" if row["with"]["outside_share"] > 0.0 else ""
    return f"{_outcome_text(row['without'])} > {_outcome_text(row['with'])}{star}"


def _outcome_text(outcome: Document) -> str:
    """One outcome: RMS pitch rate and swing, or the time of the loss."""
    if outcome["departure"]:
        return f"lost {outcome['departure']['time_s']:.1f} s"
    return "{q_rms_deg_s:.2f} {theta_swing_deg:4.1f}".format(**outcome)


def _or_unlimited(form: str, margin: float | None) -> str:
    return "unlimited" if margin is None else form.format(margin)


MARGINS = (
    ("airspeed", "airspeed_mps", "{:g} m/s".format),
    ("phugoid damping", "phugoid_damping", "{0[0]:.2f} > {0[1]:.2f}".format),
    ("gain margin", "gain_margin_db", partial(_or_unlimited, "{:.1f} dB")),
    ("phase margin", "phase_margin_deg", partial(_or_unlimited, "{:.0f} deg")),
    ("power to attitude", "attitude_zero_rad_s", "zero at +{:.2f} rad/s".format),
    ("its range as elevator", "worth_deg", "{0[0]:+.1f} to {0[1]:+.1f} deg".format),
)
FILES: Makers = {f"{NAME}.json": as_json, f"{NAME}.txt": lambda document: as_text(document) + "\n"}
