"""Body rates to be flown in time (`reference:`): one class a kind, its parameters and `rate_deg_s(t_s)`.

tau = t - start_s; every signal but the table is zero before `start_s` and, but for the ramp, from `end_s` on.
A new kind is a class here and a line in `Signal`. A table comes from a CSV file: of bounded size, in the
scenario's own folder, time increasing.
"""

import csv as csv_files
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import isfinite, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import ConfigDict, ValidationInfo, model_validator

from beaver_ftc.documents.document import (
    Number,
    Section,
    deny,
    entry,
    number,
    order_conflicts,
    refuse,
)
from beaver_ftc.documents.files import UnreadableError, inside, read_text
from beaver_ftc.scenario.airframe import folder_of
from beaver_ftc.scenario.instants import LATEST_S, TIME_TOLERANCE_S

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float64]


RAD_PER_DEG = pi / 180.0
MAX_ROWS = 20_000
_MAX_BYTES = 2_000_000
_LARGEST_DEG_S = 1000.0
_FORMAT = "comma-separated text with a header line, times in column t_s, rates in deg/s"


def _amplitude() -> Any:
    return number(..., "deg/s", "amplitude", ge=-1000, le=1000, examples=[3])


def _frequency(says: str = "frequency") -> Any:
    return number(..., "Hz", says, gt=0, le=500, examples=[0.2])


def _start() -> Any:
    return number(0.0, "s", "start of the signal", ge=0, le=LATEST_S, examples=[5])


def _during(tau_s: "Samples", length_s: float | None) -> "NDArray[np.bool_]":
    """0 <= tau < length, where length None is for ever."""
    begun = tau_s >= -TIME_TOLERANCE_S
    return begun if length_s is None else begun & (tau_s < length_s - TIME_TOLERANCE_S)


class _Window(Section):
    """A signal that is zero outside [start_s, end_s)."""

    start_s: Number = _start()
    end_s: Number | None = number(
        None, "s", "end of the signal; left out: end of the flight", gt=0, examples=[20]
    )

    @model_validator(mode="after")
    def _ends_after_it_starts(self) -> Self:
        refuse(order_conflicts(self.start_s, self.end_s, "start_s"))
        return self

    @property
    def length_s(self) -> float | None:
        return None if self.end_s is None else self.end_s - self.start_s


class _Wave(_Window):
    """A signal that comes again."""

    amplitude_deg_s: Number = _amplitude()
    frequency_hz: Number = _frequency()
    phase_deg: Number = number(0.0, "deg", "phase at start_s", ge=-360, le=360, examples=[90])


class Sine(_Wave):
    """A sine: amplitude times sin(2 pi frequency tau + phase). tau is the time since start_s."""

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        tau_s = t_s - self.start_s
        wave = self.amplitude_deg_s * np.sin(
            2 * pi * self.frequency_hz * tau_s + self.phase_deg * RAD_PER_DEG
        )
        return np.where(_during(tau_s, self.length_s), wave, 0.0)


class Doublet(Section):
    """Two pulses: +amplitude for width_s, then -amplitude for width_s. The second pulse turns the aircraft
    back by the same angle."""

    amplitude_deg_s: Number = _amplitude()
    start_s: Number = _start()
    width_s: Number = number(1.0, "s", "length of each pulse", gt=0, le=LATEST_S)

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        tau_s = t_s - self.start_s
        up = _during(tau_s, self.width_s)
        down = _during(tau_s - self.width_s, self.width_s)
        return self.amplitude_deg_s * (up.astype(float) - down)


class Step(_Window):
    """A constant: the amplitude from start_s to end_s."""

    amplitude_deg_s: Number = _amplitude()

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        return np.where(_during(t_s - self.start_s, self.length_s), self.amplitude_deg_s, 0.0)


class Square(_Wave):
    """A square wave: +amplitude in the first half of each period, then -amplitude. The
    wave always has the same sign as a `sine` with the same amplitude, frequency and phase."""

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        tau_s = t_s - self.start_s
        turns = (tau_s + TIME_TOLERANCE_S) * self.frequency_hz + self.phase_deg / 360.0
        wave = np.where(turns % 1.0 < 0.5, self.amplitude_deg_s, -self.amplitude_deg_s)
        return np.where(_during(tau_s, self.length_s), wave, 0.0)


class _Closed(_Window):
    """A signal that needs both its ends."""

    end_s: Number = number(..., "s", "end of the signal", gt=0, le=LATEST_S, examples=[20])

    @property
    def length_s(self) -> float:
        return self.end_s - self.start_s


