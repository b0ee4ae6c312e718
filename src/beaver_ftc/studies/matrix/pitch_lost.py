"""Elevator and flap lost at once: the same flights with engine power on pitch and without."""

from collections.abc import Sequence
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.studies.engine.columns import Columns
from beaver_ftc.studies.engine.flown import Progress, flown
from beaver_ftc.studies.matrix.cases import AIRSPEEDS_MPS, AT_S, REFERENCE, UNCERTAINTY
from beaver_ftc.studies.matrix.flying import trimmed_deg
from beaver_ftc.studies.matrix.pitch_cases import LAWS, LOST, SETTLED_S, PitchCase
from beaver_ftc.studies.matrix.pitch_margins import margins
from beaver_ftc.studies.matrix.pitch_text import as_text

if TYPE_CHECKING:
    from beaver_ftc.loop.flight import Flight
    from beaver_ftc.scenario.schema import Scenario

Document = dict[str, Any]
NAME = "pitch-lost"
DURATION_S = 100.0

COLUMNS = ("t_s", "q_rad_s", "theta_rad", "phi_rad", "airspeed_mps", "envelope_valid")


def scenario_of(case: PitchCase, enabled: bool) -> "Scenario":
    """The flight of a case, with engine power on pitch or without."""
    from beaver_ftc.scenario.schema import Scenario

    off_deg, flap_deg = next((off, flap) for name, off, flap in LOST if name == case.lost)
    elevator: Document = {"type": "float"}
    if off_deg is not None:
        elevator = {"type": "stuck", "position_deg": trimmed_deg(case.airspeed_mps, "elevator") + off_deg}
    flap = {"type": "stuck", "position_deg": flap_deg}
    return Scenario.model_validate(
        {
            "name": NAME,
            "duration_s": DURATION_S,
            "initial": {"airspeed_mps": case.airspeed_mps},
            "reference": REFERENCE,
            "uncertainty": UNCERTAINTY,
            "faults": [
                {**fault, "actuator": surface, "at_s": AT_S}
                for surface, fault in (("elevator", elevator), ("flap", flap))
            ],
            "fdi": {"fault_class": "all"},
            "control": {"law": case.law, "power": {"enabled": enabled}},
        }
    )


def fly_case(case: PitchCase) -> Document:
    """The row of a case: what came of it without engine power and with it."""
    without, powered = (_outcome(scenario_of(case, enabled)) for enabled in (False, True))
    return {**case._asdict(), "without": without, "with": powered}


def _outcome(scenario: "Scenario") -> Document:
    from beaver_ftc.loop.loop import fly
    from beaver_ftc.results.metrics import metrics

    kept = Columns(*COLUMNS)
    flight = fly(scenario, kept)
    document = metrics(flight)
    return {
        **_swing(flight, kept),
        **_range(kept),
        "departure": document["departure"],
        "engine_power": document["engine_power"],
    }


def _swing(flight: "Flight", kept: Columns) -> Document:
    """RMS pitch rate and swing of the attitude once settled; null if the aircraft was lost."""
    if flight.departure is not None:
        return {"q_rms_deg_s": None, "theta_swing_deg": None}
    late = kept.since(SETTLED_S)
    q, theta = late["q_rad_s"], late["theta_rad"]
    return {
        "q_rms_deg_s": degrees(float(np.sqrt(np.mean(q**2)))),
        "theta_swing_deg": degrees(float(np.ptp(theta))),
    }


def _range(kept: Columns) -> Document:
    """Airspeed, bank and stay outside the validated envelope since the fault."""
    after = kept.since(AT_S)
    return {
        "airspeed_mps": [float(after["airspeed_mps"].min()), float(after["airspeed_mps"].max())],
        "bank_deg": degrees(float(np.abs(after["phi_rad"]).max())),
        "outside_share": float(np.mean(after["envelope_valid"] < 0.5)),
    }


def run_pitch_lost(
    out: Path,
    airspeeds_mps: tuple[float, ...] | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> Document:
    """Write `out/pitch-lost/` (table, JSON); return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder

    airspeeds_mps = airspeeds_mps or AIRSPEEDS_MPS
    cases = [PitchCase(name, V, law) for law in LAWS for name, _, _ in LOST for V in airspeeds_mps]
    fly = flown(out / NAME, cases, fly_case, workers=workers, progress=progress)
    with fly as rows, result_folder(out, NAME) as folder:
        document = document_of(rows, airspeeds_mps)
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.txt").write_text(as_text(document) + "\n", encoding="utf-8")
    return document


def document_of(rows: list[Document], airspeeds_mps: Sequence[float]) -> Document:
    """All flights, the linear margins, and whether power lost an aircraft that was kept without it."""
    from beaver_ftc.scenario.control import EnginePower

    harmed = [row for row in rows if row["with"]["departure"] and not row["without"]["departure"]]
    return {
        "margins": [margins(V, EnginePower()) for V in airspeeds_mps or AIRSPEEDS_MPS],
        "flights": rows,
        "saved": sum(bool(row["without"]["departure"] and not row["with"]["departure"]) for row in rows),
        "harmed": len(harmed),
        "passed": not harmed,
    }
