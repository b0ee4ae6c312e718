"""Tables of docs/explanation/laws.md."""

from beaver_ftc.scenario.loader import load
from beaver_ftc.studies.margins import study
from beaver_ftc.studies.present.tables import markdown_table

DECLARED = {
    "nothing": {"name": "level"},
    "servos, tactical-grade sensors": {"name": "level", "actuators": "servo", "sensors": "tactical-grade"},
}


def least_margins() -> str:
    """The least margins that `beaver-ftc linearise` finds, over airspeeds, faults and surfaces."""
    rows = []
    for declared, keys in DECLARED.items():
        found = study(load(keys))
        gain = min(min(one.up_db, one.down_db) for one in found)
        phase = min(one.phase_deg for one in found)
        rows.append((declared, str(len(found)), f"{gain:.1f}", f"{phase:.0f}"))
    return markdown_table(("declared", "loops", "least gain margin, dB", "phase margin, deg"), rows)
