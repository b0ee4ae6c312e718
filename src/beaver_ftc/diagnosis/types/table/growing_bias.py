"""Bias that grows: p = u + b, cut off by the stops; b is of one sign and never smaller than before.

At a stop an offset that grows looks like a runaway. The speed on the way to the stop distinguishes them: an
offset that grows almost as fast as a runaway counts as one. The memory therefore has a second part, the
interval (b_lo, b_hi) of an offset that is slower than a runaway: it widens in every frame (`see_frame`), and
each judged frame narrows it (`narrow_slow_offset`).

`consistent_interval` reads the judged frame, or block of frames (srf.judged, srf.commands[1]).

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
    lo, hi          interval of b in a judged frame, rad
    M               memory of the type: its `memory_dtype` below
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import SUBTRACT_OFFSET, FaultType
from beaver_ftc.diagnosis.types.table import bias

# An offset that grows faster than this counts as a runaway. The unit is the least rate of a runaway, which is
# half of the rate limit at which a runaway moves.
MAX_GROWTH_RATIO = 1.8


@kernel
def reset_memory(srf, h):
    """The offset has not grown yet."""
    M = srf.growing_bias
    M.up = M.down = 0.0
    M.has_run[:] = 0
    M.b_lo = -np.inf
    M.b_hi = np.inf


@kernel
def max_growth(c, srf):
    """The largest change, rad, of an offset slower than a runaway from one judged frame to the next."""
    return MAX_GROWTH_RATIO * srf.actuator.runaway * c.block_duration_s


@kernel
def see_frame(c, srf, h, k, skipped):
    """Widen the interval of an offset that is slower than a runaway by its motion in a frame:

    b_lo <- b_lo - db,    b_hi <- b_hi + db        db: `max_growth`, rad

    In a skipped frame the fault may have gone, and may begin again with any offset: db is infinite.
    """
    db = np.inf if skipped else max_growth(c, srf)
    srf.growing_bias.b_lo -= db
    srf.growing_bias.b_hi += db


@kernel
def narrow_slow_offset(c, srf, lo, hi):
    """Narrow the interval of an offset that is slower than a runaway by the observed b in (lo, hi), rad:

        has_run downwards if hi < b_lo, upwards if lo > b_hi
        b_lo <- max(b_lo, lo - tol),    b_hi <- min(b_hi, hi + tol)

    The next frame begins with the offset at the end of this one. If this frame has several instants, the
    offset at its end differs from the observed mean by up to tol = `max_growth`; otherwise tol = 0.
    """
    M = srf.growing_bias
    if hi < M.b_lo:
        M.has_run[0] = 1
    if lo > M.b_hi:
        M.has_run[1] = 1
    tol = 0.0 if c.single_instant else max_growth(c, srf)
    M.b_lo = max(M.b_lo, lo - tol)
    M.b_hi = min(M.b_hi, hi + tol)


@kernel
def consistent_interval(c, srf, h, k):
    """The offset keeps its sign and does not shrink; at a stop it may be larger than it shows.

    up <- max(up, lo)    down <- min(down, hi)        (lo, hi): of `bias.consistent_interval`, not open
    EMPTY_SET if lo > hi, if up > 0 > down, or if the offset is smaller than it was:
    hi < up after it grew upwards, lo > down after it grew downwards; a set that is open says nothing
    """
    lo, hi = bias.consistent_interval(c, srf, h, k)
    if lo <= hi:
        narrow_slow_offset(c, srf, lo, hi)
    if np.isinf(lo) or np.isinf(hi):
        return UNLIMITED_SET
    M = srf.growing_bias
    M.up = max(M.up, lo)
    M.down = min(M.down, hi)
    grew = M.up > 0.0
    fell = M.down < 0.0
    shrinks = (grew and hi < M.up) or (fell and lo > M.down)
    return EMPTY_SET if lo > hi or (grew and fell) or shrinks else UNLIMITED_SET


@kernel
def motion_rules_out(srf, h, stop):
    """Whether the surface has moved towards that stop (1 upper, -1 lower, 0 none) as fast as only a runaway
    does."""
    return stop != 0 and srf.growing_bias.has_run[1 if stop == 1 else 0] == 1


def estimate_parameter(fdi: np.void, s: int, h: int) -> float:
    """b in the elapsed frame, rad: as `observations.last_error`, for Python code."""
    last = fdi["types"]["surface"][s]["last"]
    return float(0.5 * (last["lo"] + last["hi"]) - last["u"])


TYPES = (
    FaultType(
        name="bias", description="bias that grows", has_constant_parameter=False, sort_rank=4,
        reset_memory=reset_memory, see_frame=see_frame, consistent_interval=consistent_interval,
        memory_record_name="growing_bias",
        memory_dtype=record(
            up=float, down=float,  # how far the offset has certainly grown, upwards and downwards, rad
            b_lo=float, b_hi=float,  # interval of an offset that is slower than a runaway, rad
            has_run=(int, 2),  # whether the offset has certainly run as fast as a runaway: down, up
        ),
        # An offset that has stopped growing is constant under any command.
        follows_command=False,
        # For some courses of the command p = u + b looks like a jam or a loss; once b has slowly moved the
        # surface to its stop, it looks like a runaway.
        can_look_like=("loss_of_effectiveness", "stuck", "float", "hardover"),
        motion_rules_out=motion_rules_out,
        accommodation_mode=SUBTRACT_OFFSET, frames_test="growing offset",
        estimate_parameter=estimate_parameter,
    ),
)  # fmt: skip
