"""Tables of docs/explanation/laws.md."""

import numpy as np

from beaver_ftc.control.laws.loop_design import RATIO
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.readout import FrameReadout
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies.margins import over_airspeeds
from beaver_ftc.studies.present.tables import markdown_table

DECLARED = {
    "nothing": {"name": "level"},
    "servos, tactical-grade sensors": {"name": "level", "actuators": "servo", "sensors": "tactical-grade"},
}


AIRSPEED_MPS = 45.0
LOOPS = ("roll, aileron", "pitch, elevator", "yaw, rudder", "pitch, flap")


def law_gains() -> str:
    """The gains of the default law that follow from what is declared, at one airspeed."""
    rows = []
    for declared, keys in DECLARED.items():
        scenario = load(keys)
        law = FrameReadout(Loop(scenario).frames[0]).control.default_law
        slowest = scenario.airframe.envelope.airspeed_mps[0]
        qdyn_pa = law.qdyn_pa
        pressure = qdyn_pa[0] * (AIRSPEED_MPS / slowest) ** 2
        for loop, gains, lead in zip(LOOPS, law.Kp, law.lead, strict=True):
            gain = np.interp(pressure, qdyn_pa, gains)
            rows.append((declared, loop, f"{gain:.1f}", f"{RATIO * gain:.1f}", f"{lead:.1f}"))
    return markdown_table(("declared", "loop", "K_p, 1/s", "omega_o, 1/s", "lead"), rows)


def least_margins() -> str:
    """The least margins that `beaver-ftc linearise` finds, over airspeeds, faults and surfaces."""
    rows = []
    for declared, keys in DECLARED.items():
        found = over_airspeeds(load(keys))
        gain = min(min(one.up_db, one.down_db) for one in found)
        phase = min(one.phase_deg for one in found)
        rows.append((declared, str(len(found)), f"{gain:.1f}", f"{phase:.0f}"))
    return markdown_table(("declared", "loops", "least gain margin, dB", "phase margin, deg"), rows)
