"""An alarm can be recomputed from the log alone, by the recursions of detection.md."""

from math import exp, log, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flying import flown, loss
from samples import samples

SIGMA, BIAS, SLOPE = radians(0.02), radians(0.05), 1e-3
GYRO = {"noise_std_deg_s": 0.02, "bias_deg_s": 0.05, "scale_error": SLOPE}
GYROS = dict.fromkeys("pqr", GYRO)
LIMIT_SIGMA = 4.0  # of the noise
DELAYS_S = (0.1, 0.5, 2.0)


def filtered(decay, inputs, first=0.0):
    """y[k] = decay y[k-1] + inputs[k], from y[0] = first."""
    y = [first]
    for value in inputs[1:]:
        y.append(decay * y[-1] + value)
    return np.array(y)


def changing_error(rate):
    """n of detection.md, "Changing error of a gyro", for GYRO."""
    offset = LIMIT_SIGMA * SIGMA + BIAS
    return offset - BIAS + SLOPE * (abs(rate) + (offset + SLOPE * abs(rate)) / (1.0 - SLOPE))


def recomputed(memory, axis, pole, dt, errors=False):
    """Residual and threshold (n,) rad/s of one filter, from the log's columns."""
    x, decay = memory[f"{axis}_measured_rad_s"], exp(-pole * dt)
    innovation = np.r_[0.0, np.diff(x) / dt - memory[f"{axis}_design_rad_s2"][1:]]
    n = changing_error(x) if errors else np.zeros(x.size)
    noise = filtered(decay, np.r_[0.0, (1.0 - decay) * n[:-1]], n[0])
    bound = filtered(decay, dt * memory[f"{axis}_eta_bar_rad_s2"]) + noise + n
    return filtered(decay, dt * innovation), bound


def poles_for_delays(constant):
    """The three poles of detection.md, "A bank of poles"."""
    found, nbar = [], 2 * LIMIT_SIGMA * SIGMA
    for delay in DELAYS_S:
        phi = constant + 8 * nbar / delay
        for _ in range(50):
            pole = max(log(phi * delay / nbar), 0.1) / delay
            phi = (nbar * pole + constant) / (1 - exp(-pole * delay))
        found.append(pole)
    return found


def test_the_threshold_worked_by_hand_on_the_page_is_that_of_the_log():
    _, memory = flown(name="fault-free", duration_s=2.0)
    for axis in "pqr":
        bound = memory[f"{axis}_threshold_rad_s"]
        by_hand = 0.01 * 0.02 * (1.0 - exp(-0.1) ** np.arange(bound.size)) / (1.0 - exp(-0.1))
        assert bound[0] == 0.0
        assert np.all(bound >= by_hand)  # the Earth turns, and a little inertia coupling
        assert bound == pytest.approx(by_hand, rel=0.03)
        assert bound[:3] == pytest.approx(by_hand[:3], rel=1e-4)
    assert by_hand[[1, 2, 100]] == pytest.approx([0.0002, 0.000381, 0.0021], rel=1e-3)


@settings(max_examples=samples(6), deadline=None)
@given(
    st.sampled_from([50, 100, 500]), st.sampled_from([1, 3]), st.floats(1.0, 60.0), st.floats(1.0, 200.0),
    st.sampled_from([{}, GYROS]),
)  # fmt: skip
def test_residuals_thresholds_and_the_alarm_follow_from_the_log(rate_hz, substeps, published, further, gyros):
    """Of every filter of the bank; so does the instant of the alarm."""
    flight, memory = flown(
        rate_hz=rate_hz,
        substeps=substeps,
        duration_s=2.0,
        sensors=gyros,
        faults=[loss(magnitude=0.8, at_s=0.5)],
        fdi={
            "detection_pole_per_s": published,
            "pole_bank_per_s": [1e6, further],
            "bounds": {"sensors": gyros},
        },
    )
    dt, t = 1.0 / rate_hz, memory["t_s"]
    poles = [published, 1e6, further, *(poles_for_delays(0.02) if gyros else ())]
    alarm = np.zeros(t.size, bool)
    for axis in "pqr":
        filters = [recomputed(memory, axis, pole, dt, bool(gyros)) for pole in poles]
        alarm |= np.any([np.abs(residual) > bound for residual, bound in filters], axis=0)
        residual, bound = filters[0]
        healthy = ~(memory["detected"] > 0)
        assert residual[healthy] == pytest.approx(memory[f"{axis}_residual_rad_s"][healthy], abs=1e-12)
        assert bound[1:] == pytest.approx(memory[f"{axis}_threshold_rad_s"][1:], abs=1e-12)
        shares = [np.abs(residual[1:]) / bound[1:] for residual, bound in filters]
        nearest = np.argmax(shares, axis=0)
        for column, which in (("residual", 0), ("threshold", 1)):
            logged = memory[f"{axis}_alarm_{column}_rad_s"][1:]
            assert np.choose(nearest, [of[which][1:] for of in filters]) == pytest.approx(logged, abs=1e-12)
    first = t[alarm][0] if alarm.any() else None
    assert flight.detection_time_s == pytest.approx(first) if first is not None else not flight.detected
