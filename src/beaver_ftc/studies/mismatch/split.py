"""The mismatch of a flight, frame by frame, split into its sources; a stretch of the log at a time.

Kept of it are figures (RMS, peaks, shares of the bound, exceedances), and every frame in a parquet file for
whoever wants to look closer.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import ParquetLog, column_names, read_chunks
from beaver_ftc.results.metrics import metrics
from beaver_ftc.studies.mismatch.models import (
    AXES,
    OPTIONAL,
    REQUIRED,
    Columns,
    States,
    joined,
    last_row,
    states_of,
)
from beaver_ftc.studies.mismatch.sources import SOURCES, Contributions, Models, instantaneous, integration

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

UNEXPLAINED, TOTAL, ETA_BAR, FAULT = "unexplained", "total", "eta_bar", "fault"
MAX_EXCEEDANCES = 100  # kept with their times, per axis; all are counted
CAUSES = tuple(name for name in SOURCES if name != FAULT)  # what eta_bar shall bound
NAMES = (TOTAL, *SOURCES, UNEXPLAINED, ETA_BAR)


def column(axis: str, name: str) -> str:
    """The column of one axis and source."""
    return f"{axis}_{name}_rad_s2"


COLUMNS = ("t_s", *(column(axis, name) for axis in AXES for name in NAMES))


@dataclass(frozen=True)
class Stretch:
    """n frames of a flight; all accelerations (n, 3) rad/s2 over p, q, r.

    total: JSBSim's angular acceleration over each frame less the design model's f + G u. contributions:
    what each of SOURCES adds to it. details: single faults and single coefficients, under the name of their
    source. eta_bar: the bound in force over the same frames. place (n, 3): airspeed m/s, altitude m,
    alpha rad.
    """

    t_s: np.ndarray
    total: np.ndarray
    contributions: Contributions
    details: dict[str, Contributions]
    eta_bar: np.ndarray
    place: np.ndarray

    @property
    def unexplained(self) -> np.ndarray:
        """What no source accounts for, (n, 3) rad/s2."""
        return self.total - sum(self.contributions[name] for name in SOURCES)

    @property
    def uncertainty(self) -> np.ndarray:
        """The mismatch without the faults, (n, 3) rad/s2: the eta that eta_bar shall bound."""
        return self.total - self.contributions["fault"]


class Splitter:
    """Splits the mismatch of a flight while its log comes in, chunk by chunk, in time's order.

    The acceleration over a frame needs the frame's end, so the last row of a chunk waits for the next.
    """

    def __init__(self, scenario: "Scenario") -> None:
        self._scenario = scenario
        self._models: Models | None = None
        self._held: Columns | None = None

    def feed(self, chunk: Columns) -> Iterator[Stretch]:
        """Take in log columns (name -> (n,)); yields the frames that have ended."""
        if chunk["t_s"].size == 0:
            return
        log = joined(self._held, chunk)
        self._held = last_row(log)
        states = states_of(log)
        if self._models is None:
            self._models = Models.of(self._scenario, states[:1])
        if len(states) > 1:
            yield _over_frames(self._models, states)

    def end(self) -> Iterator[Stretch]:
        """The flight has ended: yields its last row."""
        if self._held is not None and self._models is not None:
            yield _at_end(self._models, states_of(self._held))


def split(scenario: "Scenario", chunks: Iterable[Columns]) -> Iterator[Stretch]:
    """Split the mismatch of the flight whose log comes in `chunks` of columns, in time's order."""
    splitter = Splitter(scenario)
    for chunk in chunks:
        yield from splitter.feed(chunk)
    yield from splitter.end()


def _over_frames(m: Models, states: States) -> Stretch:
    """All frames but the last, which has no end here yet."""
    here, following = states[:-1], states[1:]
    contributions, details = instantaneous(m, here)
    contributions["integration"] = integration(m, here, following)
    flown = (following.x - here.x) * m.scenario.rate_hz
    return Stretch(
        here.t_s, flown - following.design_mean, contributions, details, following.eta_bar, _place(here)
    )


def _place(states: States) -> np.ndarray:
    return np.column_stack([states.y[:, 2], states.altitude_m, states.y[:, 0]])


