"""Check a log before a fit: columns, units, gaps, dead signals, and a vehicle file for it.

Which column is what is guessed from its name; its unit from the name, from the size of its numbers, and from
what mechanics says: the integral of p is the change of roll, the mean of the acceleration is 1 g.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import physics
from beaver_ftc_logs.known_commands import (
    command_names,
    is_command_name,
    missing_commands_text,
    multicopter_reason,
)
from beaver_ftc_logs.mixing import Mixing, mixing_of_log
from beaver_ftc_logs.readers import (
    NAMES_OF_READERS_OF_WANTED_COLUMNS,
    check_exists,
    read_flight,
    read_parts,
    reader_name_for_path,
)
from beaver_ftc_logs.readers.table import (
    TIME_COLUMN,
    column_names,
    first_cells_of_column,
    text_of_column_phrase,
)
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight, nearest_names_text
from beaver_ftc_logs.samples import Samples, read_parts_for_vehicle, resample
from beaver_ftc_logs.units import (
    ACCELERATION,
    KIND_AND_SI_FACTOR_OF_UNIT,
    RATE,
    SECONDS_PER_TIME_UNIT,
    nearest_unit,
)
from beaver_ftc_logs.vehicle import Vehicle, unused_keys_as_comments


def _rate_name_pattern(rate_name: str, angle: str, axis: str, vector_index: int) -> str:
    """Return a pattern of the names of a body rate: ours, by its angle, by its axis, by its place in a
    vector."""
    return "|".join((
        rf"(.*_)?{rate_name}_(rad|deg)_?s(ec)?", rate_name, rf"(.*\.)?{angle}_?(rate|speed)\w*",
        rf".*gyr(o|_)?_?{axis}\w*", rf".*gyro_?(rad|adc)\[{vector_index}\](_deg_s)?",
        rf"(.*[._])?ang(ular)?_?vel(ocity)?_?({axis}|{rate_name})(_\w+)?", f"w{axis}",
        f"omega_?{axis}", rf"rate\.{angle[0]}",
        rf".*velocity\.({axis}|xyz\[{vector_index}\])",
    ))  # fmt: skip


_COLUMN_NAME_PATTERNS = {
    "p": _rate_name_pattern("p", "roll", "x", 0),
    "q": _rate_name_pattern("q", "pitch", "y", 1),
    "r": _rate_name_pattern("r", "yaw", "z", 2),
    "roll": r"(.*\.)?(roll|phi|bank)(_?(rad|deg|angle))?(_\w+)?",
    "pitch": r"(.*\.)?(pitch|theta)(_?(rad|deg|angle))?(_\w+)?",
    "az": r"(.*[._])?(az|acc_?z|accel_?z|acc_?down|linear_acceleration\.z|accelerometer_m_s2\[2\])(_\w+)?",
    "airspeed": r"(.*\.)?(true_)?(airspeed|[kect]?[tice]as)(_\w+)?",
    "time": r"(real|totl|total|sim|simulation|utc|gps|log|date|sys|system)_?time|date|datetime|clock|utc|"
    r"%?t(ime)?(_?(s|ms|us|ns|usec|stamp|boot))?\w*|(milli|micro|nano)?s(ec(ond)?s?)?|millis|micros",
}
_NOT_MEASURED_NAME_PATTERN = (
    r"innov|test_ratio|varian|timestamp|flag|valid|status|count|setpoint|_sp$|desired|demand|target|bias|"
    r"integ|error|_err$|_offset|cov(ariance)?\b|temp|noise|(_|^)(cmd|command)"
)
"""Names of what others derive from a quantity, or want of it: none of these is the quantity."""
_ANGLE_DERIVATIVE_PATTERN = r"rate|speed|accel|veloc|dot|_(deg|rad)_?s(ec)?$"
_RATE_UNIT_BY_NAME_PART = {
    "rad_s": "rad/s",
    "rad/s": "rad/s",
    "deg_s": "deg/s",
    "deg/s": "deg/s",
    "dps": "deg/s",
}
_PWM_MEDIAN_RANGE_US = (700.0, 2300.0)
_MAX_RATE_NUMBER_READ_AS_RAD_S = 12.0
_MIN_ANGLE_RATE_CORRELATION = 0.7
_MAX_PROPOSED_COMMANDS, _MAX_READ_COLUMNS = 8, 60
_PLAUSIBLE_LOG_RATE_RANGE_HZ = (4.0, 2000.0)


def check_log(path: Path, vehicle: Vehicle | None, reader_name: str | None) -> Document:
    """Return a description of a log in `lines`, and a `vehicle` for it: the one given, or a guess.

    usable: whether it could be identified or diagnosed so. Raises BadInput where it cannot be read at all.
    """
    remarks: list[str] = []
    guessed_vehicle: Document | None = None
    if vehicle is None:
        guessed_vehicle = _guess_vehicle(path, reader_name, remarks)
        if guessed_vehicle is None:
            return {"log": str(path), "usable": False, "lines": remarks, "vehicle": None}
        vehicle = Vehicle.model_validate(guessed_vehicle)
    usable_and_lines_by_part = [
        _check_recording(recording, vehicle)
        for recording in read_parts_for_vehicle(path, vehicle, reader_name)
    ]
    for part_number, (_, part_lines) in enumerate(usable_and_lines_by_part, 1):
        remarks += (
            part_lines
            if len(usable_and_lines_by_part) == 1
            else [f"part {part_number} of {len(usable_and_lines_by_part)}: {line}" for line in part_lines]
        )
    return {
        "log": str(path),
        "usable": all(is_usable for is_usable, _ in usable_and_lines_by_part),
        "lines": remarks,
        "vehicle": guessed_vehicle,
    }


def _check_recording(recording: RecordedFlight, vehicle: Vehicle) -> tuple[bool, list[str]]:
    """Whether a recording could be identified or diagnosed, and what is said of it."""
    try:
        samples = resample(recording, vehicle)
    except BadInput as error:
        return False, [str(error)]
    motionless_axes = [
        axis
        for axis, rate in zip("pqr", samples.rates.T, strict=True)
        if np.ptp(rate[np.isfinite(rate)]) == 0.0
    ]
    motionless_lines = [
        f"rate {axis} does not move: nothing can be identified or diagnosed" for axis in motionless_axes
    ]
    return not motionless_axes, [
        _log_size_text(samples),
        *samples.notes,
        *_compare_rates_and_angles(recording, vehicle),
        *motionless_lines,
    ]


def _log_size_text(samples: Samples) -> str:
    n_gaps, duration_s = int(samples.stretch_number[-1]), float(samples.t_s[-1] - samples.t_s[0])
    longest_gap_text = f", the longest of {np.diff(samples.t_s).max():.4g} s" if n_gaps else ""
    size_text = f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz over {duration_s:.4g} s"
    return f"{size_text}; gaps: {n_gaps}{longest_gap_text}"


def _compare_rates_and_angles(recording: RecordedFlight, vehicle: Vehicle) -> list[str]:
    """That rates and angles agree, or that nothing could be compared."""
    columns, attitude_quantity_columns = recording.columns, vehicle.attitude
    if attitude_quantity_columns is None or attitude_quantity_columns.roll.column not in columns:
        return ["no roll angle is named: whether the rates are in rad/s is not checked"]
    rate_columns_in_si = [_column_in_si(columns, getattr(vehicle.rates, axis)) for axis in "pqr"]
    pitch_quantity_column = attitude_quantity_columns.pitch
    pitch_column_in_si = (
        _column_in_si(columns, pitch_quantity_column)
        if pitch_quantity_column is not None and pitch_quantity_column.column in columns
        else None
    )
    roll_fit = physics.fit_roll_angle_to_rates(
        rate_columns_in_si, _column_in_si(columns, attitude_quantity_columns.roll), pitch_column_in_si
    )
    if roll_fit is None:
        return ["too little moves to compare the rates with the roll angle"]
    comparison_texts = [
        _angle_rate_fit_text(roll_fit, attitude_quantity_columns.roll.column, vehicle.rates.p.column)
    ]
    if pitch_quantity_column is not None and pitch_column_in_si is not None:
        pitch_fit = physics.fit_pitch_angle_to_rates(
            rate_columns_in_si, _column_in_si(columns, attitude_quantity_columns.roll), pitch_column_in_si
        )
        comparison_texts += (
            [_angle_rate_fit_text(pitch_fit, pitch_quantity_column.column, vehicle.rates.q.column)]
            if pitch_fit
            else []
        )
    if (
        yaw_quantity_column := attitude_quantity_columns.yaw
    ) is not None and yaw_quantity_column.column in columns:
        yaw_fit = physics.fit_yaw_angle_to_rates(
            rate_columns_in_si,
            _column_in_si(columns, attitude_quantity_columns.roll),
            pitch_column_in_si,
            _column_in_si(columns, yaw_quantity_column),
        )
        comparison_texts += (
            [_angle_rate_fit_text(yaw_fit, yaw_quantity_column.column, vehicle.rates.r.column)]
            if yaw_fit
            else []
        )
    return comparison_texts


def _angle_rate_fit_text(fit: physics.AngleRateFit, angle_column_name: str, rate_column_name: str) -> str:
    agreement_text = (
        "they agree"
        if abs(fit.correlation) > _MIN_ANGLE_RATE_CORRELATION
        else "they tell nothing of one another"
    )
    return (
        f"the change of {angle_column_name} is {fit.slope:.3f} times the integral of {rate_column_name} "
        f"(correlation {fit.correlation:.2f}): {agreement_text}"
    )


def _column_in_si(columns: Any, quantity_column: Any) -> Column:
    column: Column = columns[quantity_column.column]
    return replace(column, values=quantity_column.to_si(column.values))


def _guess_vehicle(path: Path, reader_name: str | None, remarks: list[str]) -> Document | None:
    """The keys of a vehicle file for a log, by its first part; None where rates or commands are not found."""
    check_exists(path)
    reader_name = reader_name or reader_name_for_path(path)
    time_column_and_unit = _require_time_column_and_unit(path, remarks) if reader_name == "table" else None
    recording, names_in_log, mixing = _read_columns_for_guess(path, reader_name, time_column_and_unit)
    remarks += mixing.lines
    names_with_numbers = [
        name for name, column in recording.columns.items() if np.isfinite(column.values).any()
    ]
    column_name_by_quantity = {
        quantity: _shortest_matching_column_name(
            pattern,
            [
                name
                for name in names_with_numbers
                if quantity not in ("roll", "pitch")
                or not re.search(_ANGLE_DERIVATIVE_PATTERN, _snake_case_name(name))
            ],
        )
        for quantity, pattern in _COLUMN_NAME_PATTERNS.items()
    }
    if not mixing.surfaces:
        rotors = multicopter_reason(recording.parameters, names_in_log)
        if rotors is not None:
            remarks.append(
                f"{path}: is the log of a multicopter ({rotors}), which has no surfaces, allowed: a log of "
                "an aircraft with surfaces"
            )
            return None
        _guess_surfaces(mixing, recording, names_with_numbers)
    missing_axes = [axis for axis in "pqr" if column_name_by_quantity[axis] is None]
    if missing_axes or not mixing.surfaces:
        problem = (
            f"no column looks like the rate {missing_axes[0]}, allowed: a vehicle file that names it"
            if missing_axes
            else missing_commands_text(names_in_log)
        )
        nearest_text = nearest_names_text("rate" if missing_axes else "command", names_in_log)
        remarks.append(f"{path}: {problem}; the log has {nearest_text}")
        return None
    return _propose_vehicle(
        path.stem, recording, reader_name, time_column_and_unit, column_name_by_quantity, mixing
    )


def _propose_vehicle(
    name: str,
    recording: RecordedFlight,
    reader_name: str,
    time_column_and_unit: tuple[str, str] | None,
    column_name_by_quantity: dict[str, str | None],
    mixing: Mixing,
) -> Document:
    columns = recording.columns
    roll_column = columns[column_name_by_quantity["roll"]] if column_name_by_quantity["roll"] else None
    angle_unit = (
        _guess_angle_unit(str(column_name_by_quantity["roll"]), roll_column, reader_name)
        if roll_column is not None
        else "rad"
    )
    rate_unit = _guess_rate_unit(
        recording,
        [str(column_name_by_quantity[axis]) for axis in "pqr"],
        roll_column,
        KIND_AND_SI_FACTOR_OF_UNIT[angle_unit][1],
    )
    vehicle: Document = {"name": _as_vehicle_or_surface_name(name), "reader": reader_name}
    if time_column_and_unit and time_column_and_unit != (TIME_COLUMN, "s"):
        vehicle["time"] = {"column": time_column_and_unit[0], "unit": time_column_and_unit[1]}
    vehicle["rates"] = {
        axis: _vehicle_file_column_entry(str(column_name_by_quantity[axis]), rate_unit, "rad/s")
        for axis in "pqr"
    }
    vehicle["commands"] = mixing.commands
    vehicle["surfaces"] = mixing.surfaces
    column_name_by_angle = {
        axis: column_name_by_quantity[axis] for axis in ("roll", "pitch") if column_name_by_quantity[axis]
    }
    if roll_column is not None:
        vehicle["attitude"] = {
            axis: _vehicle_file_column_entry(str(name), angle_unit, "rad")
            for axis, name in column_name_by_angle.items()
        }
    if z_acceleration_column_name := column_name_by_quantity["az"]:
        median_magnitude = float(np.nanmedian(np.abs(columns[z_acceleration_column_name].values)))
        acceleration_unit = (
            nearest_unit(ACCELERATION, KIND_AND_SI_FACTOR_OF_UNIT["g"][1] / median_magnitude, 2.0)
            if median_magnitude > 0.0
            else None
        )
        if acceleration_unit:
            vehicle["acceleration"] = _vehicle_file_column_entry(
                z_acceleration_column_name, acceleration_unit, "m/s2"
            )
    if column_name_by_quantity["airspeed"]:
        vehicle["airspeed"] = column_name_by_quantity["airspeed"]
    return vehicle


def _guess_surfaces(
    mixing: Mixing,
    recording: RecordedFlight,
    names_with_numbers: Sequence[str],
) -> None:
    """Make a surface of each column that is known to carry a command."""
    for name in command_names(names_with_numbers, recording.parameters)[:_MAX_PROPOSED_COMMANDS]:
        mixing.entry_by_column[name] = _vehicle_file_command_entry(name, recording.columns[name].values)
        mixing.surfaces[_as_vehicle_or_surface_name(name)] = {name: 1.0}


def _read_columns_for_guess(
    path: Path, reader_name: str, time_column_and_unit: tuple[str, str] | None
) -> tuple[RecordedFlight, list[str], Mixing]:
    """The columns of a log, of a long table its first part, that may be something; the names of all; the
    mixing by its parameters."""
    if reader_name in NAMES_OF_READERS_OF_WANTED_COLUMNS:
        names_and_parameters = read_flight(path, reader_name, columns=())
        all_names = list(names_and_parameters.columns)
        mixing = mixing_of_log(reader_name, names_and_parameters.parameters, all_names)
        names_to_read = [*_names_of_columns_to_read(all_names, None), *mixing.entry_by_column]
        return read_flight(path, reader_name, columns=names_to_read), all_names, mixing
    names_to_read_or_all = _names_of_columns_to_read(column_names(path)) if reader_name == "table" else None
    recording = next(read_parts(path, reader_name, time_column_and_unit, names_to_read_or_all))
    return recording, list(recording.columns), Mixing()


def _names_of_columns_to_read(names: Iterable[str], max_columns: int | None = _MAX_READ_COLUMNS) -> list[str]:
    """Columns that may be something: a log with many is not read whole."""
    pattern = "|".join(f"({quantity_pattern})" for quantity_pattern in _COLUMN_NAME_PATTERNS.values())
    names_like_quantity_or_command = [
        name for name in names if re.fullmatch(pattern, _snake_case_name(name)) or is_command_name(name)
    ]
    return names_like_quantity_or_command[:max_columns]


def _snake_case_name(column_name: str) -> str:
    """A column's name as the patterns have it: `Roll rate [deg/s]` is `roll_rate_deg_s`."""
    name_with_unit_suffix = re.sub(
        r"\s*[\[(]\s*([^\d\])][^\])]*?)\s*[\])]\s*$", r"_\1", column_name.strip().lower()
    )
    return re.sub(r"(?<=\w)_{2,}(?=\w)|[\s/,-]+_*", "_", name_with_unit_suffix).strip("_")


