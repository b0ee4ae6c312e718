"""Sets of parameters that agree with innovations: they hold the true one, shrink, and exclude another."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from kernels import estimator, new_fdi, on

from beaver_ftc.diagnosis import estimators
from beaver_ftc.diagnosis.sets import explain

AXES = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
WITHIN = st.tuples(*[st.floats(-0.999, 0.999)] * 3)  # shares of a bound, but for rounding


def explained(theta, base, Z, spread, error):
    """A diagnosis that sees base + theta Z and an admitted error, a share of bound and spread, (3,)."""
    fdi = new_fdi()
    fie = estimator(fdi, low=-1.0, high=0.0)
    fdi["bound"]["nu_max"] = 0.1
    fie["effect"]["h"], fie["effect"]["Z"], fie["effect"]["r"] = base, Z, spread
    fdi["bank"]["output"]["innovation"] = base + theta * np.array(Z) + (0.1 + spread) * np.array(error)
    return fdi, fie


@given(theta=st.floats(-1.0, 0.0), frames=st.lists(st.tuples(AXES, AXES, WITHIN), min_size=1, max_size=5),
       spread=st.floats(0.0, 0.3), shared=st.booleans())  # fmt: skip
def test_the_true_theta_stays_in_every_set_and_sets_shrink(theta, frames, spread, shared):
    lo, hi = np.full(3, -1.0), np.zeros(3)
    for base, Z, error in frames:
        fdi, fie = explained(theta, base, Z, spread, error)
        fdi["isolation"]["config"]["shared"] = shared
        fie["set_lo"], fie["set_hi"], fie["theta"], fie["B"] = lo, hi, -0.5, 0.05
        fie["Om"] = Z
        fie["residual"] = fie["Om"] * (theta + 0.5) + 0.05 * np.array(error)
        kept = on(estimators.theta_explains, fdi, fie), on(estimators.narrow_sets, fdi, fie)
        assert all(kept)
        assert (fie["set_lo"] <= theta + 1e-9).all()
        assert (fie["set_hi"] >= theta - 1e-9).all()
        assert (fie["set_lo"] >= lo).all()
        assert (fie["set_hi"] <= hi).all()
        lo, hi = fie["set_lo"].copy(), fie["set_hi"].copy()


@given(measured=st.floats(-1.0, 1.0), bound=st.floats(0.0, 0.5),
       Z=st.floats(0.2, 2.0), sign=st.sampled_from([-1.0, 1.0]))  # fmt: skip
def test_of_one_axis_the_set_is_what_solves_the_inequality(measured, bound, Z, sign):
    low, high = explain(measured, bound, sign * Z, -5.0, 5.0)
    theta = np.linspace(-6.0, 6.0, 4001)
    agrees = (np.abs(measured - theta * sign * Z) <= bound) & (np.abs(theta) <= 5.0)
    inside = (low <= theta) & (theta <= high)
    at_an_end = np.minimum(np.abs(theta - low), np.abs(theta - high)) < 1e-9
    assert (agrees == inside)[~at_an_end].all()


TURNED = st.tuples(st.floats(0.6, 1.0), st.floats(-1.0, -0.6), st.floats(-1.0, 1.0))


@given(theta=st.floats(-1.0, 0.0), Z=TURNED, beyond=st.floats(0.01, 1.0))
def test_what_no_theta_explains_on_two_axes_together_is_excluded(theta, Z, beyond):
    """Axis 0 asks for less than theta by its bound, axis 1 for more."""
    fdi, fie = explained(theta, np.zeros(3), Z, 0.05, np.zeros(3))
    fdi["bank"]["output"]["innovation"][:2] -= 0.15 + beyond
    at_rest = (np.abs(fdi["bank"]["output"]["innovation"]) <= 0.1).all()
    both = on(estimators.theta_explains, fdi, fie)
    fie["skip"][:2] = 1
    neither = on(estimators.theta_explains, fdi, fie)
    assert at_rest or not both
    assert neither
