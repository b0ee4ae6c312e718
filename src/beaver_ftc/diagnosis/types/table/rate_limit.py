"""Rate limit: p moves only towards its command, at any rate down to the slowest declared.

A slower surface counts as stuck: the two types are each other's limit, and only a least rate distinguishes
them. `consistent_interval` reads the judged frame, or block of frames (srf.judged), and the commands of it
and of the one before (srf.commands).

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
    M               memory of the type: its `memory_dtype` below
"""

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import REST_HIDES_TYPE, WAIT_FOR_SURFACE, FaultType


@kernel
def reset_memory(srf, h):
    """No frame has been judged: k_last + 1 = -1 is before the first frame, 0."""
    srf.rate_limit.k_last = -2


@kernel
def consistent_interval(c, srf, h, k):
    """EMPTY_SET if the surface was seen to move away from its command, else UNLIMITED_SET: a slow surface
    never moves away, so while it stands on one side it comes nearer.

        1  away: the surface was seen farther from its command than (M.lo, M.hi) of the frame before allows
        2  (M.lo, M.hi) is narrowed by the least motion in this frame (`narrow_by_motion`)
        3  and intersected with where the surface was seen

    The order matters: step 1 compares with the bound before this frame's motion, and step 3 gives the bound
    for the next frame. After a skipped frame, on the other side, or if the side is not certain (0), the bound
    restarts with what is seen. If a frame has several JSBSim steps, the first still follows the command of
    the frame before (`commands_of_frame`).
    """
    judged = srf.judged
    M = srf.rate_limit
    side = side_of_commands(c, srf)
    away = False
    if side == 0 or side != M.side or k != M.k_last + 1:
        M.lo = judged.lo
        M.hi = judged.hi
    else:
        away = judged.lo > M.hi if side == 1 else judged.hi < M.lo
        narrow_by_motion(c, srf, M, side)
    M.lo = max(M.lo, judged.lo)
    M.hi = min(M.hi, judged.hi)
    M.side = side
    M.k_last = k
    return EMPTY_SET if away else UNLIMITED_SET


@kernel
def narrow_by_motion(c, srf, M, side):
    """Move the bound on the surface by what the slowest one comes nearer to its command in the judged frame.

        above its command (side 1)    hi <- min(hi, max(hi - d, u_hi + near)),    d = slow_step instants
        below it (side -1)            lo <- max(lo, min(lo + d, u_lo - near))

    u_lo, u_hi: `commands_of_frame`, rad; slow_step: the least step in an instant; nearer to the command than
    `near` the lag makes the steps smaller. Where it was at an instant bounds where it is a frame later.
    """
    d = c.n_substeps * c.frames_per_block * srf.actuator.slow_step
    near = srf.actuator.near
    u_lo, u_hi = commands_of_frame(c, srf)
    if side == 1:
        M.hi = min(M.hi, max(M.hi - d, u_hi + near))
    else:
        M.lo = max(M.lo, min(M.lo + d, u_lo - near))


@kernel
def commands_of_frame(c, srf):
    """The least and greatest command that moved the surface into and within the judged frame, rad.

    If the frame has one instant, only the command of the frame before it (index 2) has moved the surface;
    otherwise the commands of both frames (2 and 1) have.
    """
    cmd = srf.commands
    last = 2 if c.single_instant else 1
    return min(cmd.cmd_min[2], cmd.cmd_min[last]), max(cmd.cmd_max[2], cmd.cmd_max[last])


@kernel
def side_of_commands(c, srf):
    """1 for a surface certainly above all commands of the frame, -1 for one below them, 0 otherwise."""
    lo, hi = commands_of_frame(c, srf)
    return 1 if srf.judged.lo > hi else (-1 if srf.judged.hi < lo else 0)


TYPES = (
    FaultType(
        name="rate_limit", has_constant_parameter=False, sort_rank=3,
        reset_memory=reset_memory, consistent_interval=consistent_interval,
        memory_record_name="rate_limit",
        memory_dtype=record(
            lo=float, hi=float,  # where the surface can be while it stands on one side of its command, rad
            side=int,  # as `side_of_commands`
            k_last=int,  # the last judged frame, in which that was the side
        ),
        # A slow surface that has not moved visibly looks like one that stands still.
        evidence_at_rest=REST_HIDES_TYPE, can_look_like=("stuck", "float", "hardover"),
        accommodation_mode=WAIT_FOR_SURFACE,
        frames_test="approach",
    ),
)  # fmt: skip
