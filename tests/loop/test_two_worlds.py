"""What flies is configured from the declaration and the known commands: the truth leaves no trace in it."""

import numpy as np
import pytest

from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant.conditions import known_trim
from beaver_ftc.scenario import load

DECLARED = {
    "name": "declared",
    "duration_s": 1.0,
    "actuators": "servo",
    "sensors": "tactical-grade",
    "design_model": {
        "linearised": True,
        "actuators": {"bandwidth_rad_s": 18.0, "rate_limit_deg_s": 50.0},
        "sensors": "tactical-grade",
    },
    "fdi": {"statistical": {}, "fault_class": "all", "bounds": {"sensors": "tactical-grade"}},
}
TRUTHS = {
    "coefficients": {"uncertainty": {"coefficients": {"Cm_0": 1.2, "Cl_dr": 0.7}, "inertia": {"Iy": 1.1}}},
    "air": {"environment": {"wind_mps": [4, -3, 1], "turbulence": "dryden", "severity": "light"}},
    "servos": {"actuators": {"bandwidth_rad_s": 9.0, "elevator": {"travel_deg": [-12, 9]}}},
    "sensors": {"sensors": "consumer-grade"},
}


def configured(scenario):
    """Records of what flies before its first frame, the known commands left out; and these commands."""
    loop = Loop(load(scenario))
    frame = loop.frames[0]
    commands = (
        frame["control"]["layout"]["trim"],
        frame["control"]["allocation"]["output"]["command"],
        frame["prediction"]["u"],
        frame["prediction"]["commanded"],
    )
    known = [command.copy() for command in commands]
    for command in commands:
        command[:] = 0.0
    records = [frame[part].tobytes() for part in ("prediction", "fdi", "control", "autopilot")]
    true_trim = np.array(list(loop.trim.surfaces_rad.values()))
    loop.release()
    return records, known, true_trim


@pytest.mark.parametrize("law", ["adaptive", "nominal", "zhang2005", "lqr"])
@pytest.mark.parametrize("truth", TRUTHS)
def test_another_truth_leaves_the_configuration_as_it_is(truth, law):
    base = DECLARED | {"control": {"law": law}}
    records, *_ = configured(base)
    there, known, true_trim = configured(base | TRUTHS[truth])
    assert there == records
    for command in known:
        assert command == pytest.approx(true_trim, abs=0)


def test_the_designers_trim_is_that_of_a_truth_as_declared():
    nominal = load({"name": "nominal", "duration_s": 1.0})
    off = nominal.with_(TRUTHS["coefficients"])
    loop = Loop(nominal)
    assert loop.trimmed.command.tolist() == known_trim(off).u.tolist()
    loop.release()
    loop = Loop(off)
    assert np.abs(loop.trimmed.command - known_trim(off).u).max() > 1e-3
    assert loop.trimmed.y.tolist() == known_trim(nominal).y.tolist()
    loop.release()


def test_the_design_follows_the_servos_the_designer_knows():
    known = {"bandwidth_rad_s": 12.0, "rate_limit_deg_s": 40.0, "rudder": {"travel_deg": [-14, 13]}}
    base = {"name": "known", "duration_s": 1.0, "actuators": "servo"}
    of_designer, *_ = configured(base | {"design_model": {"actuators": known}})
    as_flown, *_ = configured(base | {"actuators": known})
    nominal, *_ = configured(base)
    assert of_designer[1:3] == as_flown[1:3]
    assert of_designer[1] != nominal[1]
