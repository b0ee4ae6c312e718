"""What came of a derivation."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.plant.trim import TrimPoint


@dataclass(frozen=True)
class Derived:
    """What came of it: the folder, the aircraft, its trim, the largest errors (3,) rad/s2 over the samples
    of the fit and over those it did not see, and what is to be known of it. further: surfaces that are not
    used, by property, and where they stay. took_s: how long it took."""

    aircraft: Aircraft
    trim: TrimPoint
    fitted_rad_s2: np.ndarray
    checked_rad_s2: np.ndarray
    notes: tuple[str, ...] = field(default=())
    given: Aircraft | None = None  # as its own file has it
    further: Mapping[str, float] = field(default_factory=dict)
    took_s: float = 0.0
