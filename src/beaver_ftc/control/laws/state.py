"""What the disturbance-rejecting law keeps: its gains over dynamic pressure, its observer, its lead."""

from functools import lru_cache

import numpy as np

PUBLISHED, REJECTING, INDI, LQR, L1 = range(5)  # inner laws: which file makes the demand
N_POINTS = 5  # of the schedule over dynamic pressure
N_LOOPS = 4  # roll, pitch, yaw, and pitch by the surface that stands in
PITCH, STAND_IN = 1, 3


# What left.py keeps: the observer's answer to an acceleration, and the sums of its least squares.
ANSWER = np.dtype([("rate", "f8", (3,)), ("disturbance", "f8", (3,))], align=True)
FOUND = np.dtype(
    [
        ("fading", "f8"), ("product", "f8", (3,)), ("square", "f8", (3,)), ("missed", "f8", (3,)),
        ("frames", "f8", (3,)), ("named", "i8", (3,)),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def rejection_dtype(surfaces: int) -> np.dtype:
    """The record of `rejecting.py` for an aircraft with so many surfaces.

    qdyn (N_POINTS,) Pa: the schedule's points, ascending. Kp 1/s, pull 1, learn 1/s (N_LOOPS, N_POINTS):
    feedback, and the observer's corrections of rate and disturbance for what it missed.
    rate (3,) rad/s, disturbance (3,) rad/s2: its estimates. ahead (3,) rad/s: the rate when the command
    acts. lost: share of pitch that the stand-in carries. lead (n,): command beyond the actuator's position
    over what is wanted beyond it. at_stop_s, abandoned (n,): see `abandon`.
    healthy, believed, found: see left.py.
    """
    return np.dtype(
        [
            ("begun", "i8"), ("share", "f8"), ("lost", "f8"),
            ("qdyn", "f8", (N_POINTS,)),
            ("Kp_at", "f8", (N_LOOPS, N_POINTS)), ("pull_at", "f8", (N_LOOPS, N_POINTS)),
            ("learn_at", "f8", (N_LOOPS, N_POINTS)),
            ("Kp", "f8", (3,)), ("pull", "f8", (3,)), ("learn", "f8", (3,)),
            ("rate", "f8", (3,)), ("disturbance", "f8", (3,)), ("ahead", "f8", (3,)),
            ("lead", "f8", (surfaces,)),
            ("at_stop_s", "f8", (surfaces,)), ("abandoned", "i8", (surfaces,)),
            ("healthy", ANSWER), ("believed", ANSWER), ("found", FOUND),
        ],
        align=True,
    )  # fmt: skip
