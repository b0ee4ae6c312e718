"""Two columns a surface: the effectiveness that the diagnosis estimates, and the one that the law uses."""

import numpy as np
import pytest

from flying import flown, loss

SURFACES = ("aileron", "elevator", "rudder", "flap")
RATE_PER_S = 2.5


def columns(log, which):
    return {surface: log[f"{surface}_effectiveness_{which}"] for surface in SURFACES}


def fly(law="fault-tolerant-published", fault=None, **fdi):
    """(landing, estimates, used, times) of four seconds, with a fault at 2 s."""
    control = {"law": law, "effectiveness_rate_per_s": RATE_PER_S}
    landing, log = flown(duration_s=4.0, faults=[fault or loss(at_s=2.0)], control=control, fdi=fdi)
    return landing, columns(log, "estimate"), columns(log, "used"), log["t_s"]


@pytest.mark.parametrize("law", ["fault-tolerant-published", "fault-tolerant", "adaptive"])
def test_the_law_comes_by_and_by_to_what_is_estimated(law):
    landing, estimate, used, t = fly(law)
    assert landing.isolated == "elevator"
    assert np.all(estimate["elevator"][t < landing.isolation_time_s - 1e-9] == 1.0)
    assert estimate["elevator"][-1] == pytest.approx(1.0 + landing.estimate)
    assert estimate["elevator"].min() < 0.7
    steps = np.abs(np.diff(used["elevator"]))
    assert steps.max() == pytest.approx(RATE_PER_S / 100.0)
    assert np.abs(np.diff(estimate["elevator"])).max() > 2.0 * steps.max()
    assert used["elevator"][-1] == pytest.approx(estimate["elevator"][-1], abs=0.01)
    for surface in ("aileron", "rudder", "flap"):
        assert np.all(estimate[surface] == 1.0)
        assert np.all(used[surface] == 1.0)


def test_the_oracle_uses_what_no_diagnosis_estimates():
    _, estimate, used, t = fly("oracle", scheme="none")
    assert all(np.all(values == 1.0) for values in estimate.values())
    assert np.array_equal(used["elevator"], np.where(t < 2.0 - 1e-9, 1.0, 0.6))
