"""Surfaces that move by their command, but wrongly: loss, bias, oscillation, rate limit.

*Loss of effectiveness*: p = (1 + theta) u, one 1 + theta in [0, 1], or any in every frame (incipient).

*Bias*: p = u + b, cut off by the stops; b constant, or of one sign and never smaller than before. At a stop
an offset that grows looks like a runaway. The speed on the way to the stop distinguishes them: an offset that
grows almost as fast as a runaway counts as one.

*Oscillation*: p - u swings about 0, no half-cycle longer than that of the slowest oscillation. Counting
half-cycles above a level that noise cannot reach is how oscillatory failures are monitored in service
[Goupil2010].

*Rate limit*: p moves only towards its command, at any rate down to the slowest declared. A slower surface
counts as stuck: the two types are each other's limit, and only a least rate distinguishes them.

`consistent_interval` and what it calls test the judged frame: srf.judged, srf.commands[1]. `deflection_range`
gives the deflection in the elapsed frame: srf.last, srf.commands[0]. With blocks, each is a block of frames.
"""

from math import pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.sets import EMPTY_SET, NO_THETA, UNLIMITED_SET, explain
from beaver_ftc.diagnosis.types import (
    REST_EXCLUDES_TYPE,
    REST_HIDES_TYPE,
    SCALE_COMMAND,
    SUBTRACT_OFFSET,
    WAIT_FOR_SURFACE,
    DeflectionRelation,
    FaultType,
    clip_travel,
    feasible_set,
    middle_estimate,
    set_middle,
)


@kernel
def error_of_frame(srf):
    """p - u of the surface in the judged frame, (lo, hi) rad."""
    return srf.judged.lo - srf.judged.u, srf.judged.hi - srf.judged.u


@kernel
def share_range(srf, h):
    """Return the range of 1 + theta: 0 to 1."""
    return 0.0, 1.0


@kernel
def loss_interval(c, srf, h, k):
    """The 1 + theta in [0, 1] with p = (1 + theta) u in the judged frame; lo > hi if none."""
    lo, hi = srf.judged.lo, srf.judged.hi
    return explain(0.5 * (lo + hi), 0.5 * (hi - lo), srf.judged.u, 0.0, 1.0)


@kernel
def loss_range(c, srf, h, k):
    """(1 + theta) u in the elapsed frame, least and greatest over the set of 1 + theta, rad."""
    lo, hi = srf.sets.low[h] * srf.last.u, srf.sets.high[h] * srf.last.u
    return min(lo, hi), max(lo, hi)


@kernel
def varying_loss_set(c, srf, h, k):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    lo, hi = loss_interval(c, srf, h, k)
    changed = c.frames_per_block > 1 and srf.commands.u_min[1] < 0.0 < srf.commands.u_max[1]
    return EMPTY_SET if lo > hi and not changed else UNLIMITED_SET


def theta_of_loss(fdi: np.void, s: int, h: int) -> float:
    """theta of the estimator. Where pairs are diagnosed, the middle of the set of theta instead, because the
    estimator fits axes that a second fault may move."""
    return middle_estimate(fdi, s, h) - 1.0 if fdi["types"]["pair"]["enabled"] else theta_fitted(fdi, s, h)


