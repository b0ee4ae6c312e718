"""The doublets that the map of isolability shows."""

from itertools import combinations
from math import radians

import numpy as np

from beaver_ftc.studies.detectability.certain import SETTLED_S, excitation
from beaver_ftc.studies.detectability.isolability import (
    DISTINGUISHED_LOSS,
    DOUBLET_COLUMNS,
    smallest_doublets,
)
from beaver_ftc.studies.detectability.places import at
from beaver_ftc_assurance.separation import LARGEST_RATE_DEG_S
from flying import scenario

FAULTS = ("aileron", "elevator", "rudder")


def test_doublets_of_the_map_move_what_the_losses_ask_for():
    """Half of a loss is off its command by half of it: amplitude is at least what a frame needs over it."""
    straight = at(scenario(), 45.0, 1000.0, 0.0)
    found = smallest_doublets(straight, SETTLED_S)
    assert set(found) == {(a, b) for pair in combinations(FAULTS, 2) for a, b in (pair, pair[::-1])}
    for pair, told in found.items():
        assert tuple(told) == DOUBLET_COLUMNS
        assert told == found[pair[::-1]]
        assert told["why"] == ""
        assert 0.0 <= told["doublet_deg"] < 10.0
        assert 0.0 < told["doublet_s"] <= 0.5
    seen = excitation(straight.model_copy(update={"duration_s": SETTLED_S + 1.0}))
    aileron, rudder, bound = seen.G[:, 0], seen.G[:, 2], seen.bound[0]
    across = np.array([rudder[2], 0.0, -rudder[0]])  # the rudder does nothing along it
    least = 2.0 * abs(across) @ bound / abs(across @ aileron) / DISTINGUISHED_LOSS
    assert radians(found["aileron", "rudder"]["doublet_deg"]) > 0.3 * least
    assert LARGEST_RATE_DEG_S == 20.0
