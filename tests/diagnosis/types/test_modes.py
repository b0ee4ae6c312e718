"""What the law does about the types that are left of a surface."""

import numpy as np
import pytest

from beaver_ftc.diagnosis.types import modes
from beaver_ftc.diagnosis.types.records import surface_types_dtype
from beaver_ftc.diagnosis.types.registry import N_TYPES
from given import given

GIVEN = given(__file__)


def left(*kinds):
    """A surface with these types left."""
    surface = np.zeros(1, surface_types_dtype()).view(np.recarray)[0]
    surface["sets"]["excluded"] = [kind not in kinds for kind in range(N_TYPES)]
    return surface


@pytest.mark.parametrize(
    ("kinds", "mode"),
    GIVEN["what is done about a surface"],
)  # fmt: skip
def test_what_is_done_about_a_surface(kinds, mode):
    assert modes.choose_mode(left(*kinds)) == mode
