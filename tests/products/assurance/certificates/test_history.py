"""What a log's rows bound, row by row and axis by axis, by scalars (docs/explanation/detection.md)."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_assurance.certificates import certificate, inequality
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


D = np.array([0.7, -0.2, 0.5])


def filtered(decay, inputs):
    """A filter's state after these inputs, rad/s2."""
    state = 0.0
    for value in inputs:
        state = decay * state + DT * value
    return state


@pytest.mark.parametrize("pole", [0.5, 20.0, np.inf])
@pytest.mark.parametrize("constant", [True, False])
@pytest.mark.parametrize("first", [4, 6])
def test_a_filter_reaches_what_its_frames_and_the_worst_errors_drive_it_to(long, pole, constant, first):
    """From frame 3, at which it is zero, to frame 8: errors of the model in each frame and of the gyros at
    both of its ends, each at its worst, and the largest effect of a fault, frame by frame."""
    term = inequality.Term(D, pole, 3, 8, first_kept_frame=2, effect_before=0.09)
    of = hypothesis(theta_is_constant=constant)
    decay, frames = (np.exp(-pole * DT) if np.isfinite(pole) else 0.0), range(4, 9)
    value, limit, slope, _ = inequality.evaluate_term(term, of, long, first)
    x, nu = long.rates_rad_s, {}
    for k in frames:
        nu[k] = D @ ((x[k] - x[k - 1]) / DT - long.model_rad_s2[k])
    assert value == pytest.approx(filtered(decay, nu.values()))
    worst = filtered(decay, [np.abs(D) @ long.eta_bar_rad_s2[k] for k in frames])
    for j in range(3, 9):  # a reading that is off drives the frame that it ends, and the next the other way
        driven = filtered(decay, [((k == j) - (k - 1 == j)) / DT for k in frames])
        worst += abs(driven) * np.abs(D) @ long.gyro_error_change_rad_s[j]
    h, Z, r = of.offset[2:] @ D, of.slope[2:] @ D, of.spread[2:] @ np.abs(D)
    if constant and first > 4:
        return  # a constant is written out from the filter's first frame on
    start = decay**5 * 0.09
    if constant:
        assert slope == pytest.approx(filtered(decay, Z))
        assert limit == pytest.approx(worst + start + filtered(decay, h + r))
    else:
        most = [max(0.0, a - 0.6 * b, a + 0.35 * b) + c for a, b, c in zip(h, Z, r, strict=True)]
        assert (slope, limit) == (0.0, pytest.approx(worst + start + filtered(decay, most)))


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


@pytest.mark.parametrize("ends", [(-0.6, 0.35), (-90.0, 0.35), (-0.6, 90.0), (-90.0, 90.0), (500.0, 501.0)])
def test_two_frames_are_held_against_one_another_or_against_the_range_of_theta(long, ends):
    """In units of theta the left side exceeds the right by the largest lower bound less the smallest upper
    one, each of them that of a frame or the end of the range."""
    of, frames = hypothesis(low=ends[0], high=ends[1], theta_is_constant=True), np.array([4, 5, 7])
    lower, upper, _ = inequality.theta_bounds_by_frame(of, long, frames)
    terms = inequality.constant_theta_tests(of, long, frames)
    assert [term.last_frame in frames for term in terms] == [True] * len(terms)
    if not terms:
        assert lower.max() <= ends[0]
        assert upper.min() >= ends[1]
        return
    value, limit = inequality.sides(terms, of, long)
    assert value - limit == pytest.approx(max(lower.max(), ends[0]) - min(upper.min(), ends[1]))
    assert inequality.is_violated(terms, of, long) == (value > limit)
    assert inequality.constant_theta_tests(of, long, np.array([], int)) == []


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


