"""Which positions a loss and a hardover allow, by hand: a wrong bound may name no wrong fault in a flight."""

import pytest
from kernels import new_fdi

from beaver_ftc.diagnosis.types import registry
from beaver_ftc.diagnosis.types.table import loss
from fault_kinds import CONSTANT_LOSS, DOWN, UP

LOW, HIGH, DT = -0.4, 0.5, 0.02


@pytest.mark.parametrize(
    ("low", "high", "command", "expected"),
    [
        (0.05, 0.07, 0.1, (0.5, 0.7)), (-0.07, -0.05, -0.1, (0.5, 0.7)), (0.05, 0.3, 0.1, (0.5, 1.0)),
        (-0.02, 0.05, 0.1, (0.0, 0.5)),
    ],
)  # fmt: skip
def test_a_loss_keeps_the_shares_of_the_command_that_explain_the_position(low, high, command, expected):
    types = new_fdi()["types"]
    judged = types["surface"][0]["judged"]
    judged["lo"], judged["hi"], judged["u"] = low, high, command
    interval = loss.consistent_interval(types["config"], types["surface"][0], CONSTANT_LOSS, 5)
    assert interval == pytest.approx(expected)


@pytest.mark.parametrize(("length", "ways"), [(1, (0.0, 0.02, 0.1)), (5, (0.0, 0.0, 0.08))])
def test_a_hardover_has_gone_at_least_its_way(length, ways):
    types = new_fdi()["types"]
    config, surface = types["config"], types["surface"][0]
    config["frames_per_block"], config["block_duration_s"] = length, DT
    surface["actuator"]["stop_lo"], surface["actuator"]["stop_hi"] = LOW, HIGH
    surface["actuator"]["runaway"] = 1.0  # rad/s at least
    evidence = surface["evidence"]
    evidence["k_first"], evidence["first_lo"], evidence["first_hi"] = 3, 0.1, 0.2
    for frame, way in zip((3, 4, 8), ways, strict=True):
        assert registry.deflection_range(UP, config, surface, UP, frame) == pytest.approx((0.1 + way, HIGH))
        assert registry.deflection_range(DOWN, config, surface, DOWN, frame) == pytest.approx(
            (LOW, 0.2 - way)
        )
    assert registry.deflection_range(UP, config, surface, UP, 99) == (HIGH, HIGH)
