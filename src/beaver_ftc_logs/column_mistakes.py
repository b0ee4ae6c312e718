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
from beaver_ftc_logs.units import SIGN_AND_UNIT_FACTORS
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


def logs_with_one_mistake_corrected(
    samples: Samples, vehicle: Vehicle, surfaces_of_unknown_effect: Collection[str] = ()
) -> Iterator[CorrectedLog]:
    """The log with two commands or two rates exchanged, or one rate or signal of another sign or unit. A rate
    that the attitude confirms stays as it is. surfaces_of_unknown_effect: surfaces whose effect the model
    does not know: that shows nothing of their commands."""
    surfaces = list(vehicle.surfaces)
    doubtful_rate_column_names = [
        name
        for axis in "pqr"
        if (name := getattr(vehicle.rates, axis).column) not in samples.rates_confirmed_by_attitude
    ]
    for first_surface_index, second_surface_index in combinations(
        [i for i, name in enumerate(surfaces) if name not in surfaces_of_unknown_effect], 2
    ):
        surface_order = list(range(len(surfaces)))
        surface_order[first_surface_index], surface_order[second_surface_index] = (
            second_surface_index,
            first_surface_index,
        )
        exchanged_samples = replace(samples, commands=samples.commands[:, surface_order])
        yield CorrectedLog(
            f"the commands of {surfaces[first_surface_index]} and {surfaces[second_surface_index]} exchanged",
            exchanged_samples,
        )
    for first_rate_column_name, second_rate_column_name in combinations(doubtful_rate_column_names, 2):
        exchanged_samples = _with_exchanged_or_scaled_columns(
            samples,
            vehicle,
            {
                first_rate_column_name: second_rate_column_name,
                second_rate_column_name: first_rate_column_name,
            },
            {},
        )
        yield CorrectedLog(
            f"{first_rate_column_name} and {second_rate_column_name} exchanged", exchanged_samples
        )
    for name in [*doubtful_rate_column_names, *vehicle.signal_column_names]:
        is_rate = name in doubtful_rate_column_names
        for factor in SIGN_AND_UNIT_FACTORS:
            scaled_samples = _with_exchanged_or_scaled_columns(samples, vehicle, {}, {name: factor})
            log_jacobian, scaled_signal = (float(np.log(abs(factor))), "") if is_rate else (0.0, name)
            yield CorrectedLog(
                f"`scale: {factor:.4g}` on {name}", scaled_samples, log_jacobian, scaled_signal
            )


def log_without_signal(samples: Samples, vehicle: Vehicle, signal: str) -> Samples:
    """The log in which a signal, and what the airspeed makes of it, is always 0."""
    return _with_exchanged_or_scaled_columns(samples, vehicle, {}, {signal: 0.0})


def _with_exchanged_or_scaled_columns(
    samples: Samples,
    vehicle: Vehicle,
    source_column_of_column: Mapping[str, str],
    factor_of_column: Mapping[str, float],
) -> Samples:
    """The log with columns taken from others and multiplied, and what the airspeed makes of them as well."""
    column_names = [getattr(vehicle.rates, axis).column for axis in "pqr"] + vehicle.signal_regressor_names
    columns = dict(zip(column_names, np.column_stack([samples.rates, samples.signals]).T, strict=True))
    new_rates_and_signals = []
    for name in column_names:
        logged_column_name = name.removesuffix(" by airspeed")
        airspeed_suffix = name[len(logged_column_name) :]
        new_rates_and_signals.append(
            factor_of_column.get(logged_column_name, 1.0)
            * columns[source_column_of_column.get(logged_column_name, logged_column_name) + airspeed_suffix]
        )
    new_signals = np.column_stack(new_rates_and_signals[3:]) if new_rates_and_signals[3:] else samples.signals
    return replace(samples, rates=np.column_stack(new_rates_and_signals[:3]), signals=new_signals)
