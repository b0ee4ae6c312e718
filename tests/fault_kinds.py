"""The numbers of the fault types of the table, for tests that set up a case by its types."""

from beaver_ftc.diagnosis.types.registry import kind_of

CONSTANT_LOSS = kind_of("loss_of_effectiveness")
VARYING_LOSS = kind_of("loss_of_effectiveness", constant=False)
STUCK, FLOAT = kind_of("stuck"), kind_of("float")
UP, DOWN = kind_of("hardover", direction=1), kind_of("hardover", direction=-1)
BIAS, GROWING_BIAS = kind_of("bias"), kind_of("bias", constant=False)
OSCILLATORY, SLOW = kind_of("oscillatory", constant=False), kind_of("rate_limit", constant=False)