def theta_fitted(fdi: np.void, s: int, h: int) -> float:
    """theta as the estimator of a loss has it."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def theta_of_set(fdi: np.void, s: int, h: int) -> tuple[float, float]:
    """Return the interval of theta."""
    lo, hi = feasible_set(fdi, s, h)
    return lo - 1.0, hi - 1.0


LOSS_RELATION = DeflectionRelation(
    command_gain=1.0, theta_is_share=True, theta_span=lambda low, high: (-1.0, 0.0)
)
LOSS = FaultType(
    name="loss_of_effectiveness", has_constant_parameter=True, sort_rank=1,
    parameter_range=share_range, consistent_interval=loss_interval,
    deflection_range=loss_range,
    accommodation_mode=SCALE_COMMAND, end_type="float",
    deflection_relation=LOSS_RELATION, estimate_parameter=theta_of_loss,
    estimate_parameter_interval=theta_of_set,
)  # fmt: skip
VARYING_LOSS = FaultType(
    name="loss_of_effectiveness", description="loss_of_effectiveness that varies",
    has_constant_parameter=False, sort_rank=1,
    consistent_interval=varying_loss_set, wait_half_cycles=2,
    accommodation_mode=SCALE_COMMAND, deflection_relation=LOSS_RELATION,
    estimate_parameter=theta_fitted,
)  # fmt: skip


# An offset that grows faster than this counts as a runaway: times the least rate of a runaway, which is half
# of the rate limit at which a runaway moves.
MAX_GROWTH_RATIO = 1.8


@kernel
def bias_of_frame(c, srf, h, k):
    """b = p - u of the surface in the judged frame, (lo, hi) rad; open at a stop:

        lo = seen.lo - u    -inf if seen.lo - max(u - u_min, 0) <= stop_lo
        hi = seen.hi - u    +inf if seen.hi + max(u_max - u, 0) >= stop_hi

    u_min, u_max: extremes of u within the frame: p was at most u - u_min below its mean. A surface that was
    at its stop at any instant of the frame may have a larger offset than it shows. An offset takes no surface
    beyond its stop: NO_THETA.
    """
    seen, cmd, act = srf.judged, srf.commands, srf.actuator
    if seen.hi < act.stop_lo or seen.lo > act.stop_hi:
        return NO_THETA
    lo, hi = error_of_frame(srf)
    if seen.lo - max(seen.u - cmd.u_min[1], 0.0) <= act.stop_lo:
        lo = -np.inf
    if seen.hi + max(cmd.u_max[1] - seen.u, 0.0) >= act.stop_hi:
        hi = np.inf
    return lo, hi


@kernel
def bias_middle(srf, h):
    """b in the middle of its set, rad; unlimited while an end of that is open."""
    lo, hi = srf.sets.low[h], srf.sets.high[h]
    return set_middle(srf, h) if hi - lo < np.inf else np.inf


@kernel
def bias_range(c, srf, h, k):
    """u + b in the elapsed frame, cut off by the stops, least and greatest over the set of b, rad."""
    lo = mean_with_offset(srf, srf.sets.low[h], srf.commands.u_min[0])
    return lo, mean_with_offset(srf, srf.sets.high[h], srf.commands.u_max[0])


@kernel
def mean_with_offset(srf, b, u_end):
    """Mean of u + b, rad, over the elapsed frame; if u + b meets a stop there, that of u_end + b."""
    cmd, act = srf.commands, srf.actuator
    stops = cmd.u_min[0] + b < act.stop_lo or cmd.u_max[0] + b > act.stop_hi
    return clip_travel(srf, u_end + b) if stops else srf.last.u + b


def bias_interval(fdi: np.void, s: int, h: int) -> tuple[float, float] | None:
    """Return the interval of the offset, rad; None while one end is open."""
    lo, hi = feasible_set(fdi, s, h)
    return (lo, hi) if np.isfinite(hi - lo) else None


@kernel
def reset_growing(srf, h):
    """The offset has not grown yet."""
    M = srf.growing_bias
    M.up = M.down = 0.0
    M.has_run[:] = 0
    M.b_lo, M.b_hi = -np.inf, np.inf


@kernel
def max_growth(c, srf):
    """Return the largest motion between judged frames of an offset slower than a runaway, rad."""
    return MAX_GROWTH_RATIO * srf.actuator.runaway * c.block_duration_s


@kernel
def widen_offset(c, srf, h, k, skipped):
    """Widen the interval of the offset by what one that is slower than a runaway moves in a frame. In a
    skipped frame the fault may have gone, and begin again with any offset."""
    db = np.inf if skipped else max_growth(c, srf)
    srf.growing_bias.b_lo -= db
    srf.growing_bias.b_hi += db


@kernel
def narrow_offset(c, srf, lo, hi):
    """Narrow the interval of an offset that is slower than a runaway by the observed b in (lo, hi), rad; if
    the two do not meet, the offset has run.

    The next frame begins with the offset at the end of this one. If this frame has several instants, the
    offset at its end differs from the observed mean by up to `max_growth`.
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
def update_growing(c, srf, h, k):
    """The offset keeps its sign and does not shrink; at a stop it may be larger than it shows.

    up <- max(up, lo)    down <- min(down, hi)        (lo, hi): `bias_of_frame`, not open
    EMPTY_SET if lo > hi, if up > 0 > down, or if the offset is smaller than it was:
    hi < up after it grew upwards, lo > down after it grew downwards
    """
    lo, hi = bias_of_frame(c, srf, h, k)
    if lo <= hi:
        narrow_offset(c, srf, lo, hi)
    if np.isinf(lo) or np.isinf(hi):
        return UNLIMITED_SET
    M = srf.growing_bias
    M.up = max(M.up, lo)
    M.down = min(M.down, hi)
    grew, fell = M.up > 0.0, M.down < 0.0
    shrinks = (grew and hi < M.up) or (fell and lo > M.down)
    return EMPTY_SET if lo > hi or (grew and fell) or shrinks else UNLIMITED_SET


@kernel
def has_run(srf, h, stop):
    """Whether the surface has moved towards that stop as fast as only a runaway does."""
    if stop == 0:
        return False
    return srf.growing_bias.has_run[1 if stop == 1 else 0] == 1


