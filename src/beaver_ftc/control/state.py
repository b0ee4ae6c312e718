"""The control law's memory and gains: one record, part of the frame's."""

from functools import lru_cache

import numpy as np

from beaver_ftc.control.laws.state import PUBLISHED, REJECTING, rejection_dtype
from beaver_ftc.control.rivals.state import RIVAL

NOMINAL, ADAPTIVE, FAULT_TOLERANT, ORACLE = range(4)
LAWS = ("nominal", "adaptive", "fault-tolerant", "oracle")  # what use is made of the verdict
# A law's name -> that, and which inner law makes the demand.
COMPILED = {
    "nominal": (NOMINAL, PUBLISHED),
    "adaptive": (ADAPTIVE, PUBLISHED),
    "fault-tolerant": (FAULT_TOLERANT, REJECTING),
    "fault-tolerant-published": (FAULT_TOLERANT, PUBLISHED),
    "oracle": (ORACLE, REJECTING),
    "oracle-published": (ORACLE, PUBLISHED),
}


def law_of(name: str) -> tuple[int, int]:
    """What use a law makes of the verdict, and its inner law; of a plug-in those that do the least."""
    return COMPILED.get(name, (NOMINAL, PUBLISHED))


# What power.py keeps: its settings, its state, and what is reported of it.
POWER = np.dtype(
    [
        ("enabled", "i8"), ("impatience", "f8"), ("forgiveness", "f8"),  # shares per frame
        ("speed_gain", "f8"), ("attitude_gain", "f8"),  # inHg per m/s, inHg per rad
        ("smoothing", "f8"), ("washout", "f8"), ("leak", "f8"),  # shares per frame
        ("trim", "f8"), ("low", "f8"), ("high", "f8"), ("step", "f8"),  # inHg
        ("dpt_factor", "f8"), ("highest_dpt", "f8"),
        ("lost", "f8"), ("engaged", "i8"), ("in_use", "i8"), ("moved", "i8"),
        ("speed", "f8"), ("usual_speed", "f8"), ("attitude", "f8"),
        ("command", "f8", (1,)),  # inHg
        ("from_s", "f8"), ("frames", "i8"), ("least", "f8"), ("greatest", "f8"),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def control_dtype(n: int) -> np.dtype:
    """The law's record for an aircraft with n surfaces; rad, rad/s, rad/s2."""
    fields = [
        ("law", "i8"), ("inner", "i8"), ("dt", "f8"),
        ("Kp", "f8"), ("Ki", "f8"),
        ("model_A", "f8", (2, 2)), ("model_B", "f8", (2,)),
        ("commanded_rate", "f8", (3,)), ("model_rate", "f8", (3,)), ("model_acceleration", "f8", (3,)),
        ("integral", "f8", (3,)), ("demand", "f8", (3,)),
        ("main", "i8", (3,)), ("stand_in", "i8"),  # surface of each axis; who stands in for pitch's, or -1
        ("G", "f8", (3, n)),  # effectiveness matrix with what is believed of each surface in it
        ("fhat", "f8", (3,)), ("target", "f8", (n,)),
        ("effectiveness", "f8", (n,)), ("effectiveness_step", "f8"), ("least_effectiveness", "f8"),
        ("offset", "f8", (n,)), ("lag", "f8", (n,)),
        ("probe_amplitude", "f8"), ("probe_step", "f8"), ("probe_frames", "i8"),
        ("probe", "f8"), ("probed", "i8"), ("probe_from_s", "f8"), ("probe_to_s", "f8"),
        ("steered", "i8"),  # by outer loops
        # what authority.py keeps
        ("governed_rate", "f8", (3,)), ("governed_acceleration", "f8", (3,)), ("hedging", "i8"),
        ("reference_scale", "f8", (3,)), ("hold", "f8", (3,)),
        ("shortfall", "f8", (3,)), ("beyond", "i8", (3,)),
        ("trim", "f8", (n,)), ("low", "f8", (n,)), ("high", "f8", (n,)),
        ("command", "f8", (n,)), ("saturated", "i8", (n,)),
        ("hand_over", "f8"), ("hand_over_step", "f8"), ("hands_back", "i8"),  # after a change in flight
        ("power", POWER), ("rejection", rejection_dtype(n)), ("rival", RIVAL),
    ]  # fmt: skip
    return np.dtype(fields, align=True)
