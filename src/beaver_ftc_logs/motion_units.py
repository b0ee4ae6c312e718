"""Refuse rates or commands that are in another unit than in other flights, by the size of their motion."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.model import FittedRanges
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.trust import central_ranges
from beaver_ftc_logs.units import RATE, SI_UNITS, nearest_unit

# All rates are in the same unit if their motions, relative to the flights of the model, differ by less than
# this factor.
_MAX_AXIS_RATIO = 10.0
# The motions may differ by the square of this factor from those of the unit that is guessed from them.
_UNIT_FACTOR_ROOT = 1.6
# A motion differs between flights by this factor at most.
MAX_ALIKE_FACTOR = 3.0
# Another unit changes a motion by this factor at least.
_MIN_UNIT_FACTOR = 12.0
ONE_UNIT = "one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)"


def refuse_rate_unit(samples: Samples, ranges: FittedRanges) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if not ranges.rates:
        return
    ratios = relative_motion(samples.rates, ranges.rates)
    if not ratios.max() < _MAX_AXIS_RATIO * ratios.min():  # also if an axis has no number: its ratio is 0
        return
    ratio = float(np.exp(np.mean(np.log(ratios))))
    hints = (
        (1.0 / ratio, "a factor of {to_si:.4g} (`unit: {unit}`) fits"),
        (ratio, "a factor of {from_si:.4g} fits: the model's own were in {unit}?"),
    )
    for size, hint in hints:
        unit = nearest_unit(RATE, size, _UNIT_FACTOR_ROOT**2)
        if unit not in (None, "rad/s"):
            to_si = SI_UNITS[unit][1]
            text = hint.format(to_si=to_si, from_si=1.0 / to_si, unit=unit)
            raise refusal(
                samples.name,
                f"rates spread {ratio:.3g} times as widely as in the flights of the model",
                f"rates in rad/s; {text}",
            )


def refuse_command_unit(flight: Samples, first: Samples, surfaces: Sequence[str]) -> None:
    """Raise BadInput where the motion of a command, over that in another flight, `first`, shows another unit.

    rates                               motion of the command that is refused
    each between 1 / 3 and 3 times      below 1 / 12, or above 12 times
    otherwise                           above 12 times the largest motion of a rate, or 12 if that is larger

    The factors are MAX_ALIKE_FACTOR and _MIN_UNIT_FACTOR. A motion beyond 1e-4 to 1e4 is not judged here.
    """
    rate_ratios = relative_motion(flight.rates, central_ranges(first.rates))
    alike = rate_ratios.min() > 1.0 / MAX_ALIKE_FACTOR and rate_ratios.max() < MAX_ALIKE_FACTOR
    allowed = _MIN_UNIT_FACTOR * (1.0 if alike else max(rate_ratios.max(), 1.0))
    ratios = relative_motion(flight.commands, central_ranges(first.commands))
    for surface, ratio in zip(surfaces, ratios.tolist(), strict=True):
        if allowed < ratio < 1e4 or (alike and 1e-4 < ratio < 1.0 / _MIN_UNIT_FACTOR):
            raise BadInput(
                f"{flight.name}: the command of {surface} moves {ratio:.3g} times as much as in the other "
                f"flights, the rates {rate_ratios.max():.2g} times at most, allowed: {ONE_UNIT}"
            )


def relative_motion(values: Floats, reference: Sequence[Sequence[float]]) -> Floats:
    """Width of the central range of each column of values (n, S) over that of the reference ranges, (S,)."""
    spans, usual_spans = (
        np.ptp(np.array(pairs).reshape(-1, 2), axis=1) for pairs in (central_ranges(values), reference)
    )
    return spans / np.maximum(usual_spans, MIN_DIVISOR)