def last_offset(fdi: np.void, s: int, h: int) -> float:
    """Offset in the elapsed frame, rad: as `types.last_error`, for Python code."""
    last = fdi["types"]["surface"][s]["last"]
    return float(0.5 * (last["lo"] + last["hi"]) - last["u"])


BIAS = FaultType(
    name="bias", has_constant_parameter=True, sort_rank=6,
    consistent_interval=bias_of_frame, deflection_range=bias_range,
    accommodation_mode=SUBTRACT_OFFSET, deflection_error=bias_middle,
    deflection_error_precedence=2,
    deflection_relation=DeflectionRelation(
        1.0, theta_is_share=False, theta_span=lambda low, high: (low - high, high - low)
    ),
    frames_test="offset", estimate_parameter=middle_estimate,
    estimate_parameter_interval=bias_interval,
)  # fmt: skip
GROWING_BIAS = FaultType(
    name="bias", description="bias that grows", has_constant_parameter=False, sort_rank=4,
    reset_memory=reset_growing, see_frame=widen_offset, consistent_interval=update_growing,
    memory_record_name="growing_bias",
    memory_dtype=record(
        up=float, down=float,  # how far the offset has certainly grown, upwards and downwards, rad
        b_lo=float, b_hi=float,  # interval of an offset that is slower than a runaway, rad
        has_run=(int, 2),  # whether the offset has certainly run as fast as a runaway: down, up
    ),
    # an offset that has stopped growing is constant under any command
    follows_command=False,
    # For some courses of the command p = u + b looks like a jam or a loss; once b has slowly moved the
    # surface to its stop, it looks like a runaway.
    can_look_like=("loss_of_effectiveness", "stuck", "float", "hardover"),
    motion_rules_out=has_run,
    accommodation_mode=SUBTRACT_OFFSET, frames_test="growing offset",
    estimate_parameter=last_offset,
)  # fmt: skip


MIN_HALF_CYCLES = 3  # two whole ones, and the first, which is cut off at its beginning


@kernel
def reset_swing(srf, h):
    """No half-cycle has been counted."""
    srf.oscillatory.n_half = srf.oscillatory.sign = 0
    srf.oscillatory.square = srf.oscillatory.square_past = 0.0


@kernel
def add_square(c, srf, h, k, skipped):
    """Add (p - u)^2 of the judged frame to the sum of the half-cycle. In a skipped frame the surface may have
    swung to the other side, unseen."""
    lo, hi = error_of_frame(srf)
    srf.oscillatory.square += (0.5 * (lo + hi)) ** 2
    if skipped:
        srf.oscillatory.since = k + 1


@kernel
def update_swing(c, srf, h, k):
    """Count half-cycles; a sign that stays for longer than the slowest half-cycle is no oscillation:
    EMPTY_SET if k - since > half_frames. A half-cycle ends where the sign of p - u changes:

        n_half <- n_half + 1,    square_past <- square_past + square from the second half-cycle on

    At a stop half of a swing is hidden. If a frame has several instants, the mean of a quick swing over them
    then keeps its sign, so such a frame is no evidence against an oscillation.
    """
    M = srf.oscillatory
    lo, hi = error_of_frame(srf)
    sign = 1 if lo > 0.0 else (-1 if hi < 0.0 else 0)
    if sign == 0 or (not c.single_instant and srf.judged.hides[0 if sign == 1 else 1]):
        M.since = k + 1
        return UNLIMITED_SET
    if sign != M.sign:
        if M.sign != 0:  # a half-cycle ends here; the sums begin with the second, the first whole one
            if M.n_half == 0:
                M.first_end = k
            else:
                M.square_past += M.square
            M.last_end = k
            M.n_half += 1
            M.square = 0.0
        M.sign, M.since = sign, k
    return EMPTY_SET if k - M.since > c.half_frames else UNLIMITED_SET


@kernel
def swing_has_shown(srf, h):
    """Whether the surface has swung for two whole half-cycles."""
    return srf.oscillatory.n_half >= MIN_HALF_CYCLES


def swing_amplitude(fdi: np.void, s: int, h: int) -> float:
    """Amplitude sqrt(2 mean (p - u)^2), rad."""
    M = fdi["types"]["surface"][s]["oscillatory"]
    return float(sqrt(2.0 * M["square_past"] / (M["last_end"] - M["first_end"])))


def swing_frequency(fdi: np.void, s: int, h: int) -> float:
    """Frequency pi n / T, rad/s, of the n whole half-cycles that took T s."""
    M = fdi["types"]["surface"][s]["oscillatory"]
    n = int(M["n_half"]) - 1
    frames = int(M["last_end"] - M["first_end"])
    return n * pi / (float(fdi["types"]["config"]["block_duration_s"]) * frames)


