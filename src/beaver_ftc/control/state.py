"""The control law's memory and gains: one record, part of the frame's."""

import numpy as np

NOMINAL, ADAPTIVE, FAULT_TOLERANT, ORACLE = range(4)
LAWS = ("nominal", "adaptive", "fault-tolerant", "oracle")

CONTROL = np.dtype(
    [
        ("law", "i8"), ("dt", "f8"),
        ("Kp", "f8"), ("Ki", "f8"),
        ("model_A", "f8", (2, 2)), ("model_B", "f8", (2,)),
        ("model_rate", "f8", (3,)), ("model_acceleration", "f8", (3,)),
        ("integral", "f8", (3,)), ("demand", "f8", (3,)),
        ("effectiveness", "f8", (4,)), ("effectiveness_step", "f8"), ("least_effectiveness", "f8"),
        ("offset", "f8", (4,)), ("lag", "f8", (4,)),
        ("probe_amplitude", "f8"), ("probe_step", "f8"), ("probe_frames", "i8"),
        ("probe", "f8"), ("probed", "i8"), ("probe_from_s", "f8"), ("probe_to_s", "f8"),
        # what authority.py keeps
        ("governed_rate", "f8", (3,)), ("governed_acceleration", "f8", (3,)), ("hedging", "i8"),
        ("reference_scale", "f8", (3,)), ("hold", "f8", (3,)),
        ("shortfall", "f8", (3,)), ("beyond", "i8", (3,)),
        ("trim", "f8", (4,)), ("low", "f8", (4,)), ("high", "f8", (4,)),
        ("command", "f8", (4,)), ("saturated", "i8", (4,)),
        ("hand_over", "f8"), ("hand_over_step", "f8"),
    ],
    align=True,
)  # fmt: skip