def _shortest_matching_column_name(pattern: str, names: Sequence[str]) -> str | None:
    """The column that fits a pattern, and its earliest alternative; the shorter name of two."""
    matching_names = [
        name
        for name in names
        if re.fullmatch(pattern, _snake_case_name(name))
        and not re.search(_NOT_MEASURED_NAME_PATTERN, _snake_case_name(name))
    ]
    return min(matching_names, key=lambda name: (len(name), name), default=None)


def _require_time_column_and_unit(path: Path, remarks: list[str]) -> tuple[str, str]:
    """The time column of a table and its unit. Raises BadInput where no column increases like time."""
    table_column_names = column_names(path)
    names_like_time = [
        name
        for name in table_column_names
        if re.fullmatch(_COLUMN_NAME_PATTERNS["time"], _snake_case_name(name))
    ]
    text_phrases: list[str] = []
    for name in sorted(names_like_time, key=lambda name: name != TIME_COLUMN):
        first_cells = first_cells_of_column(path, name)
        first_stamps = first_cells.numbers[name][np.isfinite(first_cells.numbers[name])]
        if text_phrase := text_of_column_phrase(first_cells, name):
            text_phrases.append(f"{name} holds {text_phrase.removeprefix(', but ')}")
        median_step = float(np.median(np.diff(first_stamps[:50]))) if len(first_stamps) > 1 else 0.0
        plausible_units = [
            unit
            for unit, seconds_per_unit in SECONDS_PER_TIME_UNIT.items()
            if median_step > 0.0 and _is_log_rate_plausible(1.0 / (median_step * seconds_per_unit))
        ]
        if plausible_units:
            unit = next(
                (unit for unit in plausible_units if _snake_case_name(name).endswith(unit)),
                plausible_units[0],
            )
            if (name, unit) != (TIME_COLUMN, "s"):
                remarks.append(f"time is in column {name}, its steps fit {unit}")
            return name, unit
    allowed_text = f"a table with {TIME_COLUMN} in seconds, or another time that increases"
    text_phrase = f" ({'; '.join(text_phrases)})" if text_phrases else ""
    raise BadInput(
        f"{path}: no column of time{text_phrase}, allowed: {allowed_text}; it has "
        f"{nearest_names_text(TIME_COLUMN, table_column_names)}"
    )


