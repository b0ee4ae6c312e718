"""The bank of hypotheses and what a flight may differ in, whole, from small models."""

import numpy as np
import pytest

from beaver_ftc_logs.bank import (
    GROUP_LOSS,
    HEALTHY,
    NO_RESPONSE,
    PAIR_LOSS,
    UNKNOWN_OFFSET,
    build_bank,
    build_noise,
    build_states,
)
from products.logs import small

SETTINGS = {
    "changes_per_hour": 9.0, "repair_share": 0.2, "level_share": 0.7, "level_step": 0.25, "trim_sd": 0.4,
    "trim_shift": 0.03, "trim_walk": [1e-3, 2e-3, 3e-3], "gain_sd": 0.12, "gain_time_s": 300.0,
    "own_gain_sd": 0.05, "own_gain_time_s": 80.0, "trim_bound": 5.0, "gain_bound": 2.5, "jam_sd": 1.7,
    "power": 0.8, "tail": 6.0, "noise_memory_s": 40.0,
}  # fmt: skip
ONE = small.WING | {"surfaces": {"right": {"roll": 1.0}}, "labels": {}}
MODELS = {
    "two groups, levels seen of one": small.model(settings=SETTINGS | {"levels": {"left": [0.4]}}),
    "every level seen": small.model(settings=SETTINGS | {"levels": {"left": [0.0, 0.25, 0.5, 0.75]}}),
    "slaved, may be stuck": small.model(small.TAIL, settings=SETTINGS),
    "one group": small.model(ONE, settings=SETTINGS),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_hypotheses_of_a_model(changed, name):
    assert not changed(build_bank(MODELS[name])._asdict())


@pytest.mark.parametrize("name", MODELS)
def test_what_may_differ_from_a_model(changed, name):
    model = MODELS[name]
    assert not changed(
        {
            "adaptation": build_states(model)._asdict(),
            "noise": build_noise(model)._asdict(),
        }
    )


@pytest.mark.parametrize("name", MODELS)
def test_shares_are_those_of_the_settings(name):
    """Of changes a fifth restores health, and the others are all the rest; a flight begins healthy at 0.7."""
    model = MODELS[name]
    bank = build_bank(model)
    assert bank.transition_share[0] == 0.2
    assert bank.transition_share.sum() == pytest.approx(1.0)
    assert (bank.prior_probability[0], bank.prior_probability[-1], bank.prior_probability.sum()) == (
        0.7,
        0.2,
        pytest.approx(1.0),
    )
    assert bank.change_probability_per_sample == pytest.approx(9.0 / 36000.0)
    assert bank.no_response_hypothesis_index == len(bank.hypothesis_kind) - 1
    assert bank.hypothesis_kind[[0, -1]].tolist() == [HEALTHY, NO_RESPONSE]
    assert bank.is_fault_hypothesis.tolist() == [
        kind in (GROUP_LOSS, PAIR_LOSS) for kind in bank.hypothesis_kind
    ]
    lost = (bank.effectiveness < 1.0).sum(axis=1)
    assert {
        kind: set(lost[bank.hypothesis_kind == kind]) for kind in (HEALTHY, GROUP_LOSS, UNKNOWN_OFFSET)
    } == {
        HEALTHY: {0},
        GROUP_LOSS: {1},
        UNKNOWN_OFFSET: {0} if UNKNOWN_OFFSET in bank.hypothesis_kind else set(),
    }
    for group in range(len(model.groups)):
        expected = [left < 1.0 for left in bank.effectiveness[:-1, group]]
        assert bank.is_fault_of_group(group).tolist() == [*expected, False]


def test_levels_seen_carry_their_share_of_a_groups_faults():
    bank = build_bank(MODELS["two groups, levels seen of one"])
    left = (bank.hypothesis_kind == GROUP_LOSS) & (bank.effectiveness[:, 1] < 1.0)
    weight = dict(zip(bank.effectiveness[left, 1].tolist(), bank.transition_share[left], strict=True))
    assert sorted(weight) == [0.0, 0.25, 0.4, 0.5, 0.75]
    assert weight[0.4] / sum(weight.values()) == pytest.approx(0.7)
    assert len({round(share, 12) for level, share in weight.items() if level != 0.4}) == 1


def test_a_stuck_surface_offsets_the_axes_it_moves_most():
    """0.3 to 1 of 1.7 residual sd, by the sum of its responses; a loss brings none."""
    model = MODELS["slaved, may be stuck"]
    bank = build_bank(model)
    noise = np.diag(model.residual_covariance)
    moved = np.abs(np.array(model.command_response)).sum(axis=1) / np.sqrt(noise)
    for group in range(2):
        mine = (bank.hypothesis_kind == GROUP_LOSS) & (bank.effectiveness[:, group] < 1.0)
        found = np.unique(bank.rate_offset_variance[mine], axis=0)
        share = np.clip(moved[group] / moved[group].max(), 0.3, 1.0)
        np.testing.assert_allclose(found, [[0.0] * 3, noise * (1.7 * share) ** 2], rtol=1e-12)
    np.testing.assert_allclose(
        bank.rate_offset_variance[bank.hypothesis_kind == UNKNOWN_OFFSET], [noise * 1.7**2], rtol=1e-12
    )


def test_a_group_of_which_nothing_is_said_has_no_hypothesis():
    told = {"commands": [], "rates": [], "tied": [1.0, 0.2]}
    bank = build_bank(small.model(settings=SETTINGS, fitted=told))
    assert (bank.effectiveness[:-1, 0] == 1.0).all()
    assert bank.transition_share.sum() == pytest.approx(1.0)
    nothing = build_bank(small.model(settings=SETTINGS, fitted=told | {"tied": [1.0, 1.0]}))
    assert len(nothing.transition_share) == len(build_bank(small.model(settings=SETTINGS)).transition_share)


def test_of_another_law_a_surface_s_own_gain_counts_whole_whatever_is_left_of_it():
    plain, other = (
        build_bank(small.model(small.WING | {"other_laws": laws}, settings=SETTINGS))
        for laws in (False, True)
    )
    np.testing.assert_array_equal(plain.own_gain_share, plain.effectiveness)
    np.testing.assert_array_equal(other.effectiveness, plain.effectiveness)
    np.testing.assert_array_equal(other.own_gain_share, np.ones_like(plain.effectiveness))