@pytest.mark.parametrize(
    ("h", "Z", "said", "effects"),
    [
        (
            [-0.1, 0.2, -0.4], [0.05, 0.3, -0.9],
            {"least": -0.5, "most": 2.0, "h": [None, 0.2, -0.4], "Z": [None, 0.3, -0.9]}, [0.0, 0.8, 0.05],
        ),
        (
            [-0.1, 0.2, -0.4], [0.05, 0.3, 0.1],
            {"most": 2.0, "h": [None, 0.2, None], "Z": [None, 0.3, None]}, [0.0, 0.8, 0.0],
        ),
        ([-0.1, 0.2, 0.3], [0.0, 0.0, 0.0], {"h": [None, 0.2, 0.3]}, [0.0, 0.2, 0.3]),
        ([-0.1, -0.2, -0.4], [0.05, 0.03, -0.3], {}, [0.0, 0.0, 0.0]),
    ],
)  # fmt: skip
def test_frames_in_which_the_fault_adds_nothing_have_no_number(history, h, Z, said, effects):
    """A fault that may be absent in any frame: theta from -0.5 to 2, of a filter over three frames."""
    along = np.array([0.0, 0.0, 1.0])
    term = inequality.Term(along, pole_per_s=3.0, filter_start=0, last_frame=3, weight=0.7)
    offset, slope = np.outer(h, along), np.outer(Z, along)
    fault = inequality.Hypothesis(1, offset, slope, np.zeros((3, 3)), theta_low=-0.5, theta_high=2.0)
    found = inequality.inequality_fields([term], fault, history)
    healthy = inequality.inequality_fields([term], inequality.no_fault(1, 3), history)
    decides = {name: found[name] for name in ("least", "most") if name in found}
    assert decides | {name: found["terms"][0][name] for name in "hZ" if name in found["terms"][0]} == said
    decay = np.exp(-3.0 * DT)
    added = 0.7 * DT * (decay**2 * effects[0] + decay * effects[1] + effects[2])
    assert found["sides"] == pytest.approx([healthy["sides"][0], healthy["sides"][1] + added], rel=1e-14)


@pytest.mark.parametrize(
    ("instant_share", "frames", "unexplained"),
    [
        (1.0, [1, 2, 3], [True, True, False]), (0.5, [1, 2, 3], [False, False, False]),
        (0.5, [4, 5, 6, 7], [False, True, True, False]), (0.5, [5], [True]), (1.0, [7], [True]),
    ],
)  # fmt: skip
def test_of_several_instants_the_frames_beside_count_too(instant_share, frames, unexplained):
    """Health explains frames 0, 3 and 8; on the other frames one axis is beyond its bound."""
    exceeds = np.array([0, 1, 1, 0, 1, 1, 1, 1, 0], bool)
    seen = SimpleNamespace(
        rates_rad_s=np.zeros((9, 3)), instant_share=instant_share,
        innovation=lambda rows: np.outer(exceeds, [0.0, -2.0, 0.0])[rows],
        innovation_bound=lambda rows: np.ones((9, 3))[rows],
    )  # fmt: skip
    found = certificate.kinds.is_unexplained_by_health(seen, np.array(frames))
    assert found.tolist() == unexplained


@pytest.mark.parametrize(
    ("unexplained", "constant"),
    [(True, {"q": 0.02, "r": 0.04}), (False, dict(zip("pqr", GYRO["constant_rad_s"], strict=True)))],
)
def test_statements_of_positions_go_by_the_declared_errors_too(history, monkeypatch, unexplained, constant):
    """One term along q, and a bound on a position along r. A constant error of the gyro counts on these axes,
    or on all where health explains a frame that is said to show a fault."""
    monkeypatch.setattr(
        certificate.kinds, "is_unexplained_by_health", lambda seen, rows: np.full(len(rows), unexplained)
    )
    said = [
        {"theta": "any", "terms": [{"d": [0.0, 0.5, 0.0], "first": 1, "frame": 2}]},
        {"theta": "course", "bounds": [{"d": [0.0, 0.0, -0.7], "first": 2, "frame": 3}]},
    ]
    found = certificate._declared_fields(SimpleNamespace(substeps=2), history, said)
    assert (found["dt_s"], found["instants"], found["omega_E"]) == (DT, 2, 0.9)
    assert found["declared"]["B"] == constant
