"""A log read as if one mistake in its columns were mended: which mistake would explain a large residual?

A residual that is larger than in the flights of a model may come from a fault, from the air, or from the
log: a column of the other sign, in another unit, or exchanged with another. Only the last is a reason not to
read the log, and it shows: with the mistake mended the log is likelier in every part of the flight.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.vehicle import Vehicle

_UNITS = (180.0 / np.pi, 1000.0)
"""Sizes of units in one another: degrees in a radian, thousandths in one."""


class Reading(NamedTuple):
    """A log with one mistake mended.

    says: the mend; samples: the log by it; density: log of the factor by which the mend multiplies the rates.
    The likelihood of a log is that of the rates as they were logged: where a mend multiplies these by a, the
    density is a times as large.
    """

    says: str
    samples: Samples
    density: float = 0.0


def mended(samples: Samples, vehicle: Vehicle) -> Iterator[Reading]:
    """The log with two commands or two rates exchanged, or one rate or signal of another sign or unit."""
    surfaces, rates = list(vehicle.surfaces), [getattr(vehicle.rates, axis).column for axis in "pqr"]
    for a, b in combinations(range(len(surfaces)), 2):
        order = list(range(len(surfaces)))
        order[a], order[b] = b, a
        exchanged = replace(samples, commands=samples.commands[:, order])
        yield Reading(f"the commands of {surfaces[a]} and {surfaces[b]} exchanged", exchanged)
    for one, other in combinations(rates, 2):
        exchanged = _read(samples, vehicle, {one: other, other: one}, {})
        yield Reading(f"{one} and {other} exchanged", exchanged)
    for name in [*rates, *vehicle.signal_names]:
        for factor in (-1.0, *_UNITS, *(1.0 / unit for unit in _UNITS)):
            scaled = _read(samples, vehicle, {}, {name: factor})
            density = float(np.log(abs(factor))) if name in rates else 0.0
            yield Reading(f"`scale: {factor:.4g}` on {name}", scaled, density)


def _read(
    samples: Samples, vehicle: Vehicle, source: Mapping[str, str], factor: Mapping[str, float]
) -> Samples:
    """The log with columns taken from others and multiplied, and what the airspeed makes of them as well."""
    names = [getattr(vehicle.rates, axis).column for axis in "pqr"] + vehicle.past_names
    columns = dict(zip(names, np.column_stack([samples.rates, samples.signals]).T, strict=True))
    found = []
    for name in names:
        stem, suffix = name.removesuffix(" by airspeed"), name[len(name.removesuffix(" by airspeed")) :]
        found.append(factor.get(stem, 1.0) * columns[source.get(stem, stem) + suffix])
    signals = np.column_stack(found[3:]) if found[3:] else samples.signals
    return replace(samples, rates=np.column_stack(found[:3]), signals=signals)
