"""A log with one correction of its columns: two columns exchanged, or a column with another sign or unit."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.units import UNIT_FACTORS
from beaver_ftc_logs.vehicle import Vehicle


class CorrectedLog(NamedTuple):
    """A log after one correction.

    correction_text: words for the correction. samples: the corrected log. log_jacobian: log |a| a sample if a
    rate was multiplied by a, else 0. Likelihoods are compared for the rates as they were logged, and the
    density of these is |a| times that of the corrected rates. scaled_signal: the signal that was multiplied;
    empty for another correction.
    """

    correction_text: str
    samples: Samples
    log_jacobian: float = 0.0
    scaled_signal: str = ""


def corrected_logs(samples: Samples, vehicle: Vehicle, unknown: Collection[str]) -> Iterator[CorrectedLog]:
    """The log with two commands or two rates exchanged, or one rate or signal with another sign or unit. A
    rate that the attitude confirms is not changed. unknown: surfaces whose effect the model does not know;
    no likelihood depends on their commands, so these are not exchanged."""
    surfaces = list(vehicle.surfaces)
    doubtful = [name for name in vehicle.rate_columns if name not in samples.confirmed_rates]
    for i, j in combinations([s for s, name in enumerate(surfaces) if name not in unknown], 2):
        order = np.arange(len(surfaces))
        order[[i, j]] = j, i
        exchanged = replace(samples, commands=samples.commands[:, order])
        yield CorrectedLog(f"the commands of {surfaces[i]} and {surfaces[j]} exchanged", exchanged)
    for first, second in combinations(doubtful, 2):
        exchanged = altered_log(samples, vehicle, {first: second, second: first}, {})
        yield CorrectedLog(f"{first} and {second} exchanged", exchanged)
    for name in [*doubtful, *vehicle.signal_columns]:
        for factor in UNIT_FACTORS:
            text = f"`scale: {factor:.4g}` on {name}"
            scaled = altered_log(samples, vehicle, {}, {name: factor})
            if name in doubtful:
                yield CorrectedLog(text, scaled, log_jacobian=float(np.log(abs(factor))))
            else:
                yield CorrectedLog(text, scaled, scaled_signal=name)


def altered_log(
    samples: Samples, vehicle: Vehicle, sources: Mapping[str, str], factors: Mapping[str, float]
) -> Samples:
    """The log in which a column of rates or signals has the values of another one (sources: name -> other
    name) and is then multiplied (factors: name -> factor). Columns that are not named stay.

    With a reference airspeed, the m columns are followed by their m products with the airspeed
    (`samples.scale_by_airspeed`), which change alike.
    """
    names = vehicle.rate_columns + vehicle.signal_columns
    order = [names.index(sources.get(name, name)) for name in names]
    factor = [factors.get(name, 1.0) for name in names]
    columns = np.column_stack([samples.rates, samples.signals])  # (n, m) or (n, 2 m)
    altered = columns.reshape(len(columns), -1, len(names))[:, :, order] * factor
    rates, signals = np.split(altered.reshape(columns.shape), [3], axis=1)
    return replace(samples, rates=rates, signals=signals)
