"""A log read as if one mistake in its columns were mended: which mistake would explain a large residual?

A residual that is larger than in the flights of a model may come from a fault, from the air, or from the
log: a column of the other sign, in another unit, or exchanged with another. Only the last is a reason not to
read the log, and it shows: with the mistake mended the log is likelier in every part of the flight.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.units import UNIT_FACTORS
from beaver_ftc_logs.vehicle import Vehicle


class CorrectedLog(NamedTuple):
    """A log with one mistake mended.

    correction_text: the mend; samples: the log by it; log_jacobian: log of the factor by which the mend
    multiplies the rates. The likelihood of a log is that of the rates as they were logged: where a mend
    multiplies these by a, the density is a times as large. scaled_signal: the signal that the mend scales;
    empty of another mend.
    """

    correction_text: str
    samples: Samples
    log_jacobian: float = 0.0
    scaled_signal: str = ""


def corrected_logs(samples: Samples, vehicle: Vehicle, unknown: Collection[str]) -> Iterator[CorrectedLog]:
    """The log with two commands or two rates exchanged, or one rate or signal of another sign or unit. A rate
    that the attitude confirms stays as it is. unknown: surfaces whose effect the model does not know: that
    shows nothing of their commands."""
    surfaces = list(vehicle.surfaces)
    doubtful = [name for name in vehicle.rate_columns if name not in samples.confirmed_rates]
    for i, j in combinations([s for s, name in enumerate(surfaces) if name not in unknown], 2):
        order = list(range(len(surfaces)))
        order[i], order[j] = j, i
        exchanged = replace(samples, commands=samples.commands[:, order])
        yield CorrectedLog(f"the commands of {surfaces[i]} and {surfaces[j]} exchanged", exchanged)
    for first, second in combinations(doubtful, 2):
        exchanged = _altered(samples, vehicle, {first: second, second: first}, {})
        yield CorrectedLog(f"{first} and {second} exchanged", exchanged)
    for name in [*doubtful, *vehicle.signal_columns]:
        for factor in UNIT_FACTORS:
            scaled = _altered(samples, vehicle, {}, {name: factor})
            also = (float(np.log(abs(factor))), "") if name in doubtful else (0.0, name)
            yield CorrectedLog(f"`scale: {factor:.4g}` on {name}", scaled, *also)


def log_without_signal(samples: Samples, vehicle: Vehicle, signal: str) -> Samples:
    """The log in which a signal, and what the airspeed makes of it, is always 0."""
    return _altered(samples, vehicle, {}, {signal: 0.0})


def _altered(
    samples: Samples, vehicle: Vehicle, sources: Mapping[str, str], factors: Mapping[str, float]
) -> Samples:
    """The log with columns taken from others and multiplied, and what the airspeed makes of them as well."""
    names = vehicle.rate_columns + vehicle.regressor_columns
    columns = dict(zip(names, np.column_stack([samples.rates, samples.signals]).T, strict=True))
    new = []
    for name in names:
        logged = name.removesuffix(" by airspeed")
        suffix = name[len(logged) :]
        new.append(factors.get(logged, 1.0) * columns[sources.get(logged, logged) + suffix])
    signals = np.column_stack(new[3:]) if new[3:] else samples.signals
    return replace(samples, rates=np.column_stack(new[:3]), signals=signals)