def _at_end(m: Models, states: States) -> Stretch:
    """The flight's last row: nothing follows, so JSBSim's acceleration then stands for the frame."""
    contributions, details = instantaneous(m, states)
    contributions["integration"] = np.zeros_like(states.x)
    designed = m.belief.acceleration(states.x_measured, states.y_measured, states.u)
    return Stretch(states.t_s, states.xdot - designed, contributions, details, states.eta_bar, _place(states))


@dataclass
class Figures:
    """Of one acceleration, per axis: sum of squares, largest magnitude, largest share of the bound."""

    square_sum: np.ndarray = field(default_factory=lambda: np.zeros(3))
    largest: np.ndarray = field(default_factory=lambda: np.zeros(3))
    bound_share: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def add(self, values: np.ndarray, eta_bar: np.ndarray) -> None:
        """Take in n frames: values, eta_bar (n, 3) rad/s2."""
        size = np.abs(values)
        self.square_sum += (values**2).sum(axis=0)
        self.largest = np.maximum(self.largest, size.max(axis=0))
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(size > 0.0, size / eta_bar, 0.0)
        self.bound_share = np.maximum(self.bound_share, share.max(axis=0))


@dataclass
class Exceedance:
    """A stay of the uncertainty above its bound: when, how far in shares of the bound, where, and why."""

    start_s: float
    end_s: float
    peak_ratio: float
    peak_s: float
    airspeed_mps: float
    altitude_m: float
    alpha_rad: float
    source: str


@dataclass
class AxisBound:
    """One axis against its bound."""

    smallest_constant_rad_s2: float = 0.0
    worst_ratio: float = 0.0
    worst_at_s: float = 0.0
    exceeded_frames: int = 0
    stays: int = 0
    exceedances: list[Exceedance] = field(default_factory=list)
    outside: bool = False


@dataclass
class Tally:
    """What is kept of a flight; memory does not grow with its length.

    constant: (3,) rad/s2, the constant part of the bound in force. frame_s: length of a frame.
    """

    constant: np.ndarray
    frame_s: float
    frames: int = 0
    figures: dict[str, Figures] = field(default_factory=dict)
    details: dict[str, dict[str, Figures]] = field(default_factory=dict)
    bounds: tuple[AxisBound, AxisBound, AxisBound] = field(
        default_factory=lambda: (AxisBound(), AxisBound(), AxisBound())
    )

    def add(self, stretch: Stretch) -> None:
        """Take in a stretch."""
        self.frames += stretch.t_s.size
        whole = {TOTAL: stretch.total, **stretch.contributions, UNEXPLAINED: stretch.unexplained}
        for name, values in whole.items():
            self.figures.setdefault(name, Figures()).add(values, stretch.eta_bar)
        for source, details in stretch.details.items():
            kept = self.details.setdefault(source, {})
            for name, values in details.items():
                kept.setdefault(name, Figures()).add(values, stretch.eta_bar)
        self._hold_against_bound(stretch)

    @property
    def exceeded(self) -> bool:
        """Whether the uncertainty was above its bound on any axis."""
        return any(bound.exceeded_frames for bound in self.bounds)

    def rms(self, name: str) -> np.ndarray:
        """RMS of a source over the flight, (3,) rad/s2."""
        return np.sqrt(self.figures[name].square_sum / max(self.frames, 1))

    def _hold_against_bound(self, stretch: Stretch) -> None:
        size = np.abs(stretch.uncertainty)
        needed = (size - (stretch.eta_bar - self.constant)).max(axis=0)
        for axis, bound in enumerate(self.bounds):
            bound.smallest_constant_rad_s2 = max(bound.smallest_constant_rad_s2, float(needed[axis]))
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.where(size[:, axis] > 0.0, size[:, axis] / stretch.eta_bar[:, axis], 0.0)
            _note(bound, ratio, stretch, axis, self.frame_s)


