"""What `fdi.bounds` declares is asked of one object: who takes part, and that nobody reads the section."""

import numpy as np
import pytest

from beaver_ftc.scenario.pairs import failing, of_several
from beaver_ftc.scenario.schema import load
from flying import declared_in
from given import given

GIVEN = given(__file__)


def test_errors_of_an_instrument_in_si_and_how_far_a_reading_can_be_off():
    """A vane with noise of 0.5 deg, bias -2 deg, resolution 0.25 deg and a slope that is 20 % too small."""
    of = {"noise_std_deg": 0.5, "bias_deg": -2.0, "quantum_deg": 0.25, "scale_error": -0.2}
    declared = declared_in({"sensors": {"beta": of, "V": {"noise_std_mps": 3.0}}}).sensors
    beta = declared["beta"]
    assert np.degrees([beta.noise, beta.steady, beta.resolution]) == pytest.approx([0.5, 2.0, 0.25])
    assert beta.slope == 0.2
    assert np.degrees(beta.random) == pytest.approx(np.sqrt(0.25 + 0.0625 / 12.0))
    assert np.degrees(beta.worst) == pytest.approx(4.0 * 0.5 + 2.0 + 0.125)
    # what reads 10 deg is at most 10 + e, of which e is 4.125 deg and a fifth of the truth
    assert np.degrees(beta.of_reading(np.radians(10.0))) == pytest.approx((4.125 + 2.0) / 0.8)
    assert declared.each("noise") == pytest.approx([0, 0, 0, 0, np.radians(0.5), 3.0, 0])
    assert declared.each("slope", ["beta", "p"]) == pytest.approx([0.2, 0.0])
    assert (declared.is_ideal, declared_in({}).sensors.is_ideal) == (False, True)
    truth = load({"sensors": {"beta": of, "p": {"bias_deg_s": 0.1}, "V": {"noise_std_mps": 3.1}}}).sensors
    assert declared.exceeded_by(truth) == ["p", "V"]
    assert declared.exceeded_by(load({"sensors": {"beta": {"bias_deg": 1.9}}}).sensors) == []


LOST = {"type": "loss_of_effectiveness", "magnitude": 0.4}
TWO = "faults on several surfaces at once: the diagnosis looks for one"


def of_two(*spans, **keys):
    """A scenario whose faults are (surface, from, to)."""
    faults = [{**LOST, "actuator": surface, "at_s": at_s, "end_s": end_s} for surface, at_s, end_s in spans]
    return load({"faults": faults, "duration_s": 20.0, **keys})


@pytest.mark.parametrize(
    ("spans", "at_once"),
    GIVEN["surfaces fail at once where their faults overlap"],
)  # fmt: skip
def test_surfaces_fail_at_once_where_their_faults_overlap(spans, at_once):
    assert of_several(of_two(*spans)) == (
        f"{TWO}; set fdi: {{fault_class: all, pairs: true}}" if at_once else ""
    )


def test_surfaces_fail_when_their_first_fault_comes():
    broken = of_two(("flap", 5, None), ("rudder", 7, 8), ("flap", 3, 4), ("rudder", 9, None))
    assert failing(broken) == {"flap": 3.0, "rudder": 7.0}
    instrument = {"sensor": "p", "type": "freeze", "at_s": 1}
    assert failing(load({"faults": [instrument, {**LOST, "actuator": "flap", "at_s": 2}]})) == {"flap": 2.0}