OSCILLATORY = FaultType(
    name="oscillatory", has_constant_parameter=False, sort_rank=2,
    reset_memory=reset_swing, see_frame=add_square, consistent_interval=update_swing,
    memory_record_name="oscillatory",
    memory_dtype=record(
        # sign of p - u and the frame since which it is that; how many half-cycles have ended, and the frames
        # in which the first and the last of them did
        sign=int, since=int, n_half=int, first_end=int, last_end=int,
        # sums of (p - u)^2, rad2: over this half-cycle, over the whole ones before
        square=float, square_past=float,
    ),
    has_shown=swing_has_shown, show_half_cycles=2, evidence_at_rest=REST_EXCLUDES_TYPE,
    can_look_like=("rate_limit",),
    accommodation_mode=SUBTRACT_OFFSET, frames_test="swing",
    estimate_parameter=swing_amplitude,
    estimate_frequency_rad_s=swing_frequency,
)  # fmt: skip


@kernel
def reset_creep(srf, h):
    """No frame has been judged: k_last + 1 = -1 is before the first frame, 0."""
    srf.rate_limit.k_last = -2


@kernel
def update_creep(c, srf, h, k):
    """A slow surface never moves away from its command, so while it stands on one side it comes nearer.

        1  away: the surface was seen farther from its command than (M.lo, M.hi) of the frame before allows
        2  (M.lo, M.hi) is narrowed by the least motion in this frame (`narrow_creep`)
        3  and intersected with where the surface was seen

    The order matters: step 1 compares with the bound before this frame's motion, and step 3 gives the bound
    for the next frame. After a skipped frame, or on the other side, the bound restarts with what is seen. If
    a frame has several JSBSim steps, the first still follows the command of the frame before
    (`commands_of_frame`).
    """
    seen, M, side, away = srf.judged, srf.rate_limit, side_of_commands(c, srf), False
    if side == 0 or side != M.side or k != M.k_last + 1:
        M.lo, M.hi = seen.lo, seen.hi
    else:
        away = seen.lo > M.hi if side == 1 else seen.hi < M.lo
        narrow_creep(c, srf, M, side)
    M.lo = max(M.lo, seen.lo)
    M.hi = min(M.hi, seen.hi)
    M.side, M.k_last = side, k
    return EMPTY_SET if away else UNLIMITED_SET


@kernel
def narrow_creep(c, srf, M, side):
    """Move the bound on the surface by what the slowest one comes nearer to its command in the judged frame.

        above its command (side 1)    hi <- min(hi, max(hi - d, u_hi + near)),    d = slow_step instants
        below it (side -1)            lo <- max(lo, min(lo + d, u_lo - near))

    u_lo, u_hi: `commands_of_frame`, rad; slow_step: the least step in an instant; nearer to the command than
    `near` the lag makes the steps smaller. Where it was at an instant bounds where it is a frame later.
    """
    motion = c.n_substeps * c.frames_per_block * srf.actuator.slow_step
    near = srf.actuator.near
    lo, hi = commands_of_frame(c, srf)
    if side == 1:
        M.hi = min(M.hi, max(M.hi - motion, hi + near))
    else:
        M.lo = max(M.lo, min(M.lo + motion, lo - near))


@kernel
def commands_of_frame(c, srf):
    """The least and greatest command that moved the surface into and within the judged frame, rad.

    If the frame has one instant, only the command of the frame before it (index 2) has moved the surface;
    otherwise the commands of both frames (2 and 1) have.
    """
    cmd, b = srf.commands, 2 if c.single_instant else 1
    return min(cmd.cmd_min[2], cmd.cmd_min[b]), max(cmd.cmd_max[2], cmd.cmd_max[b])


@kernel
def side_of_commands(c, srf):
    """1 for a surface certainly above all commands of the frame, -1 for one below them, 0 otherwise."""
    lo, hi = commands_of_frame(c, srf)
    return 1 if srf.judged.lo > hi else (-1 if srf.judged.hi < lo else 0)


RATE_LIMIT = FaultType(
    name="rate_limit", has_constant_parameter=False, sort_rank=3,
    reset_memory=reset_creep, consistent_interval=update_creep,
    memory_record_name="rate_limit",
    memory_dtype=record(
        lo=float, hi=float,  # where the surface can be while it stands on one side of its command, rad
        side=int, k_last=int,  # as `side_of_commands`, and the last judged frame, in which that was the side
    ),
    # a slow surface that has not moved visibly looks like one that stands still
    evidence_at_rest=REST_HIDES_TYPE, can_look_like=("stuck", "float", "hardover"),
    accommodation_mode=WAIT_FOR_SURFACE,
    frames_test="approach",
)  # fmt: skip
TYPES = LOSS, VARYING_LOSS, BIAS, GROWING_BIAS, OSCILLATORY, RATE_LIMIT