def _note(bound: AxisBound, ratio: np.ndarray, stretch: Stretch, axis: int, frame_s: float) -> None:
    """Add the stretch's stays above the bound; one that goes on from the stretch before is carried on."""
    worst = int(ratio.argmax())
    if ratio[worst] > bound.worst_ratio:
        bound.worst_ratio, bound.worst_at_s = float(ratio[worst]), float(stretch.t_s[worst])
    above = ratio > 1.0
    bound.exceeded_frames += int(above.sum())
    for first, last in _runs(above):
        peak = first + int(ratio[first:last].argmax())
        airspeed_mps, altitude_m, alpha_rad = map(float, stretch.place[peak])
        stay = Exceedance(
            start_s=float(stretch.t_s[first]),
            end_s=float(stretch.t_s[last - 1]) + frame_s,
            peak_ratio=float(ratio[peak]),
            peak_s=float(stretch.t_s[peak]),
            airspeed_mps=airspeed_mps,
            altitude_m=altitude_m,
            alpha_rad=alpha_rad,
            source=dominant(stretch, peak, axis),
        )
        _keep(bound, stay, goes_on=first == 0 and bound.outside)
    bound.outside = bool(above[-1])


def _keep(bound: AxisBound, stay: Exceedance, goes_on: bool) -> None:
    if not goes_on:
        bound.stays += 1
        if len(bound.exceedances) < MAX_EXCEEDANCES:
            bound.exceedances.append(stay)
    elif bound.stays == len(bound.exceedances):
        last = bound.exceedances[-1]
        last.end_s = stay.end_s
        if stay.peak_ratio > last.peak_ratio:
            bound.exceedances[-1] = replace(stay, start_s=last.start_s)


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and past-the-end index of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def dominant(stretch: Stretch, frame: int, axis: int) -> str:
    """The source, faults aside, that adds most to the mismatch in one frame."""
    return max(CAUSES, key=lambda name: abs(stretch.contributions[name][frame, axis]))


def tally_for(scenario: "Scenario") -> Tally:
    """An empty tally of a scenario's flight."""
    constant = np.array(scenario.fdi.bounds.constant_rad_s2.as_tuple())
    return Tally(constant, 1.0 / scenario.rate_hz)


def written(stretches: Iterable[Stretch], path: Path) -> Iterator[Stretch]:
    """Pass the stretches on, writing each to the file at `path` on the way."""
    with ParquetLog(path) as log:
        log.open(COLUMNS)
        for stretch in stretches:
            log.write(table(stretch))
            yield stretch


def table(stretch: Stretch) -> np.ndarray:
    """The stretch as rows (n, COLUMNS)."""
    found = {
        TOTAL: stretch.total,
        **stretch.contributions,
        UNEXPLAINED: stretch.unexplained,
        ETA_BAR: stretch.eta_bar,
    }
    values = np.stack([found[name] for name in NAMES], axis=-1)  # (n, axis, name)
    return np.column_stack([stretch.t_s, values.reshape(len(values), -1)])


def tally_of_log(scenario: "Scenario", log: Path, frames: Path) -> Tally:
    """Split a log, a row group at a time; every frame goes to `frames`."""
    kept = tally_for(scenario)
    for stretch in written(split(scenario, _chunks(log)), frames):
        kept.add(stretch)
    return kept


def tally_of_flight(scenario: "Scenario") -> tuple[Tally, dict[str, Any]]:
    """Fly and split as it is flown, keeping no log: the tally and the flight's metrics."""
    sink = _SplittingSink(scenario)
    flight = fly(scenario, sink)
    return sink.tally, metrics(flight)


class _SplittingSink:
    """A log sink that splits and forgets."""

    def __init__(self, scenario: "Scenario") -> None:
        self._splitter, self.tally = Splitter(scenario), tally_for(scenario)

    def open(self, columns: Sequence[str]) -> None:
        self._columns = {name: i for i, name in enumerate(columns) if name in REQUIRED or name in OPTIONAL}

    def write(self, rows_: np.ndarray) -> None:
        self._add(self._splitter.feed({name: rows_[:, i] for name, i in self._columns.items()}))

    def close(self) -> None:
        self._add(self._splitter.end())

    def _add(self, stretches: Iterator[Stretch]) -> None:
        for stretch in stretches:
            self.tally.add(stretch)


def _chunks(log: Path) -> Iterator[Columns]:
    there = column_names(log)
    return read_chunks(log, [name for name in (*REQUIRED, *OPTIONAL) if name in there])
