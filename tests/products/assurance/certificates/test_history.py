"""What a log's rows bound, row by row and axis by axis, by scalars (docs/explanation/detection.md)."""

import numpy as np
import pytest

from beaver_ftc_assurance.certificates import inequality
from beaver_ftc_assurance.certificates.inequality import DeclaredErrors, History
from telling import apart, numbers

DT, SHARE = 0.02, 1 / 3
GYRO = {"offset_rad_s": [0.03, 0.05, 0.07], "constant_rad_s": [0.01, 0.02, 0.04], "slope": [0.11, 0.13, 0.17]}
DECLARED = {
    "gyro": GYRO, "earth_rad_s": 0.9, "earth_share": [1.1, 1.3, 1.7], "inertia_coupling": [0.21, 0.23, 0.29],
    "coupling": [-0.31, 0.37, -0.41], "constant_rad_s2": [0.43, 0.47, 0.53],
}  # fmt: skip


@pytest.fixture
def history():
    x, model, eta_bar = (numbers(4, 3, seed=seed) for seed in range(3))
    apart(
        x=x,
        model=model,
        eta_bar=eta_bar,
        **{k: v for k, v in DECLARED.items() if k not in ("gyro", "earth_rad_s")},
    )
    gyro = {f"gyro_{name}": np.array(values) for name, values in GYRO.items()}
    declared = DeclaredErrors(
        inertia_coupling=np.array(DECLARED["inertia_coupling"]) * np.abs(DECLARED["coupling"]),
        constant_rad_s2=np.array(DECLARED["constant_rad_s2"]), earth_rad_s=DECLARED["earth_rad_s"],
        earth_gain=np.array(DECLARED["earth_share"]), **gyro,
    )  # fmt: skip
    return History(DT, SHARE, x, model, np.abs(eta_bar), declared)


def test_what_is_always_off_counts_on_the_axes_that_are_looked_at(history):
    asked = history.with_constant_gyro_errors_on(np.array([0.0, 1.0, 0.0]))
    assert asked.declared.gyro_constant_rad_s.tolist() == [0.0, 0.02, 0.0]
    np.testing.assert_allclose(
        asked.gyro_error_change_rad_s - history.gyro_error_change_rad_s, np.full((4, 3), [0.01, 0.0, 0.04])
    )


def hypothesis(n=9, low=-0.6, high=0.35, **changes):
    """A fault whose effect is known from frame 2 on, in no two frames alike."""
    offset, slope, spread = (0.1 * numbers(n - 2, 3, seed=seed) for seed in (5, 6, 7))
    given = {"offset": offset, "slope": slope, "spread": np.abs(spread)} | changes
    return inequality.Hypothesis(2, theta_low=low, theta_high=high, **given)


@pytest.fixture
def long(history):
    """Nine rows."""
    x, model, eta_bar = (numbers(9, 3, seed=seed) for seed in (11, 12, 13))
    return History(DT, SHARE, x, model, np.abs(eta_bar), history.declared)


def test_each_frame_and_axis_bounds_theta_by_what_explains_its_innovation(long):
    of = hypothesis(axes=(0, 2))
    of.slope[3, 2] = 0.0
    frames = np.array([4, 5, 7])
    lower, upper, slope = inequality.theta_bounds_by_frame(of, long, frames)
    assert lower.shape == (4, 3)
    nu = np.diff(long.rates_rad_s, axis=0)[3:7] / DT - long.model_rad_s2[4:8]
    for k in range(4):
        for i in range(3):
            Z = of.slope[k + 2, i]
            if k == 2 or i == 1 or Z == 0.0:
                assert (lower[k, i], upper[k, i], slope[k, i]) == (-np.inf, np.inf, 1.0)
                continue
            wide = long.innovation_bound(slice(k + 4, k + 5))[0, i] + of.spread[k + 2, i]
            ends = sorted((nu[k, i] - of.offset[k + 2, i] + side * wide) / Z for side in (-1, 1))
            assert (lower[k, i], upper[k, i], slope[k, i]) == pytest.approx((*ends, Z))


def test_in_one_frame_two_axes_are_combined_so_that_theta_drops_out():
    of = hypothesis(axes=(0, 2))
    of.slope[4] = [0.3, 0.4, -0.6]
    tests = [term for (term,) in inequality.single_frame_tests(6, of)]
    assert {(term.filter_start, term.last_frame, term.pole_per_s) for term in tests} == {(5, 6, np.inf)}
    found = [term.direction.tolist() for term in tests]
    assert found[:4] == [[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]]
    np.testing.assert_allclose(found[4:], [[-1.0, 0, -0.5], [1.0, 0, 0.5]])
    of.slope[4, [0, 2]] = 0.0
    assert len([*inequality.single_frame_tests(6, of)]) == 4
