"""What kept flights do not reach of the rejecting law: its schedule everywhere, and its lead."""

import numpy as np
import pytest

from beaver_ftc.control import allocation
from beaver_ftc.control.laws import rejecting
from law_records import new_control


@pytest.mark.parametrize("lost", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("qdyn", [300.0, 500.0, 640.0, 700.0, 810.0, 1000.0, 1390.0, 1400.0, 1999.0, 2400.0])
def test_the_schedule_is_interpolated_and_held_beyond_its_ends(qdyn, lost):
    law, rng = new_control()["rejecting"], np.random.default_rng(0)
    config, memory = law["config"], law["memory"]
    config["qdyn"] = [500.0, 700.0, 1000.0, 1400.0, 2000.0]
    for name in ("Kp", "L_rate", "L_disturbance"):
        config[f"{name}_at"] = rng.uniform(0.1, 5.0, (4, 5))
    rejecting.schedule(config, memory, qdyn, lost)
    for name in ("Kp", "L_rate", "L_disturbance"):
        of = [np.interp(qdyn, config["qdyn"], row) for row in config[f"{name}_at"]]
        expected = [of[0], (1 - lost) * of[1] + lost * of[3], of[2]]
        assert memory[name] == pytest.approx(expected, rel=1e-12)


def test_a_command_leads_a_lagging_actuator_within_the_travel():
    control = new_control()
    control["layout"]["low"], control["layout"]["high"] = -0.44, 0.44
    out = control["allocation"]["output"]
    out["command"] = [0.1, -0.1, 0.4, 0.41]
    lead, u = np.array([3.0, 1.0, 4.0, 0.0]), np.array([0.05, -0.2, 0.3, 0.4])
    allocation.lead_compensate(out, control["layout"], lead, u)
    assert out["command"] == pytest.approx([0.05 + 3 * 0.05, -0.1, 0.44, 0.41])
