"""Records of the diagnosis, and the numbers that stand for its words."""

from functools import lru_cache

import numpy as np

from beaver_ftc.scenario.diagnosis import MAX_POLES

MAX_ESTIMATORS = 16
NOT_ISOLATED, UNANTICIPATED = -1, -2
INTERVAL, PUBLISHED = 0, 1
EITHER, WORST_CASE, STATISTICS = 0, 1, 2  # whose alarms count
LOSS, POSITION = 0, 1  # kinds of hypothesis: fault_class.py
ROLL, PITCH, YAW, SIDE, NORMAL = range(5)  # axes, and the accelerometers beside them: forces.py

# Centres of the network's basis functions, rad; and its memory.
ALPHA_CENTRES = np.linspace(-0.1, 0.5, 9)
BETA_CENTRES = np.linspace(-0.3, 0.3, 5)
N_BASIS = len(ALPHA_CENTRES) + len(BETA_CENTRES)
NETWORK = np.dtype(
    [
        ("gain", "f8"), ("leak_per_s", "f8"), ("weight_limit", "f8"),
        ("weights", "f8", (3, N_BASIS)), ("basis", "f8", (N_BASIS,)), ("output", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip

# What a fault adds to the angular acceleration, as its estimator supposes: offset + theta Z, give or take.
EFFECT = np.dtype([("offset", "f8", (3,)), ("Z", "f8", (3,)), ("spread", "f8", (3,))], align=True)

ESTIMATOR = np.dtype(
    [
        ("kind", "i8"), ("surface", "i8"),
        ("low", "f8"), ("high", "f8"),  # the known set of theta
        ("excluded", "i8"), ("excluded_at_s", "f8"), ("unasked", "i8", (3,)),
        ("shown", "i8"), ("doubted", "i8"),
        ("xhat", "f8", (3,)), ("residual", "f8", (3,)), ("lower", "f8", (3,)), ("upper", "f8", (3,)),
        ("omega", "f8", (3,)), ("rise", "f8", (3,)), ("fall", "f8", (3,)), ("bound", "f8", (3,)),
        ("bound_eta", "f8", (3,)), ("bound_noise", "f8", (3,)),
        ("theta", "f8", (3,)), ("covariance", "f8", (3,)),
        ("effect", EFFECT), ("block_effect", EFFECT),  # of the frame; mean over a block
        ("furthest", "f8"),  # rad, from neutral, that the surface can have been in the frame
        # what bank.py and membership.py keep
        ("across", "f8", (3,)), ("reach_low", "f8", (MAX_POLES, 4)), ("reach_high", "f8", (MAX_POLES, 4)),
        ("theta_low", "f8", (3,)), ("theta_high", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def verdict_dtype(n: int) -> np.dtype:
    """A plug-in's verdict. isolated: a surface, NOT_ISOLATED or UNANTICIPATED."""
    fields = [
        ("detected", "i8"), ("axis", "i8"), ("isolated", "i8"), ("theta", "f8"),
        ("estimates", "i8"), ("effectiveness", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


# The bank of detection filters; filter 0 is the published one (bank.py).
BANK = np.dtype(
    [
        ("n", "i8"), ("decay", "f8", (MAX_POLES,)), ("innovation", "f8", (3,)),
        ("residual", "f8", (MAX_POLES, 3)), ("threshold", "f8", (MAX_POLES, 3)),
        ("eta", "f8", (MAX_POLES, 3)), ("noise", "f8", (MAX_POLES, 3)),
        ("closest", "f8", (MAX_POLES,)),  # largest share of its bound each filter reached in healthy flight
    ],
    align=True,
)  # fmt: skip

# The fault detection and approximation estimator (detection.py).
FDAE = np.dtype(
    [
        ("pole", "f8", (3,)), ("decay", "f8", (3,)), ("xhat", "f8", (3,)), ("residual", "f8", (3,)),
        ("threshold", "f8", (3,)), ("threshold_eta", "f8", (3,)), ("threshold_noise", "f8", (3,)),
        ("network", NETWORK),
    ],
    align=True,
)  # fmt: skip

# The isolation estimators, and how the decision among them is sharpened (isolation.py).
ISOLATION = np.dtype(
    [
        ("n", "i8"), ("thresholds", "i8"), ("forgetting", "f8"), ("decay", "f8", (3,)),
        ("memory", "i8"), ("shared", "i8"), ("membership", "i8"),
        ("estimator", ESTIMATOR, (MAX_ESTIMATORS,)),
    ],
    align=True,
)  # fmt: skip


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
