"""What the law takes a surface for, by the measure that the diagnosis asks for."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET, WAIT_FOR_SURFACE
from beaver_ftc.diagnosis.types.registry import N_TYPES
from beaver_ftc.loop import frame as whole
from beaver_ftc.loop.assembly import Trim, assemble
from beaver_ftc.scenario.schema import Scenario
from fault_kinds import BIAS, CONSTANT_LOSS, STUCK

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
ELEVATOR, RUDDER = 1, 2
X = np.array([0.02, -0.01, 0.015])
TRIM = Trim(np.zeros(3), np.array([0.1, 0.02, 45.0, 1036.0, 0.3]), np.zeros(4), np.zeros(4))
G = np.array([[-9.0, 0.0, 0.6, 0.0], [0.0, -10.0, 0.0, 2.1], [-0.2, 0.0, -2.0, 0.0]])


def new_frame(law_name="adaptive", **fdi):
    keys = {"rate_hz": 100, "control": {"law": law_name}, "fdi": fdi}
    frame = assemble(Scenario.model_validate({"name": "x", **keys}), TRIM, TRAVEL_RAD).view(np.recarray)[0]
    frame["measured"]["x"], frame["measured"]["y"][:5] = X, (0.1, 0.02, 45.0, 1036.0, 0.3)
    frame["prediction"]["f"], frame["prediction"]["G"], frame["control"]["layout"]["trim"] = (
        (0.3, -0.2, 0.1),
        G,
        0.01,
    )
    return frame


def accommodated(frame, **faults):
    """What the law takes the surfaces for."""
    for name, value in ({"effectiveness": 1.0} | faults).items():
        frame["faults"][name] = value
    whole.assess_faults(frame)
    whole.accommodate(frame)
    return frame["control"]["surfaces"]["output"]


@pytest.mark.parametrize("measure", [SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET, WAIT_FOR_SURFACE])
def test_what_is_done_about_each_kind_of_fault(measure):
    frame = new_frame("fault-tolerant-published", fault_class="all")
    fdi = frame["fdi"]
    surface = fdi["types"]["surface"][RUDDER]
    kind = {SCALE_COMMAND: CONSTANT_LOSS, GIVE_UP: STUCK, SUBTRACT_OFFSET: BIAS, WAIT_FOR_SURFACE: BIAS}[
        measure
    ]
    fdi["types"]["surface"]["accommodation"]["mode"], surface["accommodation"]["mode"] = -1, measure
    surface["sets"]["excluded"] = [other != kind for other in range(N_TYPES)]
    surface["sets"]["low"][kind], surface["sets"]["high"][kind] = 0.1, 0.2
    (
        surface["last"]["u"],
        surface["last"]["lo"],
        surface["last"]["hi"],
    ) = 0.05, 0.3, 0.34
    loss = fdi["layout"]["loss"][RUDDER]
    fdi["isolation"]["estimator"][int(loss)]["theta"] = -0.3
    surfaces = accommodated(frame)
    target = {SCALE_COMMAND: 0.7, GIVE_UP: 0.0}.get(measure, 1.0)
    assert surfaces["target"] == pytest.approx([1.0, 1.0, target, 1.0])
    offset = {GIVE_UP: 0.15, SUBTRACT_OFFSET: 0.15}.get(measure, 0.0)  # where it is jammed; how far it is off
    assert surfaces["offset"][RUDDER] == pytest.approx(offset)
    assert surfaces["lag"][RUDDER] == pytest.approx(0.27 if measure == WAIT_FOR_SURFACE else 0.0)
    assert surfaces["authority_lost"] == (measure == WAIT_FOR_SURFACE)
    assert (surfaces["effectiveness"][RUDDER] == 0.0) == (measure == GIVE_UP)  # a jam bypasses the rate limit
