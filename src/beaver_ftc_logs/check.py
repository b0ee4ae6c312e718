"""What a log is, before anything is fitted: columns, units, gaps, dead signals, and a vehicle file for it.

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
from beaver_ftc_logs.readers import check_exists, evident, read_parts
from beaver_ftc_logs.readers.table import TIME, first_of, names_of
from beaver_ftc_logs.recording import Column, Floats, Recording, nearest_ten
from beaver_ftc_logs.samples import Samples, parts_for, sample
from beaver_ftc_logs.units import ACCELERATION, RATE, SECONDS, UNITS, nearest_unit
from beaver_ftc_logs.vehicle import Vehicle, further_keys


def _rate(name: str, angle: str, axis: str, index: int) -> str:
    """What columns of a body rate are called: ours, by its angle, by its axis, by its place in a vector."""
    return "|".join((
        f"{name}_rad_s", name, rf"(.*\.)?{angle}_?(rate|speed)\w*", rf".*gyr(o|_)?_?{axis}\w*",
        rf".*gyro_rad\[{index}\]", f"w{axis}", f"omega_?{axis}", rf"rate\.{angle[0]}",
        rf".*velocity\.({axis}|xyz\[{index}\])",
    ))  # fmt: skip


_NAMES = {
    "p": _rate("p", "roll", "x", 0),
    "q": _rate("q", "pitch", "y", 1),
    "r": _rate("r", "yaw", "z", 2),
    "roll": r"(.*\.)?(roll|phi|bank)(_?(rad|deg|angle))?(_\w+)?",
    "pitch": r"(.*\.)?(pitch|theta)(_?(rad|deg|angle))?(_\w+)?",
    "az": r"(.*[._])?(az|acc_?z|accel_?z|acc_?down|linear_acceleration\.z|accelerometer_m_s2\[2\])(_\w+)?",
    "airspeed": r"(.*\.)?(true_)?(airspeed|[kect]?[tice]as)(_\w+)?",
    "time": r"%?t(ime)?(_?(s|ms|us|ns|usec|stamp|boot))?\w*|(milli|micro|nano)?s(ec(ond)?s?)?|millis|micros",
}
_COMMAND = (
    r"^d(elta_?)?[aer]$|cmd|command|control\[|setpoint|_sp$|^srfc|^rcou|servo|actuator|"
    r"aileron|elevator|rudder|elevon"
)
_NO_COMMAND = r"truth|effectiveness|position|_pos|feedback|measured|error|failure"
_HINTS = {"rad_s": "rad/s", "rad/s": "rad/s", "deg_s": "deg/s", "deg/s": "deg/s", "dps": "deg/s"}
_PWM = (700.0, 2300.0)
_FAST_RAD_S = 12.0
_AGREE = 0.7
_MAX_COMMANDS, _MAX_COLUMNS = 8, 60
_RATE_HZ = (4.0, 2000.0)


def check(path: Path, vehicle: Vehicle | None, reader: str | None) -> Document:
    """What a log is, in `lines`, and a `vehicle` for it: the one given, or a guess.

    usable: whether it could be identified or diagnosed so. Raises BadInput where it cannot be read at all.
    """
    lines: list[str] = []
    guess: Document | None = None
    if vehicle is None:
        guess = _guessed(path, reader, lines)
        if guess is None:
            return {"log": str(path), "usable": False, "lines": lines, "vehicle": None}
        vehicle = Vehicle.model_validate(guess)
    found = [_looked_at(recording, vehicle) for recording in parts_for(path, vehicle, reader)]
    for number, (_, of) in enumerate(found, 1):
        lines += of if len(found) == 1 else [f"part {number} of {len(found)}: {line}" for line in of]
    return {"log": str(path), "usable": all(fine for fine, _ in found), "lines": lines, "vehicle": guess}


def _looked_at(recording: Recording, vehicle: Vehicle) -> tuple[bool, list[str]]:
    """Whether a recording could be identified or diagnosed, and what is said of it."""
    try:
        samples = sample(recording, vehicle)
    except BadInput as error:
        return False, [str(error)]
    dead = [
        axis for axis, of in zip("pqr", samples.rates.T, strict=True) if np.ptp(of[np.isfinite(of)]) == 0.0
    ]
    said = [f"rate {axis} does not move: nothing can be identified or diagnosed" for axis in dead]
    return not dead, [_size(samples), *samples.notes, *_physics(recording, vehicle), *said]


def _size(samples: Samples) -> str:
    gaps, span_s = int(samples.run[-1]), float(samples.t_s[-1] - samples.t_s[0])
    lengths_s = f", the longest of {np.diff(samples.t_s).max():.4g} s" if gaps else ""
    many = f"{len(samples.t_s)} samples at {1.0 / samples.dt_s:.3g} Hz over {span_s:.4g} s"
    return f"{many}; gaps: {gaps}{lengths_s}"


def _physics(recording: Recording, vehicle: Vehicle) -> list[str]:
    """That rates and angles agree, or that nothing could be compared."""
    columns, attitude = recording.columns, vehicle.attitude
    if attitude is None or attitude.roll.column not in columns:
        return ["no roll angle is named: whether the rates are in rad/s is not checked"]
    rates = [_si(columns, getattr(vehicle.rates, axis)) for axis in "pqr"]
    pitch = attitude.pitch
    known = _si(columns, pitch) if pitch is not None and pitch.column in columns else None
    found = physics.roll_of(rates, _si(columns, attitude.roll), known)
    if found is None:
        return ["too little moves to compare the rates with the roll angle"]
    lines = [_agreement(found, attitude.roll.column, vehicle.rates.p.column)]
    if pitch is not None and known is not None:
        pitching = physics.pitch_of(rates, _si(columns, attitude.roll), known)
        lines += [_agreement(pitching, pitch.column, vehicle.rates.q.column)] if pitching else []
    if (yaw := attitude.yaw) is not None and yaw.column in columns:
        yawing = physics.yaw_of(rates, _si(columns, attitude.roll), known, _si(columns, yaw))
        lines += [_agreement(yawing, yaw.column, vehicle.rates.r.column)] if yawing else []
    return lines


def _agreement(found: physics.Followed, angle: str, rate: str) -> str:
    agree = "they agree" if abs(found.correlation) > _AGREE else "they tell nothing of one another"
    return (
        f"the change of {angle} is {found.slope:.3f} times the integral of {rate} "
        f"(correlation {found.correlation:.2f}): {agree}"
    )


def _si(columns: Any, quantity: Any) -> Column:
    column: Column = columns[quantity.column]
    return replace(column, values=quantity.si(column.values))


def _guessed(path: Path, reader: str | None, lines: list[str]) -> Document | None:
    """The keys of a vehicle file for a log, by its first part; None where rates or commands are not found."""
    check_exists(path)
    kind = reader or evident(path)
    time = _time(path, lines) if kind == "table" else None
    wanted = _candidates(names_of(path)) if kind == "table" else None
    recording = next(read_parts(path, kind, time, wanted))
    names = [name for name, one in recording.columns.items() if np.isfinite(one.values).any()]
    found = {what: _first(pattern, names) for what, pattern in _NAMES.items()}
    commands = _commands(names, found)
    missing = [axis for axis in "pqr" if found[axis] is None]
    if missing or not commands:
        what = f"no column looks like the rate {missing[0]}" if missing else "no column looks like a command"
        near = nearest_ten("rate" if missing else "command", recording.columns)
        lines.append(f"{path}: {what}, allowed: a vehicle file that names it; the log has {near}")
        return None
    return _proposed(path.stem, recording, kind, time, found, commands)


def _proposed(
    name: str,
    recording: Recording,
    kind: str,
    time: tuple[str, str] | None,
    found: dict[str, str | None],
    commands: list[str],
) -> Document:
    columns = recording.columns
    roll = columns[found["roll"]] if found["roll"] else None
    turned = _angle_unit(str(found["roll"]), roll, kind) if roll is not None else "rad"
    unit = _rate_unit(recording, [str(found[axis]) for axis in "pqr"], roll, UNITS[turned][1])
    vehicle: Document = {"name": _plain(name), "reader": kind}
    if time and time != (TIME, "s"):
        vehicle["time"] = {"column": time[0], "unit": time[1]}
    vehicle["rates"] = {axis: _column(str(found[axis]), unit, "rad/s") for axis in "pqr"}
    vehicle["commands"] = [_command(name, columns[name].values) for name in commands]
    vehicle["surfaces"] = {_plain(name): {name: 1.0} for name in commands}
    angles = {axis: found[axis] for axis in ("roll", "pitch") if found[axis]}
    if roll is not None:
        vehicle["attitude"] = {axis: _column(str(name), turned, "rad") for axis, name in angles.items()}
    if down := found["az"]:
        size = float(np.nanmedian(np.abs(columns[down].values)))
        fits = nearest_unit(ACCELERATION, UNITS["g"][1] / size, 2.0) if size > 0.0 else None
        if fits:
            vehicle["acceleration"] = _column(down, fits, "m/s2")
    if found["airspeed"]:
        vehicle["airspeed"] = found["airspeed"]
    return vehicle


def _candidates(names: Iterable[str]) -> list[str]:
    """Columns of a table that may be something: a wide one is not read whole."""
    pattern = "|".join(f"({one})" for one in _NAMES.values())
    known = [name for name in names if re.fullmatch(pattern, _spelled(name)) or _may_command(name)]
    return known[:_MAX_COLUMNS]


def _may_command(name: str) -> bool:
    return bool(re.search(_COMMAND, name.lower()) and not re.search(_NO_COMMAND, name.lower()))


def _spelled(name: str) -> str:
    """A column's name as the patterns have it: `Roll rate [deg/s]` is `roll_rate_deg_s`."""
    with_unit = re.sub(r"\s*[\[(]\s*([^\d\])][^\])]*?)\s*[\])]\s*$", r"_\1", name.strip().lower())
    return re.sub(r"[\s/]+", "_", with_unit)


