"""Table of docs/explanation/what-cannot-be-found.md: flights in which something stays hidden, or open."""

from typing import Any

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table

AT_S, DURATION_S = 12.0, 30.0
EVERY_TYPE = {"fdi.fault_class": "all"}
STILL = {"reference": {}, "uncertainty": {}}


def _fault(surface: str, kind: str, **of_it: float) -> dict[str, Any]:
    return {"actuator": surface, "type": kind, "at_s": AT_S, **of_it}


def _loss(surface: str, share: float) -> dict[str, Any]:
    return _fault(surface, "loss_of_effectiveness", magnitude=share)


CASES: tuple[tuple[str, str, dict[str, Any], tuple[dict[str, Any], ...]], ...] = (
    ("aileron, 20 % loss, straight flight", "fault-free", STILL, (_loss("aileron", 0.2),)),
    ("aileron, 20 % loss, manoeuvres", "fault-free", {}, (_loss("aileron", 0.2),)),
    ("flap, total loss, flap not used", "fault-free", EVERY_TYPE, (_loss("flap", 1.0),)),
    ("elevator, total loss", "fault-free", EVERY_TYPE, (_loss("elevator", 1.0),)),
    ("elevator, float", "fault-free", EVERY_TYPE, (_fault("elevator", "float"),)),
    ("flap, stuck at 5 deg", "fault-free", EVERY_TYPE, (_fault("flap", "stuck", position_deg=5.0),)),
    ("rudder, 2 % loss", "fault-free", {}, (_loss("rudder", 0.02),)),
    ("rudder, 40 % loss", "fault-free", {}, (_loss("rudder", 0.4),)),
    ("aileron and rudder, 40 % loss each", "fault-free", {}, (_loss("aileron", 0.4), _loss("rudder", 0.4))),
    ("elevator, 40 % loss, turbulence, worst case alone", "elevator-loss-in-turbulence",
     {"fdi.statistical": None}, (_loss("elevator", 0.4),)),
    ("elevator, 40 % loss, turbulence, both detectors", "elevator-loss-in-turbulence", {},
     (_loss("elevator", 0.4),)),
    ("aileron, 40 % loss, turbulence, both detectors", "elevator-loss-in-turbulence", {},
     (_loss("aileron", 0.4),)),
)  # fmt: skip


def hidden_faults() -> str:
    """A flight each: when the alarm comes, what is named, and what is left."""
    rows = []
    for number, (says, name, changes, faults) in enumerate(CASES, 1):
        given = {**changes, "faults": list(faults), "expect": {}, "duration_s": DURATION_S}
        metrics = bf.fly(bf.load(name).with_(given), log=False).metrics
        rows.append((str(number), says, *_outcome(metrics)))
    return markdown_table(("case", "fault and flight", "alarm after, s", "named", "still possible"), rows)


def _outcome(metrics: dict[str, Any]) -> tuple[str, str, str]:
    """Delay of the alarm, name, and what is left."""
    detection, isolation = metrics["detection"], metrics["isolation"]
    if not detection["detected"]:
        return "no alarm", "-", "-"
    named = isolation["fault"] or "no name"
    left = ", ".join(one.replace("_", " ") for one in isolation["candidates"])
    return f"{detection['delay_s']:.2f}", named, left or "none"
