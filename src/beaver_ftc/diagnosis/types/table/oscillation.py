"""Oscillation: p - u swings about 0, no half-cycle longer than that of the slowest oscillation.

Counting half-cycles above a level that noise cannot reach is how oscillatory failures are monitored in
service [Goupil2010]. `see_frame` and `consistent_interval` read the judged frame, or block of frames
(srf.judged).

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
    lo, hi          interval of p - u in the judged frame, rad
    M               memory of the type: its `memory_dtype` below
"""

from math import pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET
from beaver_ftc.diagnosis.types import REST_EXCLUDES_TYPE, SUBTRACT_OFFSET, FaultType
from beaver_ftc.diagnosis.types.observations import judged_error

MIN_HALF_CYCLES = 3  # two whole ones, and the first, which is cut off at its beginning


@kernel
def reset_memory(srf, h):
    """No half-cycle has been counted."""
    srf.oscillatory.n_half = srf.oscillatory.sign = 0
    srf.oscillatory.square = srf.oscillatory.square_past = 0.0


@kernel
def see_frame(c, srf, h, k, skipped):
    """Add (p - u)^2 of the judged frame to the sum of the half-cycle. In a skipped frame the surface may have
    swung to the other side, unseen."""
    lo, hi = judged_error(srf)
    srf.oscillatory.square += (0.5 * (lo + hi)) ** 2
    if skipped:
        srf.oscillatory.since = k + 1


@kernel
def consistent_interval(c, srf, h, k):
    """Count half-cycles. A sign that stays for longer than the slowest half-cycle is no oscillation:
    EMPTY_SET if k - since > half_frames. A half-cycle ends where the sign of p - u changes:

        n_half <- n_half + 1,    square_past <- square_past + square from the second half-cycle on

    At a stop half of a swing is hidden. If a frame has several instants, the mean of a quick swing over them
    then keeps its sign, so such a frame is no evidence against an oscillation.
    """
    M = srf.oscillatory
    lo, hi = judged_error(srf)
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
        M.sign = sign
        M.since = k
    return EMPTY_SET if k - M.since > c.half_frames else UNLIMITED_SET


@kernel
def has_shown(srf, h):
    """Whether the surface has swung for two whole half-cycles."""
    return srf.oscillatory.n_half >= MIN_HALF_CYCLES


def estimate_parameter(fdi: np.void, s: int, h: int) -> float:
    """Amplitude sqrt(2 mean (p - u)^2), rad, the mean over the whole half-cycles."""
    M = fdi["types"]["surface"][s]["oscillatory"]
    return float(sqrt(2.0 * M["square_past"] / (M["last_end"] - M["first_end"])))


def estimate_frequency(fdi: np.void, s: int, h: int) -> float:
    """Frequency pi n / T, rad/s, of the n whole half-cycles that took T s."""
    M = fdi["types"]["surface"][s]["oscillatory"]
    n = int(M["n_half"]) - 1
    frames = int(M["last_end"] - M["first_end"])
    return n * pi / (float(fdi["types"]["config"]["block_duration_s"]) * frames)


TYPES = (
    FaultType(
        name="oscillatory", has_constant_parameter=False, sort_rank=2,
        reset_memory=reset_memory, see_frame=see_frame, consistent_interval=consistent_interval,
        memory_record_name="oscillatory",
        memory_dtype=record(
            sign=int, since=int,  # sign of p - u; the frame from which the present half-cycle is timed
            n_half=int, first_end=int, last_end=int,  # half-cycles that have ended; end of the first and last
            # sums of (p - u)^2, rad2: of this half-cycle from its second frame on; of whole ones before
            square=float, square_past=float,
        ),
        has_shown=has_shown, show_half_cycles=2, evidence_at_rest=REST_EXCLUDES_TYPE,
        can_look_like=("rate_limit",),
        accommodation_mode=SUBTRACT_OFFSET, frames_test="swing",
        estimate_parameter=estimate_parameter, estimate_frequency_rad_s=estimate_frequency,
    ),
)  # fmt: skip