def _is_log_rate_plausible(rate_hz: float) -> bool:
    return _PLAUSIBLE_LOG_RATE_RANGE_HZ[0] <= rate_hz <= _PLAUSIBLE_LOG_RATE_RANGE_HZ[1]


def _guess_angle_unit(column_name: str, roll_column: Column, reader_name: str) -> str:
    """The unit of the attitude: an ArduPilot's is degrees; by its name; by its size."""
    if (
        reader_name == "ardupilot"
        or "deg" in column_name.lower()
        or _largest_magnitude(roll_column.values) > 2.0 * np.pi
    ):
        return "deg"
    return "rad"


def _guess_rate_unit(
    recording: RecordedFlight,
    rate_column_names: list[str],
    roll_column: Column | None,
    rad_per_roll_unit: float,
) -> str:
    """The unit of the rates: by the roll angle, by their name, or by their size. rad_per_roll_unit: what the
    roll angle's numbers are multiplied by."""
    logged_rate_columns = [recording.columns[name] for name in rate_column_names]
    if roll_column is not None:
        roll_fit = physics.fit_roll_angle_to_rates(
            logged_rate_columns, replace(roll_column, values=roll_column.values * rad_per_roll_unit), None
        )
        if roll_fit is not None and abs(roll_fit.correlation) > _MIN_ANGLE_RATE_CORRELATION:
            return nearest_unit(RATE, abs(roll_fit.slope), 1.5) or "rad/s"
    unit_in_name = next(
        (
            unit
            for name_part, unit in _RATE_UNIT_BY_NAME_PART.items()
            if name_part in rate_column_names[0].lower()
        ),
        None,
    )
    if unit_in_name:
        return unit_in_name
    return (
        "deg/s"
        if max(_largest_magnitude(rate.values) for rate in logged_rate_columns)
        > _MAX_RATE_NUMBER_READ_AS_RAD_S
        else "rad/s"
    )


