"""The bank of hypotheses and what a flight may differ in, whole, from small models."""

import pytest

from beaver_ftc_logs.bank import (
    GROUP_LOSS,
    build_bank,
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


def test_levels_seen_carry_their_share_of_a_groups_faults():
    bank = build_bank(MODELS["two groups, levels seen of one"])
    left = (bank.hypothesis_kind == GROUP_LOSS) & (bank.effectiveness[:, 1] < 1.0)
    weight = dict(zip(bank.effectiveness[left, 1].tolist(), bank.transition_share[left], strict=True))
    assert sorted(weight) == [0.0, 0.25, 0.4, 0.5, 0.75]
    assert weight[0.4] / sum(weight.values()) == pytest.approx(0.7)
    assert len({round(share, 12) for level, share in weight.items() if level != 0.4}) == 1
