"""The numbers of the fault types of the table, for tests that set up a case by its types."""

from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER

CONSTANT_LOSS, VARYING_LOSS, STUCK, FLOAT, UP, DOWN, BIAS, GROWING_BIAS, OSCILLATORY, SLOW = map(
    DESCRIPTIONS_IN_TYPE_ORDER.index,
    (
        "loss_of_effectiveness", "loss_of_effectiveness that varies", "stuck", "float", "hardover up",
        "hardover down", "bias", "bias that grows", "oscillatory", "rate_limit",
    ),
)  # fmt: skip
