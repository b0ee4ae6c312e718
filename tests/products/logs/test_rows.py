"""From probabilities of hypotheses to rows: each step by hand, and the whole as it was kept."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import diagnose
from beaver_ftc_logs.bank import NO_RESPONSE, UNKNOWN_OFFSET, build_bank
from kept import in_short
from products.logs import small

SETTINGS = {"level_step": 0.25, "alarm": 0.5, "bounds": 0.8}
WING = small.model(settings=SETTINGS)
TAIL = small.model(small.TAIL, settings=SETTINGS)


@pytest.mark.parametrize(("at_hz", "of_hz", "taken"), [
    (10.0, 8.0, True), (10.001, 8.0, False), (6.0, 8.0, True), (5.999, 8.0, False),
])  # fmt: skip
def test_a_log_may_be_a_quarter_off_the_rate(at_hz, of_hz, taken):
    samples, model = small.flight(WING, 20, dt_s=1.0 / at_hz), small.model(rate_hz=of_hz)
    if taken:
        assert diagnose.check_log_fits_model(samples, model) is None
        return
    with pytest.raises(BadInput, match=r"allowed: within 25% of the 8 Hz the model was identified at"):
        diagnose.check_log_fits_model(samples, model)


@pytest.mark.parametrize(("hold_s", "stands"), [
    (0.0, [0, 1, 1, 1, 1, 0, 1, 0]), (0.1, [0, 0, 1, 1, 1, 0, 0, 0]), (0.2, [0, 0, 0, 1, 1, 0, 0, 0]),
    (0.26, [0, 0, 0, 0, 1, 0, 0, 0]), (0.4, [0, 0, 0, 0, 0, 0, 0, 0]),
])  # fmt: skip
def test_a_condition_stands_once_it_has_held(hold_s, stands):
    model = small.model(settings={"hold_s": hold_s})
    raised = np.array([0, 1, 1, 1, 1, 0, 1, 0], dtype=bool)
    assert diagnose._held_long_enough(raised, model).astype(int).tolist() == stands
    assert diagnose._held_long_enough(raised[1:], model).astype(int).tolist() == stands[1:]


@pytest.mark.parametrize(("raised", "well", "alarm"), [
    ("0100000", "0000100", "0111000"),  # until health is likelier again
    ("0100000", "0111000", "0100000"),  # raised goes before well
    ("0001001", "1110010", "0001101"),
    ("0000000", "0000000", "0000000"),
    ("1000000", "0000000", "1111111"),  # from the first row on
    ("1000000", "1100000", "1000000"),
])  # fmt: skip
def test_an_alarm_stands_until_health_is_the_likelier(raised, well, alarm):
    given = (np.array([flag == "1" for flag in flags]) for flags in (raised, well))
    assert "".join(str(int(flag)) for flag in diagnose._latched(*given)) == alarm


LEVELS = np.array([0.0, 0.25, 0.5, 1.0])


@pytest.mark.parametrize(("mass", "median"), [
    ([0.0, 0.5, 0.0, 0.5], 0.25), ([0.0, 0.499, 0.002, 0.499], 0.5), ([0.2, 0.2, 0.1, 0.5], 0.5),
    ([0.6, 0.2, 0.1, 0.1], 0.0), ([0.1, 0.1, 0.1, 0.7], 1.0),
])  # fmt: skip
def test_half_of_the_probability_is_on_either_side_of_the_median(mass, median):
    assert diagnose._median_level(LEVELS, np.array([mass])).tolist() == [median]


@pytest.mark.parametrize(("mass", "bounds"), [
    ([0.0, 0.9, 0.1, 0.0], (0.125, 0.375)),
    ([0.1, 0.5, 0.4, 0.0], (0.125, 0.75)),  # two hold it: half a step more each way
    ([0.8, 0.1, 0.1, 0.0], (0.0, 0.125)),  # just so much is enough
    ([0.79, 0.01, 0.0, 0.2], (0.0, 1.0)),
    ([0.1, 0.0, 0.0, 0.9], (0.75, 1.0)),
    ([0.3, 0.3, 0.3, 0.1], (0.0, 0.75)),
    ([0.4, 0.0, 0.5, 0.1], (0.0, 0.75)),  # what lies between is inside
])  # fmt: skip
def test_bounds_are_of_the_fewest_levels_that_hold_the_share(mass, bounds):
    low, high = diagnose._credible_bounds(LEVELS, np.array([mass]), 0.8)
    assert (low[0], high[0]) == bounds


def test_a_groups_levels_are_over_all_hypotheses_but_the_idle_one():
    bank = build_bank(WING)
    posterior = np.arange(1.0, len(bank.hypothesis_kind) + 1)[None, :] / 1000.0
    for group in (0, 1):
        levels, mass = diagnose._group_levels(bank, posterior[:, : bank.no_response_hypothesis_index], group)
        assert levels.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
        for level, found in zip(levels, mass[0], strict=True):
            its = (bank.effectiveness[:-1, group] == level).nonzero()[0]
            assert found == pytest.approx(sum(k + 1 for k in its) / 1000.0)


def posterior(bank, *shares):
    """A row each: {what: probability}, what being `idle`, `unknown` or (level of each group)."""
    rows = np.zeros((len(shares), len(bank.hypothesis_kind)))
    for row, said in zip(rows, shares, strict=True):
        for what, share in said.items():
            if isinstance(what, str):
                row[
                    (bank.hypothesis_kind == {"idle": NO_RESPONSE, "unknown": UNKNOWN_OFFSET}[what]).argmax()
                ] = share
                continue
            row[
                ((bank.effectiveness == what).all(axis=1) & (bank.hypothesis_kind != UNKNOWN_OFFSET)).argmax()
            ] = share
    return rows


ONE = np.array([1])
SOUND, RIGHT, LEFT, BOTH = (1.0, 1.0), (0.5, 1.0), (1.0, 0.25), (0.5, 0.25)
SHARES = {
    "found and gone": [
        {SOUND: 1.0}, {SOUND: 0.5, LEFT: 0.5}, {SOUND: 0.51, LEFT: 0.49}, {LEFT: 0.9, SOUND: 0.1},
    ],
    "which of them": [
        {LEFT: 0.5, RIGHT: 0.5}, {LEFT: 0.51, RIGHT: 0.49}, {BOTH: 0.6, LEFT: 0.4}, {RIGHT: 1.0},
    ],
    "on the ground": [
        {"idle": 1.0}, {"idle": 0.5, LEFT: 0.5}, {"idle": 0.51, LEFT: 0.49}, {"idle": 0.2, LEFT: 0.8},
    ],
    "well again by being idle": [
        {LEFT: 1.0}, {LEFT: 0.45, "idle": 0.3, SOUND: 0.25}, {LEFT: 0.9, SOUND: 0.1},
    ],
}  # fmt: skip
STUCK = [
    {LEFT: 1.0}, {"unknown": 0.6, LEFT: 0.4}, {"unknown": 0.5, LEFT: 0.5}, {"unknown": 0.7, RIGHT: 0.3},
    {SOUND: 1.0}, {RIGHT: 0.6, "unknown": 0.4}, {"unknown": 1.0}, {SOUND: 0.9, RIGHT: 0.1},
]  # fmt: skip


def held(rows):
    return {name: value for name, value in vars(rows).items() if name != "t_s"}


@pytest.mark.parametrize("name", SHARES)
def test_rows_of_probabilities(changed, name):
    bank = build_bank(WING)
    shares = posterior(bank, *SHARES[name])
    samples = small.flight(WING, len(shares))
    found = diagnose.rows_of_posterior(samples, WING, bank, shares)
    assert not changed(held(found))
    assert found.t_s is samples.t_s


def test_rows_of_surfaces_together_that_may_be_stuck(changed):
    bank = build_bank(TAIL)
    shares = posterior(bank, *STUCK)
    assert not changed(held(diagnose.rows_of_posterior(small.flight(TAIL, len(shares)), TAIL, bank, shares)))


def test_names_by_hand():
    """An offset of no known cause keeps the name that stood; none is named where the fault is split."""
    bank = build_bank(TAIL)
    found = diagnose.rows_of_posterior(small.flight(TAIL, len(STUCK)), TAIL, bank, posterior(bank, *STUCK))
    assert found.faulty.tolist() == [1, 1, 1, 1, 0, 1, 1, 0]
    aileron = "left_aileron+right_aileron"
    assert found.isolated_surfaces.tolist() == ["elevator"] * 3 + ["elevator", "", aileron, aileron, ""]
    assert found.effectiveness[0].tolist() == [1.0, 0.25, 1.0]
    assert (found.effectiveness_low[5].tolist(), found.effectiveness_high[5].tolist()) == (
        [0.0, 0.875, 0.0],
        [1.0, 1.0, 1.0],
    )
    first = diagnose._surfaces_at_fault(
        TAIL, bank, posterior(bank, {"unknown": 0.9, LEFT: 0.1}), ONE, ONE > 0
    )
    assert first.tolist() == ["elevator"]
    split = diagnose._surfaces_at_fault(TAIL, bank, posterior(bank, {LEFT: 0.5, RIGHT: 0.5}), ONE, ONE > 0)
    assert split.tolist() == ["unknown"]


def test_names_under_other_laws(monkeypatch):
    """Unknown until the evidence is four times the threshold; another name waits a second; one group."""
    settings = WING.settings.model_copy(update={"alarm_threshold": 2.0})
    asks = settings.model_copy(
        update={
            "name_evidence_ratio": 4.0,
            "rename_hold_s": 1.0,
            "one_faulty_group": True,
        }
    )
    model = WING.model_copy(update={"settings": asks})
    reach = round(WING.rate_hz)
    gained = np.concatenate([[1.0, 1.0, 5.0, 1.0], np.zeros(2 * reach + 2)])
    monkeypatch.setattr(diagnose, "fault_evidence", lambda posterior, bank: gained)
    shares = [{LEFT: 1.0}] * 4 + [{BOTH: 0.6, LEFT: 0.4}] + [{RIGHT: 1.0}] * (2 * reach + 1)
    bank = build_bank(model)

    def named_by(of):
        found = diagnose.rows_of_posterior(small.flight(of, len(shares)), of, bank, posterior(bank, *shares))
        assert found.faulty.tolist() == [0, 1] + [1] * (len(shares) - 2)
        return found.isolated_surfaces.tolist()

    assert named_by(model) == ["", "unknown", "unknown", *["left"] * (2 + reach), *["right"] * (reach + 1)]
    same = model.model_copy(update={"settings": settings})
    assert named_by(same) == ["", *["left"] * 3, "right+left", *["right"] * (2 * reach + 1)]


def test_where_an_engine_may_have_failed_nothing_is_said_of_the_surface(monkeypatch):
    rows = small.rows([(1, "left", [1.0, 0.5]), (1, "left", [1.0, 0.4]), (1, "right", [0.3, 1.0])])
    given = []

    def renamed(*of):
        given.append(of[3:])
        return np.array(["left", UNKNOWN_OFFSET, "right"], dtype=object)

    monkeypatch.setattr(diagnose.energy, "withdraw_surfaces", renamed)
    model = SimpleNamespace(fitted_ranges=SimpleNamespace(unpowered_climb_mps=-1.5))
    found = diagnose._withdraw_by_engine(SimpleNamespace(energy_height_rate_mps="climb"), model, rows)
    assert given[0][:2] == ("climb", -1.5)
    assert found.isolated_surfaces.tolist() == ["left", UNKNOWN_OFFSET, "right"]
    for name, value in (("effectiveness", 1.0), ("effectiveness_low", 0.0), ("effectiveness_high", 1.0)):
        values = getattr(rows, name).copy()
        values[1] = value
        np.testing.assert_array_equal(getattr(found, name), values)
    for fitted, climb in (
        (None, "climb"),
        (SimpleNamespace(unpowered_climb_mps=None), "climb"),
        (model.fitted_ranges, None),
    ):
        alike = diagnose._withdraw_by_engine(
            SimpleNamespace(energy_height_rate_mps=climb), SimpleNamespace(fitted_ranges=fitted), rows
        )
        assert alike is rows


def test_rows_at_the_stamps_of_a_faster_log():
    """Each stamp has the last row up to it; those before the first have the first."""
    rows = small.rows(
        [(1, "", [1.0, 1.0]), (1, "left", [1.0, 0.5]), (1, "right", [0.4, 1.0])]
    )  # at 10, 10.5, 11
    samples = small.flight(WING, 3, log_stamps_s=np.array([9.0, 10.0, 10.4, 10.5, 10.9, 11.0, 20.0]))
    found = diagnose._at_log_stamps(samples, rows)
    last = [0, 0, 0, 1, 1, 2, 2]
    np.testing.assert_array_equal(found.t_s, samples.log_stamps_s)
    for name in (
        "faulty",
        "isolated_surfaces",
        "effectiveness",
        "effectiveness_low",
        "effectiveness_high",
        "fault_probability",
    ):
        np.testing.assert_array_equal(getattr(found, name), getattr(rows, name)[last])
    same = small.flight(WING, 3, log_stamps_s=rows.t_s)
    assert diagnose._at_log_stamps(same, rows) is rows
    late = replace(same, log_stamps_s=rows.t_s + 0.1)
    np.testing.assert_array_equal(diagnose._at_log_stamps(late, rows).t_s, rows.t_s + 0.1)


@pytest.mark.parametrize(("of", "settings"), [
    (small.WING, {"delays_s": [-0.03, 0.0, 0.04], "levels": {"left": [0.4]}, "trim_shift": 0.02}),
    (small.TAIL, {"alarm": 0.9, "hold_s": 0.3, "noise_memory_s": 5.0}),
], ids=["wing", "tail"])  # fmt: skip
def test_a_short_flight_through_the_bank(changed, of, settings):
    """20 s, weak from the seventh second on, over a gap: of every tenth row all, of the rest in short."""
    model = small.model(of, settings=settings | {"level_step": 0.25})
    samples = small.flight(model, 200, lost=((1, 70, 140, 0.4),), gap=100)
    rows = diagnose.diagnose(samples, model)
    assert not changed({
        "named": rows.isolated_surfaces[::10], "faulty": rows.faulty[::10],
        "of_a_fault": rows.fault_probability[::10],
        **{name: in_short(getattr(rows, field)) for name, field in small.FIELD_OF_KEPT.items()},
    })  # fmt: skip
    late = slice(110, 140)
    assert set(rows.isolated_surfaces[late]) == {"left" if of is small.WING else "elevator"}
    assert np.median(rows.effectiveness[late, 1]) == pytest.approx(0.4, abs=0.11)


def test_rows_of_which_no_more_is_known_are_credible_and_of_evidence_of_their_own_time():
    rows = small.rows([(3, "", [1.0, 1.0]), (2, "left", [1.0, 0.5])])
    assert rows.evidence_start_time_s.tolist() == rows.t_s.tolist() == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert rows.credible.tolist() == [1] * 5
    given = replace(rows, credible=np.array([1, 0, 1, 1, 0]), evidence_start_time_s=rows.t_s - 0.25)
    assert given.credible.tolist() == [1, 0, 1, 1, 0]
    assert given.evidence_start_time_s.tolist() == [9.75, 10.25, 10.75, 11.25, 11.75]


THREE = small.WING | {
    "surfaces": {"a": {"roll": 1.0}, "b": {"pitch": 1.0}, "c": {"roll": 1.0, "pitch": -2.0}}, "labels": {},
}  # fmt: skip
NAMED = ["", "a", "c", "a+c", "a", "unknown", "b", "a+c"]
AFTER = ["", "a", "c", "a+c", "a+b", "unknown", "b", "a+b+c"]


@pytest.mark.parametrize(("changes", "one_group", "names", "highs"), [
    ({}, False, AFTER, ["---", "---", "---", "---", "11-", "---", "---", "111"]),
    ({}, True, AFTER, ["---", "---", "---", "1-1", "11-", "---", "---", "111"]),
    ({"faults": ["loss", "stuck"]}, False, ["", "a+b", "b+c", "a+b+c", *AFTER[4:]],
     ["---", "11-", "-11", "111", "11-", "---", "---", "111"]),
])  # fmt: skip
def test_a_surface_of_unknown_effect_is_named_along_once_its_command_has_moved(
    changes, one_group, names, highs
):
    """Command of b by more than a millionth of travel, in row 4 and back. Any of several names may be sound:
    where one group is at fault, too, and two are named."""
    told = {"commands": [], "rates": [], "tied": [0.3, 0.99, 0.4]}
    model = small.model(THREE | changes, fitted=told, settings={"one_group": one_group})
    rows = small.rows([(1, name, [0.3, 0.4, 0.2]) for name in NAMED], 3)
    pitch = np.array([5.0, 5.0 + 9e-7, 5.0, 5.0, 5.1, 5.0, 5.0, 5.0])
    roll = np.linspace(-1.0, 1.0, 8)
    flown = replace(small.flight(model, 8), commands=np.column_stack([roll, pitch, 2.0 * roll]))
    found = diagnose._add_unknown_surfaces(flown, model, rows)
    assert found.isolated_surfaces.tolist() == names
    for k, high in enumerate(highs):
        left = rows.effectiveness_high[k]
        expected = [1.0 if sign == "1" else value for sign, value in zip(high, left, strict=True)]
        assert found.effectiveness_high[k].tolist() == expected
    np.testing.assert_array_equal(found.effectiveness_low, rows.effectiveness_low)
    np.testing.assert_array_equal(rows.isolated_surfaces, np.array(NAMED, dtype=object))


def test_where_a_gain_may_be_wrong_by_all_of_it_no_bound_is_given():
    """Of each surface of its group, in every row; the name and the other group stay."""
    told = {"commands": [], "rates": [], "tied": [0.3, 0.4], "gain_sd": [0.3, 0.1]}
    model = small.model(small.TAIL | {"other_laws": True}, fitted=told)
    rows = small.rows([(4, "elevator", [0.9, 0.5, 0.7])], 3)
    found = diagnose.finish_rows(small.flight(model, 4, log_stamps_s=rows.t_s), model, rows)
    for field, value in (("effectiveness", 1.0), ("effectiveness_low", 0.0), ("effectiveness_high", 1.0)):
        expected = getattr(rows, field).copy()
        expected[:, [0, 2]] = value
        np.testing.assert_array_equal(getattr(found, field), expected)
    assert set(found.isolated_surfaces) == {"elevator"}
    assert found.credible.tolist() == [1] * 4


def test_a_name_is_taken_back_where_another_group_explains_the_last_second_better():
    """Row by row: half of the squares along what each group turns, of ten samples at 10 Hz, times the share
    that a sample counts for; by more than 3 in logarithms of likelihood."""
    noise = [[0.0025, 0.0009, -0.0004], [0.0009, 0.0016, 0.0003], [-0.0004, 0.0003, 0.0005]]
    model = small.model(THREE, noise=noise, settings={"power": 0.6}, response=[
        [[0.2, -0.02, 0.01], [0.3, 0.05, -0.03]], [[0.03, 0.3, -0.02], [-0.01, 0.2, 0.04]],
        [[-0.1, 0.04, 0.2], [0.02, -0.03, 0.15]],
    ], response_sd=np.ones((3, 2, 3)).tolist(), lags=2)  # fmt: skip
    flown = small.flight(model, 60, seed=4)
    offset = np.repeat([[0.0, 0.0, 0.0], [0.12, 0.01, 0.0], [0.0, 0.1, 0.0]], 20, axis=0)
    flown = replace(flown, rates=flown.rates + offset)
    ok, left, answers = diagnose.unexplained_rates(flown, model)
    rest = left - np.array(model.intercept) - answers.sum(axis=1)
    inverse = np.linalg.inv(noise)
    gains = np.zeros((60, 3))
    for g, lags in enumerate(model.command_response):
        turn = np.sum(lags, axis=0)
        along = [
            (rest[k] @ inverse @ turn) ** 2 / (turn @ inverse @ turn) if ok[k] else 0.0 for k in range(60)
        ]
        gains[:, g] = [0.5 * 0.6 * sum(along[max(k - 9, 0) : k + 1]) for k in range(60)]
    names = ["a", "b", "c", "a+b", "b+c", "unknown", ""]
    rows = small.rows([(1, names[k % 7], [0.3, 0.4, 0.2]) for k in range(60)], 3)
    found = diagnose._withdraw_contradicted(flown, model, rows, 3.0)
    withdrawn = []
    for k in range(60):
        named = [g for g, name in enumerate("abc") if name in names[k % 7] and names[k % 7] != "unknown"]
        withdrawn.append(any(gains[k].max() - gains[k, g] > 3.0 for g in named))
    taken = np.array(withdrawn)
    assert 10 < taken.sum() < 50
    expected = ["unknown" if gone else name for gone, name in zip(taken, rows.isolated_surfaces, strict=True)]
    assert found.isolated_surfaces.tolist() == expected
    for field, value in (("effectiveness", 1.0), ("effectiveness_low", 0.0), ("effectiveness_high", 1.0)):
        np.testing.assert_array_equal(
            getattr(found, field), np.where(taken[:, None], value, getattr(rows, field))
        )
    np.testing.assert_array_equal(found.faulty, rows.faulty)


def test_under_other_laws_each_level_is_as_likely_before_the_flight():
    """The probability of a level over that before; health is not excluded before an alarm excludes it."""
    model = small.model(small.WING | {"other_laws": True}, settings=SETTINGS)
    bank = build_bank(model)
    shares = np.random.default_rng(4).uniform(size=(5, len(bank.hypothesis_kind))) * bank.prior_probability
    shares[:, (bank.effectiveness == LEFT).all(axis=1)] += [[2.0], [0.001], [0.05], [0.2], [0.0]]
    shares[:, 0] *= [0.0, 1.0, 0.3, 0.0, 1.0]
    shares[:, -1] *= 0.1
    shares /= shares.sum(axis=1, keepdims=True)
    found = diagnose.rows_of_posterior(small.flight(model, 5), model, bank, shares)
    levels, edges = [0.0, 0.25, 0.5, 0.75, 1.0], [0.0, 0.125, 0.375, 0.625, 0.875, 1.0]
    for g, (k, row) in product((0, 1), enumerate(shares)):
        its = [bank.effectiveness[:-1, g] == level for level in levels]
        odds = np.array([row[:-1][mask].sum() / bank.prior_probability[:-1][mask].sum() for mask in its])
        odds /= odds.sum()
        held, places = 0.0, []
        for place in sorted(range(5), key=lambda place: -odds[place]):
            places += [place] if held < 0.8 else []
            held += odds[place]
        high = edges[max(places) + 1] if found.faulty[k] else 1.0
        middle = next(level for level, below in zip(levels, np.cumsum(odds), strict=True) if below >= 0.5)
        assert found.effectiveness[k, g] == middle
        assert (found.effectiveness_low[k, g], found.effectiveness_high[k, g]) == (edges[min(places)], high)
    assert 0 < found.faulty.sum() < 5


@pytest.mark.parametrize("threshold", [None, 4.0])
def test_evidence_began_where_its_sum_was_last_at_zero(monkeypatch, threshold):
    """However high it may rise; in the first row where it never was."""
    model = small.model(settings=SETTINGS | {"threshold": threshold})
    gained = np.array([1.0, 2.0, -9.0, 2.0, 5.0, -6.0, 1.0, -3.0, -1.0, 2.0])
    monkeypatch.setattr(diagnose, "fault_evidence", lambda of, by: gained)
    bank = build_bank(model)
    samples = small.flight(model, 10, t_s=7.0 + 0.25 * np.arange(10))
    found = diagnose.rows_of_posterior(samples, model, bank, posterior(bank, *[{SOUND: 1.0}] * 10))
    # sums 1 3 0 2 7 1 2 0 0 2, and 1 3 0 2 4 0 1 0 0 2 where 4 is the most
    since = [0, 0, 2, 2, 2, 2, 2, 7, 8, 8] if threshold is None else [0, 0, 2, 2, 2, 5, 5, 7, 8, 8]
    assert found.evidence_start_time_s.tolist() == samples.t_s[since].tolist()


@pytest.mark.parametrize(("laws", "threshold", "colours", "doubts"), [
    (True, 2.0, [], True), (False, 2.0, [], False), (True, None, [], False),
    (True, 2.0, [{"average": [1.0], "noise": np.eye(3).tolist()}], False),
])  # fmt: skip
def test_a_diagnosis_is_of_rates_that_live_and_doubts_names_under_other_laws(
    monkeypatch, laws, threshold, colours, doubts
):
    """The filter gets the rates without those that stand still; what answers nothing is more than half."""
    model = small.model(small.WING | {"other_laws": laws}, settings={"threshold": threshold}, colours=colours)
    bank, samples, rows = SimpleNamespace(no_response_hypothesis_index=1), small.flight(model, 3), "rows"
    posterior, told = np.array([[0.5, 0.5], [0.49, 0.51], [0.9, 0.1]]), {}
    stubs = {
        "build_bank": lambda by: bank,
        "bank_posterior": lambda *of: (
            told.update(filtered=of) or (posterior, None, None)
        ),
        "rows_of_posterior": lambda *of: told.update(read=of) or rows,
        "_withdraw_contradicted": lambda *of: told.update(doubted=of) or "doubted rows",
        "finish_rows": lambda *of: (of[:3], of[3].tolist()),
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(diagnose, name, stub)
    monkeypatch.setattr(diagnose.trust, "without_dead_rows", lambda of, by: "alive")
    found = diagnose._diagnose_checked_log(samples, model)
    assert found == ((samples, model, "doubted rows" if doubts else rows), [False, True, False])
    assert told["filtered"] == ("alive", model, bank)
    assert told["read"] == (samples, model, bank, posterior)
    assert told.get("doubted") == (("alive", model, rows, threshold) if doubts else None)


@pytest.mark.parametrize(("losses", "named"), [
    ([0.6, 0.0005, 0.3], "a+c"), ([0.6, 0.0007, 0.3], "unknown"), ([0.6, 0.0005, 0.0005], "a"),
    ([0.0001, 0.0002, 0.5], "c"),
])  # fmt: skip
def test_where_one_group_is_at_fault_all_are_named_that_are_not_excluded(losses, named):
    """A thousandth of the likeliest is excluded, other kinds of faults count for nothing; where no group is
    excluded none is named."""
    model = small.model(THREE, settings=SETTINGS | {"one_group": True})
    bank = build_bank(model)
    single = [{tuple(0.5 if i == g else 1.0 for i in range(3)): share} for g, share in enumerate(losses)]
    pair = {(1.0, 0.5, 0.25): 0.09}
    shares = posterior(bank, {key: value for one in (*single, pair) for key, value in one.items()})
    found = diagnose._surfaces_at_fault(model, bank, shares, ONE, ONE > 0)
    assert found.tolist() == [named]
    assert diagnose._surfaces_at_fault(model, bank, shares, ONE, ONE < 0).tolist() == ["unknown"]
