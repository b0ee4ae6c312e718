"""The bank of hypotheses and what a flight may differ in, whole, from small models."""

import pytest

from beaver_ftc_logs.bank import (
    GROUP_LOSS,
    build_bank,
)
from products.logs import small


def test_levels_seen_carry_their_share_of_a_groups_faults():
    bank = build_bank(
        small.model(settings={"level_share": 0.7, "level_step": 0.25, "levels": {"left": [0.4]}})
    )
    left = (bank.hypothesis_kind == GROUP_LOSS) & (bank.effectiveness[:, 1] < 1.0)
    weight = dict(zip(bank.effectiveness[left, 1].tolist(), bank.transition_share[left], strict=True))
    assert sorted(weight) == [0.0, 0.25, 0.4, 0.5, 0.75]
    assert weight[0.4] / sum(weight.values()) == pytest.approx(0.7)
    assert len({round(share, 12) for level, share in weight.items() if level != 0.4}) == 1
