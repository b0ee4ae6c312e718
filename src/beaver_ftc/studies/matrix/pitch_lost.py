"""Elevator and flap lost at once: the same flights with engine power on pitch and without.

Beside them engine power as a pitch effector about the trim, linear: what it is worth, and the margins of its
law.
"""

from collections.abc import Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beaver_ftc.control.laws.loop_design import margins as margins_of
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.linear import LinearModel, differences, engine_slope
from beaver_ftc.plant.trim import trim
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import as_json, metrics
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.airframe import Initial
from beaver_ftc.scenario.diagnosis import EnginePower
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.linear_systems import zeros
from beaver_ftc.studies.matrix.fault_matrix import AIRSPEEDS_MPS, AT_S, REFERENCE, UNCERTAINTY, trimmed_deg
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import aligned, finite, tabulated

NAME = "pitch-lost"
DURATION_S = 100.0
COLUMNS = ("t_s", "q_rad_s", "theta_rad", "phi_rad", "airspeed_mps", "envelope_valid")
STATES = ("airspeed", "alpha", "q", "theta")
FREQUENCIES_RAD_S = np.geomspace(1e-3, 1e2, 20001)
SLOW_RAD_S = 1.0  # the phugoid is slower than this, the short period faster
SETTLED_S = 30.0  # from here on the swing is judged: what the fault itself throws off is over
LAWS = ("fault-tolerant-published", "oracle-published")

# Elevator's jam off its trim in deg (None: it floats), flap's position in deg.
LOST: dict[str, tuple[float | None, float]] = {
    "elevator at trim": (0.0, 0.0), "elevator +1 deg": (1.0, 0.0), "elevator -1 deg": (-1.0, 0.0),
    "elevator +2 deg": (2.0, 0.0), "elevator -2 deg": (-2.0, 0.0), "elevator floats": (None, 0.0),
    "elevator -4 deg": (-4.0, 0.0), "elevator -8 deg": (-8.0, 0.0),
    "flap 10 deg down": (0.0, 10.0), "flap 20 deg down": (0.0, 20.0),
}  # fmt: skip


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
    """The row of a case: what came of it without engine power and with it."""
    without, powered = (_outcome(scenario_of(case, enabled)) for enabled in (False, True))
    return {**case._asdict(), "without": without, "with": powered}


def _outcome(scenario: Scenario) -> Document:
    """RMS pitch rate and swing of the attitude once settled, null if the aircraft was lost; airspeed, bank
    and stay outside the validated envelope since the fault."""
    kept = Columns(*COLUMNS)
    found = metrics(fly(scenario, kept))
    late, after = kept.since(SETTLED_S), kept.since(AT_S)
    lost = found["departure"] is not None
    return {
        "q_rms_deg_s": None if lost else degrees(float(np.sqrt(np.mean(late["q_rad_s"] ** 2)))),
        "theta_swing_deg": None if lost else degrees(float(np.ptp(late["theta_rad"]))),
        "airspeed_mps": [float(after["airspeed_mps"].min()), float(after["airspeed_mps"].max())],
        "bank_deg": degrees(float(np.abs(after["phi_rad"]).max())),
        "outside_share": float(np.mean(after["envelope_valid"] < 0.5)),
        "departure": found["departure"],
        "engine_power": found["engine_power"],
    }


def run_pitch_lost(
    out: Path, airspeeds_mps: tuple[float, ...] | None = None, workers: int = 1,
    progress: Progress | None = None,
) -> Document:  # fmt: skip
    """Write `out/pitch-lost/` (table, JSON); return the document."""
    airspeeds_mps = airspeeds_mps or AIRSPEEDS_MPS
    cases = [PitchCase(name, V, law) for law in LAWS for name in LOST for V in airspeeds_mps]
    document = partial(document_of, airspeeds_mps=airspeeds_mps)
    return run_study(Study(NAME, cases, fly_case, document, FILES), out, workers, progress)


def document_of(rows: list[Document], airspeeds_mps: Sequence[float]) -> Document:
    """All flights, the linear margins, and whether power lost an aircraft that was kept without it."""
    harmed = [row for row in rows if row["with"]["departure"] and not row["without"]["departure"]]
    return {
        "margins": [margins(V, EnginePower()) for V in airspeeds_mps],
        "flights": rows,
        "saved": sum(bool(row["without"]["departure"] and not row["with"]["departure"]) for row in rows),
        "harmed": len(harmed),
        "passed": not harmed,
    }


def margins(airspeed_mps: float, config: EnginePower) -> Document:
    """Of the loop through engine power at one airspeed, elevator and flap standing still.

    phugoid_damping: without and with the law. gain_margin_db, phase_margin_deg: the least of all crossings,
    null where there is none. attitude_zero_rad_s: the right-half-plane zero from power to attitude.
    worth_deg: pitching moment of the throttle closed and opened, in deg of elevator.
    """
    model, power, trim_inhg = about_trim(airspeed_mps)
    A, q, (F, b, k) = model.A, STATES.index("q"), with_law(model.A, power, config)
    upper_db, lower_db, phase_deg = margins_of(loop_response(F, b, k))
    ends = np.array([config.lowest_inhg, config.highest_inhg]) - trim_inhg
    return {
        "airspeed_mps": airspeed_mps,
        "phugoid_damping": [_phugoid_damping(system) for system in (A, F + np.outer(b, k))],
        "gain_margin_db": finite(float(min(upper_db, lower_db))),
        "phase_margin_deg": finite(float(phase_deg)),
        "attitude_zero_rad_s": float(zeros(A, power, STATES.index("theta")).real.max()),
        "worth_deg": np.rad2deg(ends * power[q] / model.B[q, model.inputs.index("elevator")]).tolist(),
    }


