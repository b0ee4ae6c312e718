"""What a log's rows bound, row by row and axis by axis, by scalars (docs/explanation/detection.md)."""

import numpy as np
import pytest

from beaver_ftc_assurance.certificates import inequality
from beaver_ftc_assurance.certificates.inequality import ROUNDING_RAD_S2, DeclaredErrors, History
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


@pytest.mark.parametrize("k", range(4))
def test_a_row_says_what_its_numbers_and_the_row_before_say(history, k):
    one = slice(k, k + 1)
    found = [of(one)[0] for of in (history.innovation, history.innovation_bound, history.unstated_bound)]
    if k == 0:  # before which nothing is known
        assert np.isnan(found).all()
        return
    g = np.array(DECLARED["earth_share"])
    size = [[abs(history.rates_rad_s[j, i]) + off(history, j, i) for i in range(3)] for j in range(4)]
    for i in range(3):
        rate, before = history.rates_rad_s[k, i], history.rates_rad_s[k - 1, i]
        assert history.gyro_error_rad_s[k, i] == pytest.approx(off(history, k, i))
        assert found[0][i] == pytest.approx((rate - before) / DT - history.model_rad_s2[k, i])
        noise = [
            GYRO["offset_rad_s"][i] - GYRO["constant_rad_s"][i] + GYRO["slope"][i] * size[j][i]
            for j in (k, k - 1)
        ]
        assert found[1][i] == pytest.approx(history.eta_bar_rad_s2[k, i] + sum(noise) / DT)
        one, other = (size[k - 1][j] for j in range(3) if j != i)
        coupled = DECLARED["inertia_coupling"][i] * abs(DECLARED["coupling"][i]) * one * other
        of_earth = 0.9 * ((1 + g[i]) * sum(size[k - 1]) + g[i] * 0.9) + ROUNDING_RAD_S2
        known = coupled + DECLARED["constant_rad_s2"][i] + of_earth
        assert found[2][i] == pytest.approx(history.eta_bar_rad_s2[k, i] - SHARE * known)


def off(history, k, i):
    """The largest |true - reading| with |true - reading| <= offset + slope |true|."""
    return (GYRO["offset_rad_s"][i] + GYRO["slope"][i] * abs(history.rates_rad_s[k, i])) / (
        1 - GYRO["slope"][i]
    )


def test_what_is_always_off_counts_on_the_axes_that_are_looked_at(history):
    asked = history.with_constant_gyro_errors_on(np.array([0.0, 1.0, 0.0]))
    assert asked.declared.gyro_constant_rad_s.tolist() == [0.0, 0.02, 0.0]
    np.testing.assert_allclose(
        asked.gyro_error_change_rad_s - history.gyro_error_change_rad_s, np.full((4, 3), [0.01, 0.0, 0.04])
    )


@pytest.mark.parametrize(
    ("low", "high", "slopes", "constant", "said", "most"),
    [
        (-1.0, 0.0, (0.5, 0.25), True, {"Z": False, "least": False, "most": False}, 0.0),
        (-1.0, 0.0, (-0.5, -0.25), True, {"Z": True, "least": True, "most": False}, 2.0),
        (-0.25, 0.5, (0.5, 0.25), True, {"Z": True, "least": False, "most": True}, 1.0),
        (-0.25, 0.5, (0.5, -0.25), True, {"Z": True, "least": False, "most": False}, 0.0),
        (-0.25, 0.5, (0.5, 0.25), False, {"Z": True, "least": True, "most": False}, 0.0),
    ],
)
def test_an_inequality_has_the_numbers_that_decide_it(monkeypatch, low, high, slopes, constant, said, most):
    """Two terms, of weights 2 and 4: the end of theta that allows most, and no slope that allows nothing."""

    def term(which, of, history):
        return {"weight": 2.0 + 2.0 * which, "slope": slopes[which], "value": 3.0 + which, "Z": [1.0],
                "limit": 5.0 + which, "decides": {"least": which == 1, "most": False}}  # fmt: skip

    monkeypatch.setattr(inequality, "_term_fields", term)
    zero = np.zeros((1, 3))
    of = inequality.Hypothesis(0, zero, zero, zero, low, high, constant)
    found = inequality.inequality_fields([0, 1], of, None)
    assert found["sides"] == pytest.approx([2 * 3 + 4 * 4, 2 * 5 + 4 * 6 + most])
    ends = {"least": low, "most": high}
    assert {end: found[end] for end in ends if end in found} == {e: v for e, v in ends.items() if said[e]}
    assert ["Z" in one for one in found["terms"]] == [said["Z"]] * 2
    assert found["theta"] == ("constant" if constant else "any")


@pytest.mark.parametrize(
    ("pole", "since", "known", "constant", "first"),
    [
        (np.inf, 10, 0, False, 100),  # the frame's own innovation
        (1.0, 10, 0, False, 85), (1.0, 90, 0, False, 91), (1.0, 10, 95, False, 96),
        (1.0, 10, 0, True, 11), (64.0, 10, 0, True, 89), (64.0, 10, 0, False, 89), (1e4, 10, 0, False, 100),
    ],
)  # fmt: skip
def test_from_which_frame_on_an_inequality_is_written_out(pole, since, known, constant, first):
    """16 frames, of a constant all since the filter began; none older than 16 time constants, at 0.02 s."""
    term = inequality.Term(np.zeros(3), pole, since, 100, first_kept_frame=known)
    zero = np.zeros((1, 3))
    of = inequality.Hypothesis(0, zero, zero, zero, 0.0, 1.0, constant)
    assert inequality._first_written_frame(term, of, 0.02) == first
