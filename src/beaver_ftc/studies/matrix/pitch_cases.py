"""Which flights are flown with elevator and flap lost."""

from typing import NamedTuple

SETTLED_S = 30.0  # from here on the swing is judged: what the fault itself throws off is over
LAWS = ("fault-tolerant-published", "oracle-published")

# Name, elevator's jam off its trim in deg (None: it floats), flap's position in deg.
LOST: tuple[tuple[str, float | None, float], ...] = (
    ("elevator at trim", 0.0, 0.0),
    ("elevator +1 deg", 1.0, 0.0),
    ("elevator -1 deg", -1.0, 0.0),
    ("elevator +2 deg", 2.0, 0.0),
    ("elevator -2 deg", -2.0, 0.0),
    ("elevator floats", None, 0.0),
    ("elevator -4 deg", -4.0, 0.0),
    ("elevator -8 deg", -8.0, 0.0),
    ("flap 10 deg down", 0.0, 10.0),
    ("flap 20 deg down", 0.0, 20.0),
)


class PitchCase(NamedTuple):
    """A pair of faults at one airspeed under one law."""

    lost: str
    airspeed_mps: float
    law: str