def _first(pattern: str, names: Sequence[str]) -> str | None:
    """The column that fits a pattern, and its earliest alternative; the shorter name of two."""
    fits = [name for name in names if re.fullmatch(pattern, _spelled(name)) and not _may_command(name)]
    return min(fits, key=lambda name: (len(name), name), default=None)


def _commands(names: Sequence[str], found: dict[str, str | None]) -> list[str]:
    taken = set(found.values())
    return [name for name in names if _may_command(name) and name not in taken][:_MAX_COMMANDS]


def _time(path: Path, lines: list[str]) -> tuple[str, str]:
    """The time column of a table and its unit. Raises BadInput where no column increases like time."""
    names = names_of(path)
    tried = [name for name in names if re.fullmatch(_NAMES["time"], _spelled(name))]
    for name in sorted(tried, key=lambda name: name != TIME):
        values = first_of(path, name)
        step = float(np.median(np.diff(values[np.isfinite(values)][:50]))) if len(values) > 1 else 0.0
        units = [unit for unit, size in SECONDS.items() if step > 0.0 and _fits(1.0 / (step * size))]
        if units:
            unit = next((one for one in units if _spelled(name).endswith(one)), units[0])
            if (name, unit) != (TIME, "s"):
                lines.append(f"time is in column {name}, its steps fit {unit}")
            return name, unit
    says = (
        f"a table with {TIME} in seconds, or another time that increases; it has {nearest_ten(TIME, names)}"
    )
    raise BadInput(f"{path}: no column of time, allowed: {says}")


