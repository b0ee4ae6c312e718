"""The promises on the JSBSim truth: the Earth's rotation and coarse frames are inside the derived bound."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flying import flown, loss
from samples import samples

NOTHING_DECLARED = {
    "bounds": {"inertia_coupling": {"p": 0, "q": 0, "r": 0}, "constant_rad_s2": {"p": 0, "q": 0, "r": 0}}
}
ROUGH = {
    axis: [
        {"square": {"amplitude_deg_s": 3, "frequency_hz": 0.4}},
        {"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.15 + 0.1 * i}},
    ]
    for i, axis in enumerate("pqr")
}


@settings(max_examples=samples(12), deadline=None)
@given(
    st.sampled_from([20, 50, 100, 1000]),
    st.sampled_from([1, 2, 5, 50]),
    st.floats(35, 52),
    st.floats(0, 3000),
)
def test_a_perfect_model_needs_no_declared_margin(rate_hz, substeps, airspeed_mps, altitude_m):
    """With no uncertainty declared and none there, only the Earth's rotation is left: 1e-5 rad/s2."""
    frames = min(20 * rate_hz, 40_000 // substeps)
    flight, _ = flown(
        rate_hz=rate_hz,
        substeps=substeps,
        duration_s=frames / rate_hz,
        initial={"airspeed_mps": airspeed_mps, "altitude_m": altitude_m},
        reference=ROUGH,
        uncertainty={},
        fdi=NOTHING_DECLARED,
    )
    assert flight.detection_time_s is None
    assert 0.0 < flight.worst_residual_ratio < 0.9


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("profile", [{}, {"profile": "incipient", "kappa_per_s": 1.0}, {"end_s": 9.0}])
@pytest.mark.parametrize("actuator", ["aileron", "elevator", "rudder"])
def test_a_fault_is_never_taken_for_another(actuator, profile, substeps):
    faults = [loss(actuator, 0.5, at_s=6.03, **profile)]
    flight, _ = flown(duration_s=14, rate_hz=50, substeps=substeps, faults=faults)
    assert flight.detection_time_s > 6.03
    assert actuator in (*flight.candidates, flight.isolated)
    assert flight.isolated in (actuator, None)
    assert flight.detection_time_s - 6.03 <= flight.guaranteed_delay_s + 1 / 50