def _largest_magnitude(values: Floats) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _vehicle_file_column_entry(column_name: str, unit: str, si_unit: str) -> Any:
    return column_name if unit == si_unit else {"column": column_name, "unit": unit}


def _vehicle_file_command_entry(column_name: str, values: Floats) -> Any:
    """A command as a share of travel: pulses of 1100 to 1900 us, per cent, or as it is."""
    median, max_magnitude = float(np.nanmedian(values)), _largest_magnitude(values)
    if _PWM_MEDIAN_RANGE_US[0] < median < _PWM_MEDIAN_RANGE_US[1]:
        return {"column": column_name, "scale": 0.0025, "offset": -3.75}
    return {"column": column_name, "unit": "%"} if 10.0 < max_magnitude <= 105.0 else column_name


def _as_vehicle_or_surface_name(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:100] or "log"


def vehicle_file_text(vehicle: Document) -> str:
    """A vehicle file's text."""
    import yaml

    header = (
        "# Proposed by `identify --check`. Check each line. Choose commands that come before any part\n"
        "# that can fail. A surface may follow several commands: `left: {roll_cmd: 0.5, pitch_cmd: -0.5}`.\n"
    )
    yaml_text = str(yaml.safe_dump(vehicle, sort_keys=False, allow_unicode=True, default_flow_style=None))
    return header + yaml_text + unused_keys_as_comments(vehicle)


def as_text(findings: Document) -> str:
    """Return the findings as lines of text."""
    usability = "can be used" if findings["usable"] else "cannot be used so"
    return "\n".join([f"{findings['log']}: {usability}", *(f"  {line}" for line in findings["lines"])])