class Ramp(_Closed):
    """A straight line from 0 at start_s to the amplitude at end_s. After end_s the amplitude is held."""

    amplitude_deg_s: Number = _amplitude()

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        return self.amplitude_deg_s * np.clip((t_s - self.start_s) / self.length_s, 0.0, 1.0)


class Chirp(_Closed):
    """A sine with linearly changing frequency."""

    amplitude_deg_s: Number = _amplitude()
    start_frequency_hz: Number = _frequency("frequency at start_s")
    end_frequency_hz: Number = _frequency("frequency at end_s")

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        tau_s = t_s - self.start_s
        sweep_hz_s = (self.end_frequency_hz - self.start_frequency_hz) / self.length_s
        turns = self.start_frequency_hz * tau_s + 0.5 * sweep_hz_s * tau_s**2
        return np.where(_during(tau_s, self.length_s), self.amplitude_deg_s * np.sin(2 * pi * turns), 0.0)


class Csv(Section):
    """A table in a CSV file. Between two rows the rate is interpolated linearly. Before the first row and
    after the last row it is constant.

    The table is read when the scenario is loaded. The loaded scenario then contains the values of the table
    as `time_s` and `values_deg_s`. For this reason the scenario in a result folder needs no CSV file.

    file: CSV file in the scenario's folder or below
    column: column with the rates in deg/s
    time_s: times of the rows, usually read from the file, s
    values_deg_s: rates of the rows, usually read from the file, deg/s
    """

    model_config = ConfigDict(json_schema_extra={"required": ["file"]})

    file: str = entry(..., min_length=1, max_length=200, examples=["pilot.csv"])
    column: str = entry("rate_deg_s", min_length=1, max_length=100, examples=["q_deg_s"])
    time_s: tuple[Number, ...] = number(
        ...,
        "s",
        min_length=1,
        max_length=MAX_ROWS,
        range="rising, 0 to 360000",
        needs={"values_deg_s": [0, 2]},
        examples=[[0, 1]],
    )
    values_deg_s: tuple[Number, ...] = number(
        ...,
        "deg/s",
        min_length=1,
        max_length=MAX_ROWS,
        range="-1000 to 1000",
        needs={"time_s": [0, 1]},
        examples=[[0, 2]],
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict) or "time_s" in given or "values_deg_s" in given:
            return given
        column = given.get("column", "rate_deg_s")
        return {**given, **_read_column(given.get("file"), column, folder_of(info))}

    @model_validator(mode="after")
    def _table_is_a_time_history(self) -> Self:
        check_table(self.time_s, self.values_deg_s)
        return self

    def rate_deg_s(self, t_s: "Samples") -> "Samples":
        import numpy as np

        return np.interp(t_s, self.time_s, self.values_deg_s)


def _read_column(file: Any, column: Any, folder: Path | None) -> dict[str, list[float]]:
    """The named column of a CSV file (deg/s) against its `t_s` (s); refuses what is not a table."""
    if not isinstance(file, str) or not isinstance(column, str) or not file:
        # the schema reports `file` or `column`, and only them
        return {"time_s": [0.0], "values_deg_s": [0.0]}
    path = _inside(folder, file)
    try:
        return _parse(read_text(path, _MAX_BYTES).splitlines(), column)
    except UnreadableError as error:
        deny(f"{file!r}{f' line {error.line}' if error.line else ''}: {error}", "file")


def _inside(folder: Path | None, file: str) -> Path:
    """The file's path, resolved, if it is in the folder or below it: a scenario reads nothing else."""
    if folder is None:
        deny("there is no folder to read it from, allowed: csv in a scenario that is a file itself", "file")
    path = inside(folder, file)
    if path is None:
        deny(f"{file!r} is outside, allowed: a file in the scenario's own folder or below it", "file")
    return path


