"""What the law does about the types that are left of a surface."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.types import GIVE_UP, SCALE_COMMAND, SUBTRACT_OFFSET, WAIT_FOR_SURFACE, modes
from beaver_ftc.diagnosis.types.records import surface_types_dtype
from beaver_ftc.diagnosis.types.registry import N_TYPES
from fault_kinds import (
    BIAS,
    CONSTANT_LOSS,
    FLOAT,
    GROWING_BIAS,
    OSCILLATORY,
    SLOW,
    STUCK,
    UP,
    VARYING_LOSS,
)


def left(*kinds):
    """A surface with these types left."""
    surface = np.zeros(1, surface_types_dtype()).view(np.recarray)[0]
    surface["sets"]["excluded"] = [kind not in kinds for kind in range(N_TYPES)]
    return surface


@pytest.mark.parametrize(
    ("kinds", "mode"),
    [
        ((STUCK,), GIVE_UP), ((UP,), GIVE_UP), ((SLOW,), WAIT_FOR_SURFACE), ((OSCILLATORY,), SUBTRACT_OFFSET),
        ((SLOW, BIAS), SUBTRACT_OFFSET), ((STUCK, FLOAT, CONSTANT_LOSS), GIVE_UP),
        ((CONSTANT_LOSS,), SCALE_COMMAND), ((VARYING_LOSS,), SCALE_COMMAND),
        ((CONSTANT_LOSS, BIAS), SUBTRACT_OFFSET),
        ((CONSTANT_LOSS, STUCK), SUBTRACT_OFFSET), ((VARYING_LOSS, SLOW), SCALE_COMMAND),
        ((BIAS,), SUBTRACT_OFFSET),
        ((GROWING_BIAS,), SUBTRACT_OFFSET), ((FLOAT, CONSTANT_LOSS), SCALE_COMMAND),
    ],
)  # fmt: skip
def test_what_is_done_about_a_surface(kinds, mode):
    assert modes.choose_mode(left(*kinds)) == mode
