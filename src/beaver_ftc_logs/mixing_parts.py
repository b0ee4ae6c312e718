"""Parts of a mixing: surfaces, their outputs, the commands of the axes; and checked access to parameters.

A pulse, us, is the width of the signal to a servo. A share is a factor, -1 to 1, on a command of an axis.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from beaver_ftc_logs.recording import Floats, Parameters, last_value
from beaver_ftc_logs.units import HALF_PULSE_RANGE_US, NEUTRAL_PULSE_US

# Column of the log -> its share in a surface.
Weights = dict[str, float]
# The assumed range of an output whose parameters are unknown, us.
_ASSUMED_MIN_US = NEUTRAL_PULSE_US - HALF_PULSE_RANGE_US
_ASSUMED_MAX_US = NEUTRAL_PULSE_US + HALF_PULSE_RANGE_US
# Least and greatest allowed value of the parameters MIN, MAX and TRIM of an output, us.
PULSE_RANGE_US = {"MIN": (500.0, 2200.0), "MAX": (800.0, 2200.0), "TRIM": (800.0, 2200.0)}
LEAST_WEIGHT = 1e-9  # a smaller magnitude of a share is rounding


class BadParameterError(Exception):
    """A parameter is missing, or its value is not allowed; the text has the reason."""


@dataclass(frozen=True)
class Surface:
    """A surface by its parameters.

    place: words for its channel or number. kind: surfaces of the same kind get the same command. axis_shares
    (3,): shares of the roll, pitch and yaw command, None if they are unknown. reason, mixer_reason: text with
    the parameters that give surface and shares.
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
        """The remark that the surface is left out."""
        return f"{self} ({self.reason}), and stays out: {reason}"


# Scale and offset, command = scale x number of the column + offset; and a remark.
Reading = tuple[float, float, str]
# For each surface the column of its output, and the reading of this column.
Outputs = list[tuple[str, Reading]]


@dataclass(frozen=True)
class Axes:
    """The columns of the roll, pitch and yaw command, and their scale. problem: reason why they cannot be
    used."""

    columns: Sequence[str]
    scale: float
    problem: str = ""

    def weights(self, surface: Surface) -> Weights:
        """The surface as a mix of these commands; empty if the mix is not known."""
        if surface.axis_shares is None:
            return {}
        return tidy(dict(zip(self.columns, surface.axis_shares.tolist(), strict=True)))

    def problem_of(self, surface: Surface, names: set[str]) -> str:
        """The reason why a surface cannot be a mix of these commands; empty if it can."""
        weights = self.weights(surface)
        missing = [f"{column} is not either" for column in weights if column not in names]
        return self.problem or next(iter(missing), "" if weights else "its mix is not known")


# The surfaces; the ways in which their outputs can be logged, each with an entry a surface; and the commands
# of the axes, before the mixer.
MixingParts = tuple[list[Surface], list[Outputs], Axes]


@dataclass
class CheckedParameters:
    """Checked access to the parameters of a log. lines: receive a remark on each part that is left out."""

    values_by_name: Parameters
    lines: list[str]
    lines_on_changes: list[str] = field(default_factory=list)

    def number(self, name: str, low: float, high: float, unit: str = "") -> float:
        """The last value of a parameter. Raises BadParameterError if it is missing or out of range. If the
        value changes in the log, a remark is added once.
        """
        allowed = f"allowed: {low:g} to {high:g}{unit}"
        value = last_value(self.values_by_name, name)
        if value is None:
            raise BadParameterError(f"{name} is not in the log, {allowed}")
        if not (math.isfinite(value) and low <= value <= high):
            raise BadParameterError(f"{name} is {value:g}, {allowed}")
        line = f"{name} changes in the log: its last value, {value:g}, is used"
        if len(self.values_by_name[name]) > 1 and line not in self.lines_on_changes:
            self.lines_on_changes.append(line)
        return value

    def whole_number(self, name: str, low: int, high: int) -> int:
        """As `number`, for a parameter that must be a whole number."""
        value = self.number(name, low, high)
        if value != round(value):
            raise BadParameterError(f"{name} is {value:g}, allowed: a whole number")
        return round(value)

    def kinds(
        self,
        place: str,
        names: Mapping[int, str],
        known: Collection[int],
        unknown_text: str,
        unused: Collection[int],
    ) -> dict[int, int]:
        """Number -> kind, the value of the parameter with this name (names: number -> name). Only known kinds
        are returned; for another one a remark with the words `unknown_text` is added, except for the unused
        ones. place: word for the number.
        """
        kinds: dict[int, int] = {}
        for number, name in names.items():
            try:
                kind = self.whole_number(name, min(unused, default=0), 1000)
            except BadParameterError as problem:
                self.lines.append(f"{place} {number} stays out: {problem}")
                continue
            if kind in known:
                kinds[number] = kind
            elif kind not in unused:
                self.lines.append(f"{place} {number} stays out: {name} {kind} {unknown_text}")
        return kinds


def full_name(name: str, number: int, kinds: Mapping[int, int]) -> str:
    """The name of a surface, with its number if several surfaces have its kind."""
    return name if [*kinds.values()].count(kinds[number]) == 1 else f"{name}_{number}"


def pulse_reading(
    params: CheckedParameters, place: str, names: Mapping[str, str], reverse: str, bit: int | None = None
) -> Reading:
    """The reading of a pulse, us, as a command in which full travel is half of the range of the pulse:

        command = (pulse - trim) 2 / (max - min),    negative if the output is reversed

    names: MIN, MAX and perhaps TRIM -> name of the parameter; without TRIM it is the middle. place: words for
    these. reverse: parameter of the direction; of several outputs, if it has a bit for each [PX4,
    mixer_module.cpp]. Without valid parameters the usual range is assumed.
    """
    try:
        us = {part: params.number(name, *PULSE_RANGE_US[part], " us") for part, name in names.items()}
        low = us["MIN"]
        high = us["MAX"]
        trim = us.get("TRIM", 0.5 * (low + high))
        if not low < high or not low <= trim <= high:
            raise BadParameterError(f"{place} are {low:g}, {trim:g}, {high:g} us, allowed: ascending")
        mask = params.whole_number(reverse, 0, 1 if bit is None else 2**16 - 1)
    except BadParameterError as problem:
        scale = 1.0 / HALF_PULSE_RANGE_US
        assumed = f"{_ASSUMED_MIN_US:g} to {_ASSUMED_MAX_US:g} us"
        text = f"; range and sign stay out ({problem}), assumed: {assumed}"
        return scale, -NEUTRAL_PULSE_US * scale, text
    is_reversed = mask >> (bit or 0) & 1
    scale = (-2.0 if is_reversed else 2.0) / (high - low)
    text = f", {low:g} to {high:g} us, neutral at {trim:g} us{', reversed' if is_reversed else ''}"
    return scale, -trim * scale, text


def tidy(weights: Weights) -> Weights:
    """The weights without those that are rounding, each to ten digits."""
    kept = {column: weight for column, weight in weights.items() if abs(weight) > LEAST_WEIGHT}
    return {column: float(f"{weight:.10g}") for column, weight in kept.items()}