def _parse(lines: Sequence[str], column: str) -> dict[str, list[float]]:
    try:
        header = [name.strip() for name in next(csv_files.reader(lines[:1]), [])]
    except csv_files.Error as error:  # a name that is too long
        raise UnreadableError(f"{error}, allowed: {_FORMAT}", 1) from None
    for name in ("t_s", column):
        if header.count(name) != 1:
            raise UnreadableError(f"the header has no column {name!r}, allowed: {_FORMAT}", 1)
    if len(lines) - 1 > MAX_ROWS:
        raise UnreadableError(f"too many rows ({len(lines) - 1}), allowed: at most {MAX_ROWS}")
    at = header.index("t_s")
    of = header.index(column)
    rows = [_row(line, number, (at, of)) for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if not rows:
        raise UnreadableError(f"there are no rows, allowed: {_FORMAT}", 2)
    return {"time_s": [row[0] for row in rows], "values_deg_s": [row[1] for row in rows]}


def _row(line: str, number: int, columns: tuple[int, int]) -> tuple[float, float]:
    cells = line.split(",")
    try:
        at = float(cells[columns[0]])
        of = float(cells[columns[1]])
    except (ValueError, IndexError):
        raise UnreadableError(f"{line[:40]!r} is not a row of numbers, allowed: {_FORMAT}", number) from None
    if not (isfinite(at) and isfinite(of)):
        raise UnreadableError(f"{line[:40]!r} is not finite, allowed: finite numbers", number)
    return at, of


def check_table(time_s: Sequence[float], values_deg_s: Sequence[float]) -> None:
    """Refuse columns of different length, times that do not increase, values that no aircraft flies."""
    if len(time_s) != len(values_deg_s):
        deny(f"{len(time_s)} times but {len(values_deg_s)} values, allowed: as many of each")
    if not all(a < b for a, b in pairwise(time_s)) or time_s[0] < 0 or time_s[-1] > LATEST_S:
        deny(f"times do not increase from 0, allowed: strictly increasing, 0 to {LATEST_S:g} s")
    if max(map(abs, values_deg_s)) > _LARGEST_DEG_S:
        deny(f"rates out of range, allowed: -{_LARGEST_DEG_S:g} to {_LARGEST_DEG_S:g} deg/s")


class Signal(Section):
    """One signal. The section has exactly one of these keys. The key is the kind of the signal."""

    model_config = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})

    sine: Sine | None = entry(None, "amplitude sin(2 pi frequency tau + phase), tau: time since start_s")
    doublet: Doublet | None = entry(None, "+amplitude for width_s, then -amplitude for width_s")
    step: Step | None = entry(None, "amplitude from start_s to end_s")
    square: Square | None = entry(None, "+amplitude in the first half of each period, then -amplitude")
    ramp: Ramp | None = entry(None, "line from 0 at start_s to amplitude at end_s, then constant")
    chirp: Chirp | None = entry(None, "sine with linearly changing frequency")
    csv: Csv | None = entry(
        None, "table in a CSV file, interpolated, constant before its first and after its last row"
    )

    @model_validator(mode="after")
    def _exactly_one_kind(self) -> Self:
        given = sum(shape is not None for _, shape in self)
        if given != 1:
            allowed = ", ".join(type(self).model_fields)
            deny(f"{given} kinds in one list item, allowed: exactly one of {allowed}")
        return self

    @property
    def shape(self) -> Sine | Doublet | Step | Square | Ramp | Chirp | Csv:
        """The parameters of the one kind given."""
        return next(shape for _, shape in self if shape is not None)


Signals = tuple[Signal, ...]


class Reference(Section):
    """Commanded body rates. The signals of an axis are added."""

    p: Signals = entry(
        (),
        "roll rate",
        max_length=50,
        examples=[[{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.2}}]],
    )
    q: Signals = entry((), "pitch rate", max_length=50)
    r: Signals = entry((), "yaw rate", max_length=50)


def sample(reference: Reference, t_s: "Samples") -> "Samples":
    """The commanded body rates at the given times.

    Shapes: t_s (n,) -> (n, 3), columns p, q, r. Units: s -> rad/s.
    """
    return sample_deg_s(reference, t_s) * RAD_PER_DEG


@lru_cache(maxsize=4)  # flights of a sweep fly the same, as a rule
def sample_frames(reference: Reference, first: int, frames: int, rate_hz: float) -> "Samples":
    """The commanded body rates of so many frames from one on, (frames, 3) rad/s, not to be changed."""
    import numpy as np

    sampled = sample(reference, np.arange(first, first + frames) / rate_hz)
    sampled.flags.writeable = False
    return sampled


def sample_deg_s(reference: Reference, t_s: "Samples") -> "Samples":
    """The same in deg/s, as the file has them."""
    import numpy as np

    t_s = np.asarray(t_s, dtype=float)
    still = np.zeros_like(t_s)
    axes = [sum((item.shape.rate_deg_s(t_s) for item in axis), still) for _, axis in reference]
    return np.column_stack(axes)
