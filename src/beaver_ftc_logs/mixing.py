"""Which output moves which surface, by the parameters that an autopilot's log carries.

ArduPilot: SERVOn_FUNCTION, _MIN, _MAX, _TRIM and _REVERSED of each output, MIXING_GAIN and MIXING_OFFSET of
the mixers of elevons and V-tails. PX4: type and torques of each surface (CA_SV_CSn_...), and the function,
range and direction of each output (PWM_MAIN_..., PWM_AUX_...).

A command is the autopilot's own value for a surface, from -1 to 1, in the autopilot's sense: reversal and
range of an output are undone.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs.readers import SELECTIVE_READERS
from beaver_ftc_logs.recording import Floats, Parameters, last_value
from beaver_ftc_logs.units import HALF_PULSE_RANGE_US, NEUTRAL_PULSE_US

Weights = dict[str, float]

# SERVOn_FUNCTION of a surface: its name; its share of aileron, elevator and rudder, None where the mixer of
# the autopilot is not linear; whether MIXING_GAIN and MIXING_OFFSET change it.
_ARDUPILOT_SURFACES: Mapping[int, tuple[str, tuple[float, float, float] | None, bool]] = {
    4: ("aileron", (1.0, 0.0, 0.0), False),
    16: ("left_spoiler_outer", None, False),
    17: ("right_spoiler_outer", None, False),
    19: ("elevator", (0.0, 1.0, 0.0), False),
    21: ("rudder", (0.0, 0.0, 1.0), False),
    24: ("left_flaperon", (1.0, 0.0, 0.0), False),
    25: ("right_flaperon", (1.0, 0.0, 0.0), False),
    77: ("left_elevon", (-1.0, 1.0, 0.0), True),
    78: ("right_elevon", (1.0, 1.0, 0.0), True),
    79: ("left_vtail", (0.0, 1.0, 1.0), True),
    80: ("right_vtail", (0.0, 1.0, -1.0), True),
    86: ("left_spoiler_inner", None, False),
    87: ("right_spoiler_inner", None, False),
}
_FLAPERONS = ("left_flaperon", "right_flaperon")
_ARDUPILOT_AXIS_COLUMNS = ("AETR.Ail", "AETR.Elev", "AETR.Rudd")
_ARDUPILOT_FULL_COMMAND = 4500.0
_ARDUPILOT_MESSAGES = {14: "RCOU", 18: "RCO2", 32: "RCO3"}

# CA_SV_CSn_TYPE of a surface that moves the aircraft about an axis.
_PX4_SURFACES = {
    1: "left_aileron", 2: "right_aileron", 3: "elevator", 4: "rudder", 5: "left_elevon", 6: "right_elevon",
    7: "left_vtail", 8: "right_vtail", 12: "custom", 13: "left_atail", 14: "right_atail", 15: "aileron",
}  # fmt: skip
_PX4_OUTPUT_PATTERN = r"(PWM_MAIN|PWM_AUX)_FUNC(\d{1,2})"
_MAX_TORQUE = 1000.0
_PX4_MAX_SURFACES = 8
_PX4_FIRST_SERVO = 201
_PX4_FIXED_WING = 1
_PX4_AXIS_COLUMNS = tuple(f"vehicle_torque_setpoint.xyz[{i}]" for i in range(3))

_ASSUMED_MIN_US = NEUTRAL_PULSE_US - HALF_PULSE_RANGE_US
_ASSUMED_MAX_US = NEUTRAL_PULSE_US + HALF_PULSE_RANGE_US
_PULSE_RANGE_US = {"MIN": (500.0, 2200.0), "MAX": (800.0, 2200.0), "TRIM": (800.0, 2200.0)}
_MIN_MIXING_GAIN = 0.05
_MAX_MIXING_GAIN = 5.0
_MAX_MIXING_OFFSET = 1000.0
_LEAST_WEIGHT = 1e-9


class _BadParameter(Exception):
    """A parameter is missing, or its value is not allowed; the text has the reason."""


@dataclass
class Mixing:
    """The surfaces by the parameters of a log, in the form of the vehicle file.

    entry_by_column: entry of `commands` by column; surfaces: as the key of the file; lines: remarks on what
    was found, and on what stays out.
    """

    entry_by_column: Document = field(default_factory=dict)
    surfaces: dict[str, Weights] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)

    @property
    def commands(self) -> list[Any]:
        """The entries of the columns that a surface follows."""
        used = dict.fromkeys(column for weights in self.surfaces.values() for column in weights)
        return [self.entry_by_column.get(column, column) for column in used]


@dataclass(frozen=True)
class _Surface:
    """A surface by its parameters.

    place: its channel or number; kind: surfaces of one kind get the same command; axis_shares: shares of the
    roll, pitch and yaw command, None if they are not known; reason, mixer_reason: text with the parameters.
    """

    name: str
    place: str
    kind: int
    axis_shares: Floats | None
    reason: str
    mixer_reason: str = ""

    def __str__(self) -> str:
        spoken = self.name.replace("_", " ").replace("vtail", "V-tail").replace("atail", "A-tail")
        return f"{self.place} is the {spoken}"

    def stays_out(self, reason: str) -> str:
        return f"{self} ({self.reason}), and stays out: {reason}"


# Scale and offset from the numbers of a column to the command, and a remark.
Reading = tuple[float, float, str]
# The column of each surface's output, and how it is read.
_Outputs = list[tuple[str, Reading]]


@dataclass(frozen=True)
class _Axes:
    """The columns of the roll, pitch and yaw command, and their scale. problem: reason not to use them."""

    columns: Sequence[str]
    scale: float
    problem: str = ""

    def weights(self, surface: _Surface) -> Weights:
        """The surface as a mix of these commands; empty if the mix is not known."""
        if surface.axis_shares is None:
            return {}
        return _tidy(dict(zip(self.columns, surface.axis_shares.tolist(), strict=True)))

    def problem_of(self, surface: _Surface, names: set[str]) -> str:
        """The reason why a surface cannot be a mix of these commands; empty if it can."""
        weights = self.weights(surface)
        missing = [f"{column} is not either" for column in weights if column not in names]
        return self.problem or next(iter(missing), "" if weights else "its mix is not known")


# The surfaces, the ways in which their outputs can be logged, and the commands before the mixer.
_Found = tuple[list[_Surface], list[_Outputs], _Axes]


def mixing_of_log(reader: str, params: Parameters, column_names: Collection[str]) -> Mixing:
    """The mixing by the parameters of a log, with commands from these columns. It has no surfaces if the
    parameters give none, or if the log has none of their commands."""
    mixing = Mixing()
    names = set(column_names)
    if reader not in SELECTIVE_READERS:
        return mixing
    read = _Parameters(params, mixing.lines)
    surfaces, outputs, axes = _ardupilot_mixing(read) if reader == "ardupilot" else _px4_mixing(read, names)
    if surfaces:
        # surfaces by the commands that the log has of most of them: of their outputs first, else of the axes
        fullest = max(outputs, key=lambda one: sum(column in names for column, _ in one))
        by_output = sum(column in names for column, _ in fullest)
        if by_output and by_output >= sum(not axes.problem_of(surface, names) for surface in surfaces):
            _add_surfaces_by_output(mixing, surfaces, fullest, names)
        else:
            _add_surfaces_by_axis(mixing, surfaces, axes, names)
    mixing.lines += read.lines_on_changes
    if not mixing.surfaces:
        mixing.lines.append("the parameters of the log give no mixing: it stays out")
    return mixing


@dataclass
class _Parameters:
    """Checked access to the parameters of a log. lines: receive a remark on each that stays out."""

    values_by_name: Parameters
    lines: list[str]
    lines_on_changes: list[str] = field(default_factory=list)

    def number(self, name: str, low: float, high: float, unit: str = "") -> float:
        """The last value of a parameter. Raises _BadParameter for one that is missing or out of range."""
        allowed = f"allowed: {low:g} to {high:g}{unit}"
        value = last_value(self.values_by_name, name)
        if value is None:
            raise _BadParameter(f"{name} is not in the log, {allowed}")
        if not (math.isfinite(value) and low <= value <= high):
            raise _BadParameter(f"{name} is {value:g}, {allowed}")
        line = f"{name} changes in the log: its last value, {value:g}, is used"
        if len(self.values_by_name[name]) > 1 and line not in self.lines_on_changes:
            self.lines_on_changes.append(line)
        return value

    def whole_number(self, name: str, low: int, high: int) -> int:
        value = self.number(name, low, high)
        if value != round(value):
            raise _BadParameter(f"{name} is {value:g}, allowed: a whole number")
        return round(value)

    def kinds(
        self,
        place: str,
        names: Mapping[int, str],
        known: Collection[int],
        other: str,
        unused: Collection[int],
    ) -> dict[int, int]:
        """The kind by number, of the parameters with these names. A remark is added for each unknown kind,
        except for unused ones."""
        kinds: dict[int, int] = {}
        for number, name in names.items():
            try:
                kind = self.whole_number(name, min(unused, default=0), 1000)
            except _BadParameter as problem:
                self.lines.append(f"{place} {number} stays out: {problem}")
                continue
            if kind in known:
                kinds[number] = kind
            elif kind not in unused:
                self.lines.append(f"{place} {number} stays out: {name} {kind} {other}")
        return kinds


def _full_name(name: str, number: int, kinds: Mapping[int, int]) -> str:
    """The name of a surface, with its number if there are several of its kind."""
    return name if [*kinds.values()].count(kinds[number]) == 1 else f"{name}_{number}"


def _ardupilot_mixing(params: _Parameters) -> _Found:
    """The surfaces by SERVOn_FUNCTION."""
    matches = (re.fullmatch(r"SERVO(\d{1,2})_FUNCTION", name) for name in params.values_by_name)
    names = {int(match[1]): match[0] for match in matches if match}
    if not names:
        params.lines.append("SERVOn_FUNCTION is not in the log")
    kinds = params.kinds(
        "channel", dict(sorted(names.items())), _ARDUPILOT_SURFACES, "is no surface", (-1, 0)
    )
    factors, mixer_reason = _ardupilot_mixers(params, kinds.values())
    surfaces = []
    for channel, kind in kinds.items():
        name, shares, is_mixed = _ARDUPILOT_SURFACES[kind]
        axis_shares = None if shares is None else np.array(shares)
        if is_mixed and axis_shares is not None:
            axis_shares = None if factors is None else axis_shares * factors
        full = _full_name(name, channel, kinds)
        reason = f"SERVO{channel}_FUNCTION {kind}"
        mixer = mixer_reason if is_mixed else ""
        surfaces.append(_Surface(full, f"channel {channel}", kind, axis_shares, reason, mixer))
    outputs = []
    for n in kinds:
        message = next((text for last, text in _ARDUPILOT_MESSAGES.items() if n <= last), "RCO?")
        pulses = {part: f"SERVO{n}_{part}" for part in _PULSE_RANGE_US}
        place = f"SERVO{n}_MIN, _TRIM, _MAX"
        outputs.append((f"{message}.C{n}", _pulse_reading(params, place, pulses, f"SERVO{n}_REVERSED")))
    return surfaces, [outputs], _Axes(_ARDUPILOT_AXIS_COLUMNS, 1.0 / _ARDUPILOT_FULL_COMMAND)


def _ardupilot_mixers(params: _Parameters, kinds: Collection[int]) -> tuple[Floats | None, str]:
    """The factors of the mixers on aileron, elevator and rudder, None if they are not known, and a text with
    the parameters [ArduPlane, servos.cpp: channel_function_mixer]."""
    if not any(_ARDUPILOT_SURFACES[kind][2] for kind in kinds):
        return None, ""
    try:
        gain = params.number("MIXING_GAIN", _MIN_MIXING_GAIN, _MAX_MIXING_GAIN)
        offset = params.number("MIXING_OFFSET", -_MAX_MIXING_OFFSET, _MAX_MIXING_OFFSET)
    except _BadParameter as problem:
        params.lines.append(f"the mixer of elevons and V-tail stays out: {problem}")
        return None, ""
    turning = 1.0 + max(offset, 0.0) / 100.0
    pitching = 1.0 - min(offset, 0.0) / 100.0
    factors = gain * np.array([turning, pitching, turning])
    return factors, f", MIXING_GAIN {gain:g}, MIXING_OFFSET {offset:g}"


def _pulse_reading(
    params: _Parameters, place: str, names: Mapping[str, str], reverse: str, bit: int | None = None
) -> Reading:
    """Scale and offset from a pulse, us, to the command, and a text: full travel is half of the range.

    names: of the parameters MIN, MAX and, where there is one, TRIM, else the middle is neutral; place: of
    them in a text. reverse: parameter of the direction, of several outputs if it has a bit of each [PX4,
    mixer_module.cpp].
    """
    try:
        us = {part: params.number(name, *_PULSE_RANGE_US[part], " us") for part, name in names.items()}
        low = us["MIN"]
        high = us["MAX"]
        trim = us.get("TRIM", 0.5 * (low + high))
        if not low < high or not low <= trim <= high:
            raise _BadParameter(f"{place} are {low:g}, {trim:g}, {high:g} us, allowed: ascending")
        mask = params.whole_number(reverse, 0, 1 if bit is None else 2**16 - 1)
    except _BadParameter as problem:
        scale = 1.0 / HALF_PULSE_RANGE_US
        assumed = f"{_ASSUMED_MIN_US:g} to {_ASSUMED_MAX_US:g} us"
        text = f"; range and sign stay out ({problem}), assumed: {assumed}"
        return scale, -NEUTRAL_PULSE_US * scale, text
    is_reversed = mask >> (bit or 0) & 1
    scale = (-2.0 if is_reversed else 2.0) / (high - low)
    text = f", {low:g} to {high:g} us, neutral at {trim:g} us{', reversed' if is_reversed else ''}"
    return scale, -trim * scale, text


def _px4_mixing(params: _Parameters, column_names: set[str]) -> _Found:
    """The surfaces by CA_SV_CSn_TYPE, their shares by the torques."""
    try:
        n = params.whole_number("CA_SV_CS_COUNT", 1, _PX4_MAX_SURFACES)
    except _BadParameter as problem:
        params.lines.append(str(problem))
        n = 0
    names = {i: f"CA_SV_CS{i}_TYPE" for i in range(n)}
    kinds = params.kinds("surface", names, _PX4_SURFACES, "moves the aircraft about no axis", ())
    shares = _px4_axis_shares(params, kinds)
    drivers: dict[int, list[str]] = {}
    surfaces = []
    for i, kind in kinds.items():
        if shares[i] is not None and not shares[i].any():
            params.lines.append(f"surface {i} stays out: CA_SV_CS{i}_TRQ_R, _P and _Y are 0")
            continue
        servo = _PX4_FIRST_SERVO + i
        found = [name for name, values in params.values_by_name.items() if values[-1] == servo]
        drivers[i] = [name for name in found if re.fullmatch(_PX4_OUTPUT_PATTERN, name)]
        reason = f"CA_SV_CS{i}_TYPE {kind}{''.join(f', {name} {servo}' for name in drivers[i])}"
        full = _full_name(_PX4_SURFACES[kind], i, kinds)
        surfaces.append(_Surface(full, f"surface {i}", i, shares[i], reason))
    outputs = [[(f"actuator_servos.control[{i}]", (1.0, 0.0, "")) for i in drivers]]
    if "actuator_outputs_1.output[0]" not in column_names:  # else it is unknown which of the two is MAIN
        outputs += _px4_pulses(params, [*drivers.values()])
    # of several torque setpoints, as a vehicle that can hover has, it is unknown which one is of these
    is_fixed_wing = last_value(params.values_by_name, "CA_AIRFRAME") == _PX4_FIXED_WING
    reason = "" if is_fixed_wing else "CA_AIRFRAME is not 1 (fixed wing)"
    return surfaces, outputs, _Axes(_PX4_AXIS_COLUMNS, 1.0, reason)


def _px4_axis_shares(params: _Parameters, indices: Collection[int]) -> dict[int, Any]:
    """The share of each torque command in each surface: the pseudo-inverse of the torques of all surfaces
    [PX4, ControlAllocationPseudoInverse]. None for every surface if a torque is not known."""
    try:
        torques = [
            [params.number(f"CA_SV_CS{i}_TRQ_{axis}", -_MAX_TORQUE, _MAX_TORQUE) for axis in "RPY"]
            for i in indices
        ]
    except _BadParameter as problem:
        params.lines.append(f"the mix of torques stays out: {problem}")
        return dict.fromkeys(indices)
    shares = np.linalg.pinv(np.reshape(torques, (-1, 3)).T)
    return dict(zip(indices, np.where(np.abs(shares) < _LEAST_WEIGHT, 0.0, shares), strict=True))


def _px4_pulses(params: _Parameters, drivers: Sequence[list[str]]) -> list[_Outputs]:
    """The pulses of the first output of each surface; none if a surface has no output, or if there are two
    drivers.

    drivers: of each surface the parameters that give it an output, such as PWM_MAIN_FUNC3.
    """
    matches = [re.fullmatch(_PX4_OUTPUT_PATTERN, names[0]) for names in drivers if names]
    outputs = [(match[1], int(match[2])) for match in matches if match]
    if len(outputs) < len(drivers) or len({driver for driver, _ in outputs}) != 1:
        return []
    readings = []
    for driver, n in outputs:
        names = {part: f"{driver}_{part}{n}" for part in ("MIN", "MAX")}
        reading = _pulse_reading(params, f"{driver}_MIN{n}, middle, _MAX", names, f"{driver}_REV", n - 1)
        readings.append((f"actuator_outputs.output[{n - 1}]", reading))
    return [readings]


def _add_surfaces_by_output(
    mixing: Mixing, all_surfaces: Sequence[_Surface], outputs: _Outputs, names: set[str]
) -> None:
    """Each surface follows the command of its own output.

    A command that is a combination of earlier ones is not used: its surface follows that combination, since a
    fit cannot distinguish commands that move together.
    """
    pairs = [*zip(all_surfaces, outputs, strict=True)]
    for surface, (column, _) in pairs:
        if column not in names:
            mixing.lines.append(surface.stays_out(f"{column} is not in the log"))
    used = [(surface, *output) for surface, output in pairs if output[0] in names]
    surfaces = [surface for surface, *_ in used]
    columns = [column for _, column, _ in used]
    rows = _rows_of_commands(surfaces)
    own = _weights_of_own_columns(surfaces)
    basis: list[int] = []
    for k, (surface, column, (scale, offset, text)) in enumerate(used):
        factors = np.linalg.lstsq(rows[basis].T, rows[k], rcond=None)[0] if basis else np.zeros(0)
        if basis and np.allclose(factors @ rows[basis], rows[k], atol=1e-6):
            shares = factors @ own[basis]
        else:
            basis.append(k)
            shares = own[k]
        weights = _tidy(dict(zip(columns, shares.tolist(), strict=True)))
        mixing.surfaces[surface.name] = weights
        mixing.entry_by_column[column] = _command_entry(column, scale, offset)
        shared = "" if column in weights else f"; it moves with {' and '.join(weights)}"
        mixing.lines.append(f"{surface}: {surface.reason}{text}{shared}")


def _weights_of_own_columns(surfaces: Sequence[_Surface]) -> Floats:
    """The command of each surface by itself, a row of shares of the columns. Flaps are added to one flaperon
    and taken from the other: half the sum of both is the command without flaps."""
    own = np.eye(len(surfaces))
    flaps = [k for k, surface in enumerate(surfaces) if surface.name in _FLAPERONS]
    if len(flaps) == len(_FLAPERONS):
        own[np.ix_(flaps, flaps)] = 0.5
    return own


def _rows_of_commands(surfaces: Sequence[_Surface]) -> Floats:
    """The shares of roll, pitch and yaw in each surface; if one is not known, a direction for each kind of
    surface instead."""
    known = [surface.axis_shares for surface in surfaces if surface.axis_shares is not None]
    if len(known) == len(surfaces):
        return np.array(known)
    kinds = [surface.kind for surface in surfaces]
    return np.equal.outer(kinds, [*dict.fromkeys(kinds)]).astype(float)


def _tidy(weights: Weights) -> Weights:
    kept = {column: weight for column, weight in weights.items() if abs(weight) > _LEAST_WEIGHT}
    return {column: float(f"{weight:.10g}") for column, weight in kept.items()}


def _add_surfaces_by_axis(mixing: Mixing, surfaces: Sequence[_Surface], axes: _Axes, names: set[str]) -> None:
    """Each surface is a mix of the commands of roll, pitch and yaw, in a log without commands of outputs."""
    for surface in surfaces:
        if problem := axes.problem_of(surface, names):
            mixing.lines.append(surface.stays_out(f"its output is not in the log, and {problem}"))
            continue
        weights = axes.weights(surface)
        mixing.surfaces[surface.name] = weights
        mixing.entry_by_column |= {column: _command_entry(column, axes.scale, 0.0) for column in weights}
        mix = " ".join(f"{weight:+.4g} {column}" for column, weight in weights.items())
        mixing.lines.append(f"{surface}, {mix}: {surface.reason}{surface.mixer_reason}")


def _command_entry(column: str, scale: float, offset: float) -> Any:
    if (scale, offset) == (1.0, 0.0):
        return column
    entry = {"column": column, "scale": float(f"{scale:.10g}")}
    return entry | ({"offset": float(f"{offset:.10g}")} if offset else {})
