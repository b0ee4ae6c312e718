"""What is kept of one surface: where it was, what every type makes of that, and what is concluded."""

from functools import lru_cache

import numpy as np

from beaver_ftc.diagnosis.types.registry import N_TYPES, TYPES, part

MAX_BLOCK = 256  # frames of a block: blocks.py
HISTORY = 3  # frames, or blocks, of which the orders are kept: the elapsed one and two before it

# What the surface was ordered to do, rad; [0] belongs to the elapsed frame or block, [1] to the one before.
ORDERS = np.dtype(
    [
        ("given", "f8", (HISTORY, MAX_BLOCK)), ("low", "f8", (HISTORY,)), ("high", "f8", (HISTORY,)),
        ("least", "f8", (2,)), ("greatest", "f8", (2,)),  # where a healthy surface was within it
    ],
    align=True,
)  # fmt: skip

# Where a surface that a type has held and let go can be, rad: release.py.
RELEASE = np.dtype(
    [
        ("low", "f8", (2, N_TYPES)), ("high", "f8", (2, N_TYPES)), ("released", "i8", (N_TYPES,)),
        ("held_low", "f8", (N_TYPES,)), ("held_high", "f8", (N_TYPES,)),  # where it is held by then
    ],
    align=True,
)  # fmt: skip

# What was known of the first of two faults when it was named: pairs.py.
KNOWN = np.dtype(
    [("low", "f8", (N_TYPES,)), ("high", "f8", (N_TYPES,)), ("excluded", "i8", (N_TYPES,))], align=True
)

# What the fault types go by: whether a frame shows one instant, instants in it, whether a surface returns by
# its actuator, frames of half of the slowest oscillation; frames of a block, and its duration (types/).
TYPES_CONFIG = np.dtype(
    [
        ("whole", "i8"), ("instants", "i8"), ("returns", "i8"), ("patience", "i8"),
        ("length", "i8"), ("span_s", "f8"),
    ],
    align=True,
)  # fmt: skip

# Two faults at once (types/pairs.py): alarms of the groups, and what is known of the first fault in pitch.
PAIR = np.dtype(
    [
        ("enabled", "i8"), ("alarmed", "i8", (2,)), ("no_lateral_pair", "i8"), ("first", "i8"),
        ("unsettled", "i8"),
    ],
    align=True,
)  # fmt: skip

# Blocks of frames (types/blocks.py).
FRAME_BLOCK = np.dtype(
    [
        ("filled", "i8"),
        ("innovation", "f8", (3,)), ("bound", "f8", (3,)), ("noise", "f8", (3,)),
    ],
    align=True,
)  # fmt: skip


@lru_cache
def surface_dtype() -> np.dtype:
    """One surface's record; positions in rad. `then`: a frame before the elapsed one, `before`: two."""
    own = [
        (module.__name__.rpartition(".")[2], np.dtype(list(part(module, "MEMORY")), align=True))
        for module in TYPES
        if part(module, "MEMORY")
    ]
    fields = [
        # its actuator
        ("travel_low", "f8"), ("travel_high", "f8"), ("least_runaway_rate", "f8"),
        ("reach_low", "f8"), ("reach_high", "f8"),  # where it can act: a part of its travel is nearer to zero
        ("approach", "f8"), ("step", "f8"), ("slowest_step", "f8"), ("orders", ORDERS),
        # where it was if it alone is at fault, and whether something was wrong
        ("command", "f8"), ("low", "f8"), ("high", "f8"), ("wrong", "i8"),
        ("command_then", "f8"), ("low_then", "f8"), ("high_then", "f8"), ("wrong_then", "i8"),
        ("low_before", "f8"), ("high_before", "f8"), ("wrong_before", "i8"),
        # its effectiveness within the frame or block, and a quarter of what that varies by, in means
        ("G_least", "f8"), ("G_most", "f8"), ("uneven", "f8"), ("uneven_then", "f8"),
        # what the types make of it
        ("set_low", "f8", (N_TYPES,)), ("set_high", "f8", (N_TYPES,)), ("type_excluded", "i8", (N_TYPES,)),
        ("start_low", "f8"), ("start_high", "f8"), ("started_at", "i8"),
        ("hides", "i8", (2,)), ("hides_then", "i8", (2,)),  # lower and upper stop: examine.note_stops
        ("evidence", "i8"), ("quiet", "i8"), ("absent", "i8"),  # frames
        ("unhidden", "i8"),  # of the evidence, what has come since a stop could last hide something
        ("release", RELEASE), *own,
        # what is concluded
        ("in_question", "i8"), ("standing", "i8"), ("measure", "i8"),
        ("named", "i8"), ("named_at_s", "f8"), ("type", "i8"), ("type_at_s", "f8"), ("known", KNOWN),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@lru_cache
def types_dtype(n: int) -> np.dtype:
    """Faults of every type on n surfaces: types/."""
    fields = [
        ("config", TYPES_CONFIG), ("frame", "i8"), ("pair", PAIR), ("block", FRAME_BLOCK),
        ("surface", surface_dtype(), (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)
