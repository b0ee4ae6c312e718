"""Propose a vehicle file for a log: which columns are rates, commands and angles, and in which unit.

The name of a column shows which quantity it is (`known_quantities`). Its unit follows from the name, from the
size of its numbers, and from mechanics: the integral of p is the change of roll, the median magnitude of the
acceleration along z is 1 g.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import physics
from beaver_ftc_logs.known_commands import command_names, missing_commands_text
from beaver_ftc_logs.known_quantities import find_quantities
from beaver_ftc_logs.likely_logs import LikelyLog
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight, largest_magnitude, nearest_names_text
from beaver_ftc_logs.rotorcraft import VTOL_MODE, hovers_throughout, multicopter_reason
from beaver_ftc_logs.unit_mistakes import FAST_RAD_S
from beaver_ftc_logs.units import (
    ACCELERATION,
    HALF_PULSE_RANGE_US,
    NEUTRAL_PULSE_US,
    RATE,
    SI_UNITS,
    nearest_unit,
)
from beaver_ftc_logs.vehicle import unused_keys_as_comments

# Part of the name of a rate -> its unit.
_UNIT_OF_PART = {"rad_s": "rad/s", "rad/s": "rad/s", "deg_s": "deg/s", "deg/s": "deg/s", "dps": "deg/s"}
_PWM_RANGE_US = (700.0, 2300.0)  # a command whose median is between these is a pulse
_MIN_CORRELATION = 0.7  # a rate and its angle belong together if their correlation is larger
_MAX_COMMANDS = 8  # largest number of proposed commands


class NoVehicleError(Exception):
    """No vehicle file can be proposed for a log; the text has the reason."""


def rates_agree(fit: physics.AngleFit) -> bool:
    """Whether a rate and its angle belong together, whatever their units."""
    return abs(fit.correlation) > _MIN_CORRELATION


def guess_vehicle(path: Path, likely: LikelyLog) -> Document:
    """The keys of a vehicle file for a log. Raises NoVehicleError if it has no rates or no commands."""
    log = likely.log
    mixing = likely.mixing
    names = [name for name, column in log.columns.items() if np.isfinite(column.values).any()]
    column_of = find_quantities(names)
    if hovers_throughout(log.parameters, log.columns):
        raise NoVehicleError(
            f"is the log of a VTOL that hovers throughout ({VTOL_MODE} is never 2), allowed: a log with "
            "flight on its wing"
        )
    if not mixing.surfaces:
        _add_commands_by_name(likely, names)
    if missing := [axis for axis in "pqr" if axis not in column_of]:
        raise NoVehicleError(
            f"no column looks like the rate {missing[0]}, allowed: a vehicle file that names it; the log has "
            + nearest_names_text("rate", likely.all_names)
        )
    if not mixing.surfaces:
        reason = missing_commands_text(likely.all_names)
        raise NoVehicleError(f"{reason}; the log has {nearest_names_text('command', likely.all_names)}")
    return {"name": _plain_name(path.stem), "reader": likely.reader, **_quantity_keys(likely, column_of)}


def _quantity_keys(likely: LikelyLog, column_of: dict[str, str]) -> Document:
    """The keys of the vehicle file on time, rates, commands and further quantities. column_of: the column of
    each quantity that the log has; p, q and r are among them."""
    roll = likely.log.columns[column_of["roll"]] if "roll" in column_of else None
    angle_unit = _guess_angle_unit(column_of["roll"], roll, likely.reader) if roll else "rad"
    rate_unit = _guess_rate_unit(
        likely.log, [column_of[axis] for axis in "pqr"], roll, SI_UNITS[angle_unit][1]
    )
    vehicle: Document = {}
    if likely.time:
        vehicle["time"] = dict(zip(("column", "unit"), likely.time, strict=True))
    vehicle["rates"] = {axis: _column_entry(column_of[axis], rate_unit, "rad/s") for axis in "pqr"}
    vehicle |= {"commands": likely.mixing.commands, "surfaces": likely.mixing.surfaces}
    if roll:
        named = [axis for axis in ("roll", "pitch") if axis in column_of]
        vehicle["attitude"] = {axis: _column_entry(column_of[axis], angle_unit, "rad") for axis in named}
    if az := column_of.get("az"):
        median = float(np.nanmedian(np.abs(likely.log.columns[az].values)))
        if median > 0.0 and (unit := nearest_unit(ACCELERATION, SI_UNITS["g"][1] / median, 2.0)):
            vehicle["acceleration"] = _column_entry(az, unit, "m/s2")
    if "airspeed" in column_of:
        vehicle["airspeed"] = column_of["airspeed"]
    return vehicle


def _add_commands_by_name(likely: LikelyLog, names: list[str]) -> None:
    """Add to the mixing a surface for each column that looks like a command. Raises NoVehicleError for a
    multicopter."""
    log = likely.log
    mixing = likely.mixing
    if rotors := multicopter_reason(log.parameters, likely.all_names):
        raise NoVehicleError(
            f"is the log of a multicopter ({rotors}), which has no surfaces, allowed: a log of an aircraft "
            "with surfaces"
        )
    for name in command_names(names, log.parameters)[:_MAX_COMMANDS]:
        mixing.entry_by_column[name] = _pulse_entry(name, log.columns[name].values)
        mixing.surfaces[_plain_name(name)] = {name: 1.0}


def _guess_angle_unit(name: str, roll: Column, reader: str) -> str:
    """The unit of the attitude: degrees for ArduPilot, otherwise by the name, otherwise by the size: degrees
    if an angle exceeds 2 pi."""
    if reader == "ardupilot" or "deg" in name.lower():
        return "deg"
    return "deg" if "rad" not in name.lower() and largest_magnitude(roll.values) > 2.0 * np.pi else "rad"


def _guess_rate_unit(
    log: RecordedFlight, rate_names: list[str], roll: Column | None, rad_per_roll_unit: float
) -> str:
    """The unit of the rates, the first of a row that is known:

        rates and roll angle agree    unit in which they agree, unit by the name, rad/s
        they do not, or no roll       unit by the name, deg/s above FAST_RAD_S, rad/s

    rad_per_roll_unit: factor on the numbers of the roll angle.
    """
    rates = [log.columns[name] for name in rate_names]
    named = rate_names[0].lower()
    unit = next((unit_of_part for part, unit_of_part in _UNIT_OF_PART.items() if part in named), None)
    if roll is not None:
        in_rad = replace(roll, values=roll.values * rad_per_roll_unit)
        fit = physics.fit_angle(rates, (in_rad, None, None), 0)
        if fit is not None and rates_agree(fit):
            unit = nearest_unit(RATE, abs(fit.slope), 1.5) or unit or "rad/s"
    largest = max(largest_magnitude(rate.values) for rate in rates)
    return unit or ("deg/s" if largest > FAST_RAD_S else "rad/s")


def _column_entry(name: str, unit: str, si_unit: str) -> Any:
    """The entry of a column in the vehicle file: its name alone if it is in the SI unit."""
    return name if unit == si_unit else {"column": name, "unit": unit}


def _pulse_entry(name: str, values: Floats) -> Any:
    """The entry that converts a command to a share of travel: from pulses of 1100 to 1900 us if the median is
    that of a pulse, from per cent if the largest magnitude is between 10 and 105, otherwise without a factor.
    """
    median = float(np.nanmedian(values))
    largest = largest_magnitude(values)
    if _PWM_RANGE_US[0] < median < _PWM_RANGE_US[1]:
        scale = 1.0 / HALF_PULSE_RANGE_US
        return {"column": name, "scale": scale, "offset": -scale * NEUTRAL_PULSE_US}
    return {"column": name, "unit": "%"} if 10.0 < largest <= 105.0 else name


def _plain_name(name: str) -> str:
    """A name in which each run of characters that a vehicle file forbids in names is one underscore."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:100] or "log"


def vehicle_file_text(vehicle: Document) -> str:
    """The text of a vehicle file: a head, the keys, and the further keys as comments."""
    import yaml

    head = (
        "# Proposed by `identify --check`. Check each line. Choose commands that come before any part\n"
        "# that can fail. A surface may follow several commands: `left: {roll_cmd: 0.5, pitch_cmd: -0.5}`.\n"
    )
    yaml_text = str(yaml.safe_dump(vehicle, sort_keys=False, allow_unicode=True, default_flow_style=None))
    return head + yaml_text + unused_keys_as_comments(vehicle)