def _fits(rate_hz: float) -> bool:
    return _RATE_HZ[0] <= rate_hz <= _RATE_HZ[1]


def _angle_unit(name: str, roll: Column, kind: str) -> str:
    """The unit of the attitude: an ArduPilot's is degrees; by its name; by its size."""
    if kind == "ardupilot" or "deg" in name.lower() or _largest(roll.values) > 2.0 * np.pi:
        return "deg"
    return "rad"


def _rate_unit(recording: Recording, names: list[str], roll: Column | None, rad: float) -> str:
    """The unit of the rates: by the roll angle, by their name, or by their size. rad: what the roll
    angle's numbers are multiplied by."""
    rates = [recording.columns[name] for name in names]
    if roll is not None:
        found = physics.roll_of(rates, replace(roll, values=roll.values * rad), None)
        if found is not None and abs(found.correlation) > _AGREE:
            return nearest_unit(RATE, abs(found.slope), 1.5) or "rad/s"
    hint = next((unit for text, unit in _HINTS.items() if text in names[0].lower()), None)
    if hint:
        return hint
    return "deg/s" if max(_largest(rate.values) for rate in rates) > _FAST_RAD_S else "rad/s"


def _largest(values: Floats) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _column(name: str, unit: str, si: str) -> Any:
    return name if unit == si else {"column": name, "unit": unit}


def _command(name: str, values: Floats) -> Any:
    """A command as a share of travel: pulses of 1100 to 1900 us, per cent, or as it is."""
    middle, largest = float(np.nanmedian(values)), _largest(values)
    if _PWM[0] < middle < _PWM[1]:
        return {"column": name, "scale": 0.0025, "offset": -3.75}
    return {"column": name, "unit": "%"} if 10.0 < largest <= 105.0 else name


def _plain(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:100] or "log"


def as_yaml(vehicle: Document) -> str:
    """A vehicle file's text."""
    import yaml

    head = (
        "# Guessed from a log by `identify --check`. Look at it: commands must stand upstream of what can\n"
    )
    head += "# fail, and a surface may answer several of them, `left: {roll_cmd: 0.5, pitch_cmd: -0.5}`.\n"
    told = str(yaml.safe_dump(vehicle, sort_keys=False, allow_unicode=True, default_flow_style=None))
    return head + told + further_keys(vehicle)


def as_text(checked: Document) -> str:
    """What was found, in lines for people."""
    state = "can be used" if checked["usable"] else "cannot be used so"
    return "\n".join([f"{checked['log']}: {state}", *(f"  {line}" for line in checked["lines"])])
