"""Which columns of a log can be used: those of the samples must be there, undamaged, and in the unit that
the vehicle file says, or the log is refused. `column_mistakes` compares the columns with a model."""

import numpy as np

from beaver_ftc_logs import signals, unit_mistakes
from beaver_ftc_logs.recording import Columns, RecordedFlight, largest_magnitude
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.vehicle import Vehicle

MAX_NUMBER = 1e6  # a larger number in a log is damaged
# A larger rate is in another unit: usual gyros measure up to 35 rad/s. A spike may be larger than any rate of
# a vehicle (`unit_mistakes.FAST_RAD_S`), and is no reason to refuse a log.
_MAX_RATE_RAD_S = 60.0


def refuse_unusable(log: RecordedFlight, vehicle: Vehicle) -> None:
    """Raise BadInput where a column is missing, or has no number or a damaged one, or where a rate is so
    large that it is in another unit."""
    log.check_has(vehicle.sampled_columns)
    for name in vehicle.sampled_columns:
        values = log.columns[name].values
        if not np.isfinite(values).any():
            raise refusal(log.name, f"column {name} holds no number", "a logged quantity")
        largest = largest_magnitude(values)
        if largest > MAX_NUMBER:
            raise refusal(log.name, f"column {name} holds {largest:g}", f"up to {MAX_NUMBER:g}")
        if name in vehicle.rate_columns and largest > _MAX_RATE_RAD_S:
            as_deg = np.deg2rad(largest)
            hint = f" (deg/s would be {as_deg:.3g} rad/s: `unit: deg/s`)" if as_deg < _MAX_RATE_RAD_S else ""
            raise refusal(
                log.name,
                f"column {name} reaches {largest:g}",
                f"rates in rad/s, up to {_MAX_RATE_RAD_S:g}{hint}",
            )


def confirm_rates(log: RecordedFlight, vehicle: Vehicle) -> frozenset[str]:
    """The columns of rates that the angles confirm; none if a rate is clipped, as angles are then not
    compared: the integral of a clipped rate is not the change of its angle. Raises BadInput where rates,
    angles and gravity contradict one another, with the column that seems to be in another unit."""
    columns = log.columns
    rates = {name: columns[name] for name in vehicle.rate_columns}
    is_clipped = any(signals.find_clipped_rows(rate.values).any() for rate in rates.values())
    angles = [None] * 3 if is_clipped else named_angles(columns, vehicle)
    mistake = unit_mistakes.attitude_mistake(rates, angles, _possible_rates(log, vehicle))
    acceleration = vehicle.acceleration
    if not mistake and acceleration and (az := columns.get(acceleration.column)):
        mistake = unit_mistakes.gravity_remark(az, acceleration.column)
    if mistake:
        raise refusal(log.name, mistake, "what the vehicle file says, or its `unit` mended")
    return unit_mistakes.confirmed_rates(rates, angles)


def _possible_rates(log: RecordedFlight, vehicle: Vehicle) -> Columns:
    """The other columns of a log that may have been exchanged with a rate: signals, flow and commands."""
    flow = [quantity.column for quantity in vehicle.flow.values()]
    names = dict.fromkeys([*vehicle.signal_columns, *flow, *vehicle.command_columns])
    return {name: log.columns[name] for name in names if name in log.columns}


def named_angles(columns: Columns, vehicle: Vehicle) -> list[unit_mistakes.NamedColumn | None]:
    """The columns of roll, pitch and yaw with their names; None for an angle that is not named or not
    logged."""
    keys = [getattr(vehicle.attitude, angle, None) for angle in ("roll", "pitch", "yaw")]
    return [(key.column, columns[key.column]) if key and key.column in columns else None for key in keys]
