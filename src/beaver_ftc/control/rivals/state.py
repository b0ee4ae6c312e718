"""What a compiled rival law keeps: its gains, and its memory of the flight."""

import numpy as np

DELAY_FRAMES = 2  # from a command to the measured rates that show it, for incremental inversion

RIVAL = np.dtype(
    [
        ("Kp", "f8"), ("Ki", "f8"), ("integral", "f8", (3,)), ("saturated", "i8"), ("begun", "i8"),
        # the regulator: gains on error and integral, the linear model, its inverse, the trim
        ("K", "f8", (3, 6)), ("A", "f8", (3, 3)), ("B_inverse", "f8", (3, 3)), ("trim_x", "f8", (3,)),
        # incremental inversion: the filter's pole, rates and commands of before, and both filters
        ("keep", "f8"), ("x_before", "f8", (3,)), ("given", "f8", (DELAY_FRAMES, 3)),
        ("rate_filter", "f8", (2, 3)), ("command_filter", "f8", (2, 3)),
    ],
    align=True,
)  # fmt: skip