def about_trim(airspeed_mps: float) -> tuple[LinearModel, np.ndarray, float]:
    """The four longitudinal states, the column (4,) of manifold pressure in inHg, and its trim."""
    plant, point = Plant(100), trim(airspeed_mps, Initial().altitude_m)
    model = differences(plant, point)
    rows = [model.states.index(name) for name in STATES]
    return model.of(STATES), engine_slope(plant, point)[rows], point.manifold_pressure_inhg


def with_law(A: np.ndarray, power: np.ndarray, config: EnginePower) -> tuple[np.ndarray, ...]:
    """The aircraft, the smoothed airspeed, its slow mean and the attitude missed: system matrix F (7, 7), the
    column b (7,) of manifold pressure in inHg, and the pressure k (7,) that the law asks for."""
    F, b, k = np.zeros((7, 7)), np.zeros(7), np.zeros(7)
    F[:4, :4], b[:4] = A, power
    F[4, [0, 4]] = np.array([1.0, -1.0]) / config.smoothing_s
    F[5, [4, 5]] = np.array([1.0, -1.0]) / config.washout_s
    F[6, 2], F[6, 6] = 1.0, -1.0 / config.attitude_memory_s
    speed_gain, attitude_gain = config.speed_gain_inhg_per_mps, np.rad2deg(config.attitude_gain_inhg_per_deg)
    k[4:] = -speed_gain, speed_gain, attitude_gain
    return F, b, k


def loop_response(F: np.ndarray, b: np.ndarray, k: np.ndarray) -> np.ndarray:
    """The loop cut at the manifold pressure, over FREQUENCIES_RAD_S; 1 + L = 0 is the closed loop's."""
    s = 1j * FREQUENCIES_RAD_S[:, None, None]
    return -np.linalg.solve(s * np.eye(len(F)) - F, b[:, None])[..., 0] @ k


def _phugoid_damping(system: np.ndarray) -> float:
    """Damping ratio of the slow oscillation; 1 if there is none."""
    poles = np.linalg.eigvals(system)
    slow = poles[(np.abs(poles) < SLOW_RAD_S) & (poles.imag > 1e-6)]
    return float(min(-slow.real / np.abs(slow), default=1.0))


LEGEND = (
    f"cell: RMS pitch rate in deg/s, and swing of the pitch attitude in deg, from {SETTLED_S:g} s on;\n"
    "without engine power > with it. lost: the aircraft departed. *: outside the validated envelope for a\n"
    "while, even with power."
)


def as_text(document: Document) -> str:
    """A table for each law, then what the linear model says, and the totals."""
    speeds = [found["airspeed_mps"] for found in document["margins"]]
    flights = {(row["law"], row["lost"], row["airspeed_mps"]): row for row in document["flights"]}
    tables = [
        aligned([
            [law, *(f"{V:g} m/s" for V in speeds)],
            *([name, *(_cell(flights[law, name, V]) for V in speeds)] for name in LOST),
        ])
        for law in LAWS
    ]  # fmt: skip
    totals = (
        f"{len(document['flights'])} pairs of faults flown: {document['saved']} aircraft kept that are lost "
        f"without engine power, {document['harmed']} lost that are kept without"
    )
    head, rows = tabulated(MARGINS, document["margins"])
    linear = aligned([head, *rows])
    return "\n\n".join([*tables, LEGEND, linear, totals])


FILES: Makers = {f"{NAME}.json": as_json, f"{NAME}.txt": lambda document: as_text(document) + "\n"}


def _cell(row: Document) -> str:
    star = "*" if row["with"]["outside_share"] > 0.0 else ""
    return f"{_half(row['without'])} > {_half(row['with'])}{star}"


def _half(outcome: Document) -> str:
    if outcome["departure"]:
        return f"lost {outcome['departure']['time_s']:.1f} s"
    return "{q_rms_deg_s:.2f} {theta_swing_deg:4.1f}".format(**outcome)


def _or_unlimited(says: str, margin: float | None) -> str:
    return "unlimited" if margin is None else says.format(margin)


MARGINS = (
    ("airspeed", "airspeed_mps", "{:g} m/s".format),
    ("phugoid damping", "phugoid_damping", "{0[0]:.2f} > {0[1]:.2f}".format),
    ("gain margin", "gain_margin_db", partial(_or_unlimited, "{:.1f} dB")),
    ("phase margin", "phase_margin_deg", partial(_or_unlimited, "{:.0f} deg")),
    ("power to attitude", "attitude_zero_rad_s", "zero at +{:.2f} rad/s".format),
    ("its range as elevator", "worth_deg", "{0[0]:+.1f} to {0[1]:+.1f} deg".format),
)
