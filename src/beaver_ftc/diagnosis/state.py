"""Records of the diagnosis, and the numbers that stand for its words."""

from functools import lru_cache

import numpy as np

NOT_ISOLATED, UNANTICIPATED = -1, -2
INTERVAL, PUBLISHED = 0, 1
EITHER, WORST_CASE, STATISTICS = 0, 1, 2  # whose alarms count
LOSS, POSITION = 0, 1  # kinds of hypothesis: isolation.py
ROLL, PITCH, YAW, SIDE, NORMAL = range(5)  # axes, and the accelerometers beside them: forces.py


@lru_cache
def verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    fields = [
        ("detected", "i8"), ("axis", "i8"), ("isolated", "i8"), ("theta", "f8"),
        ("estimates", "i8"), ("effectiveness", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def conclusion_dtype(n: int) -> np.dtype:
    """What is concluded about n surfaces. isolated: an estimator, NOT_ISOLATED or UNANTICIPATED. type: of the
    isolated fault, -1 if open. lead: the surface the law acts upon, and what it does about it. effectiveness:
    of every surface, where a plug-in `estimates` it."""
    fields = [
        ("detected", "i8"), ("detected_at_s", "f8"), ("detected_axis", "i8"),
        ("isolated", "i8"), ("isolated_at_s", "f8"), ("type", "i8"), ("type_at_s", "f8"),
        ("lead", "i8"), ("lead_kind", "i8"), ("estimates", "i8"), ("effectiveness", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def layout_dtype(n: int) -> np.dtype:
    """Axis and group of each of n surfaces, the other one of a group of two, or -1; the main surface of each
    axis; the estimators of a surface's loss and position, or -1."""
    fields = [
        ("dominant_axis", "i8", (n,)), ("group", "i8", (n,)), ("partner", "i8", (n,)), ("main", "i8", (3,)),
        ("loss_of", "i8", (n,)), ("position_of", "i8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


# What several stages go by. authority: whose alarms count; every_type: faults of every type; abrupt: a fault
# is declared to stay as it is; instants: of JSBSim, in a frame; dt s.
CONFIG = np.dtype(
    [
        ("enabled", "i8"), ("authority", "i8"), ("every_type", "i8"), ("abrupt", "i8"),
        ("instants", "i8"), ("dt", "f8"),
    ],
    align=True,
)  # fmt: skip
