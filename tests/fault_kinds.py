"""The numbers of the fault types of the table, for tests that set up a case by its types."""

from beaver_ftc.diagnosis.types.registry import type_index_of

CONSTANT_LOSS = type_index_of("loss_of_effectiveness")
VARYING_LOSS = type_index_of("loss_of_effectiveness", has_constant_parameter=False)
STUCK, FLOAT = type_index_of("stuck"), type_index_of("float")
UP, DOWN = type_index_of("hardover", stop_direction=1), type_index_of("hardover", stop_direction=-1)
BIAS, GROWING_BIAS = type_index_of("bias"), type_index_of("bias", has_constant_parameter=False)
OSCILLATORY, SLOW = (
    type_index_of("oscillatory", has_constant_parameter=False),
    type_index_of("rate_limit", has_constant_parameter=False),
)
