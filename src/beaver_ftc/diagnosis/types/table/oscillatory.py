"""A surface that swings about its command, no half-cycle longer than that of the slowest oscillation.

Counting half-cycles above a level that noise cannot reach is how oscillatory failures are monitored in
service [Goupil2010].
"""

from math import pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.types.contract import ANYTHING, EXCLUDED, NOTHING, SHIFTED, FaultType

HALF_CYCLES_THAT_SHOW = 3


@kernel
def begin(surface, kind):
    """No half-cycle has been seen."""
    surface.oscillatory.half_cycles = surface.oscillatory.sign = 0


@kernel
def add_square(config, surface, kind):
    """Sum the squares of the deflection error."""
    error = 0.5 * (surface.judged.low + surface.judged.high) - surface.judged.command
    surface.oscillatory.square += error**2


@kernel
def judge(config, surface, kind, k):
    """Count half-cycles; a sign that stays for longer than the slowest half-cycle is no oscillation.

    At a stop half of a swing is hidden: where several instants are seen at once, the mean of a quick one
    keeps its sign.
    """
    swing = surface.oscillatory
    low, high = surface.judged.low - surface.judged.command, surface.judged.high - surface.judged.command
    sign = 1 if low > 0.0 else (-1 if high < 0.0 else 0)
    if sign == 0 or (not config.whole and surface.judged.hides[0 if sign > 0 else 1]):
        swing.steady_since = k + 1
        return ANYTHING
    if sign != swing.sign:
        end_half_cycle(swing, k)
        swing.sign, swing.steady_since = sign, k
    return NOTHING if k - swing.steady_since > config.patience else ANYTHING


@kernel
def end_half_cycle(swing, k):
    """A half-cycle ends here; the first one is cut off at its beginning and does not count."""
    if swing.sign != 0:
        if swing.half_cycles == 0:
            swing.first_end = k
        else:
            swing.squares += swing.square
        swing.last_end = k
        swing.half_cycles += 1
        swing.square = 0.0


@kernel
def skip(config, surface, kind, k):
    """In a frame that is not judged it may have swung to the other side, unseen."""
    surface.oscillatory.steady_since = k + 1


@kernel
def has_shown(surface):
    """Whether it has swung for two half-cycles and more."""
    return surface.oscillatory.half_cycles >= HALF_CYCLES_THAT_SHOW


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Amplitude, rad."""
    swing = fdi["types"]["surface"][s]["oscillatory"]
    return float(sqrt(2.0 * swing["squares"] / (swing["last_end"] - swing["first_end"])))


def frequency_rad_s(fdi: np.void, s: int, kind: int) -> float | None:
    """From the half-cycles counted."""
    swing = fdi["types"]["surface"][s]["oscillatory"]
    half_cycles, frames = int(swing["half_cycles"]) - 1, int(swing["last_end"] - swing["first_end"])
    return half_cycles * pi / (float(fdi["types"]["config"]["span_s"]) * frames)


OSCILLATORY = FaultType(
    name="oscillatory", constant=False, rank=2,
    begin=begin, on_frame=add_square, judge=judge, on_skipped_frame=skip, record="oscillatory",
    memory=record(
        sign=int, steady_since=int,
        half_cycles=int, first_end=int, last_end=int,  # ends of half-cycles, frames
        square=float, squares=float,  # of the deflection error, rad2: this half-cycle, those before
    ),
    has_shown=has_shown, shows_within=2, at_rest=EXCLUDED, mistaken_for=("rate_limit",),
    accommodation=SHIFTED, estimate=estimate, frequency_rad_s=frequency_rad_s,
)  # fmt: skip
TYPES = (OSCILLATORY,)
