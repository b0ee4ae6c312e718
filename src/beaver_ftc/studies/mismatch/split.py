"""The mismatch of a flight, frame by frame, split into its sources; a stretch of the log at a time.

Kept of it are figures (RMS, peaks, shares of the bound, exceedances), and every frame in a parquet file for
readers who want to look closer.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import Loop
from beaver_ftc.results.log import ParquetLog, column_names, read_chunks
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.mismatch.models import LOGGED, Columns, States, acceleration, states_of
from beaver_ftc.studies.mismatch.sources import SOURCES, Contributions, Models, instantaneous, integration

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
        """The part of the mismatch that no source explains, (n, 3) rad/s2."""
        return self.total - sum(self.contributions[name] for name in SOURCES)

    @property
    def named(self) -> Contributions:
        """All that adds up: the whole, its sources, and what is left, by name."""
        return {TOTAL: self.total, **self.contributions, UNEXPLAINED: self.unexplained}

    @property
    def uncertainty(self) -> np.ndarray:
        """The mismatch without the faults, (n, 3) rad/s2: the eta that eta_bar shall bound."""
        return self.total - self.contributions["fault"]


def split(scenario: Scenario, chunks: Iterable[Columns]) -> Iterator[Stretch]:
    """Split the mismatch of the flight whose log comes in `chunks` of columns (n,), in time's order.

    The acceleration over a frame needs the frame's end, so the last row of a chunk waits for the next.
    """
    models: Models | None = None
    held: Columns = {}
    for chunk in chunks:
        log = {name: np.concatenate([held.get(name, ()), values]) for name, values in chunk.items()}
        held = {name: values[-1:] for name, values in log.items()}
        states = states_of(log)
        models = models or Models(scenario)
        if states.t_s.size > 1:
            yield _over_frames(models, states)
    if models is not None:
        yield _at_end(models, states_of(held))


def _over_frames(m: Models, states: States) -> Stretch:
    """All frames but the last, which has no end here yet."""
    here, following = states[:-1], states[1:]
    total = (following.x - here.x) * m.scenario.rate_hz - following.design_mean
    return _stretch(m, here, integration(m, here, following), total, following.eta_bar)


def _at_end(m: Models, last: States) -> Stretch:
    """The flight's last row: nothing follows, so JSBSim's acceleration then stands for the frame."""
    designed = acceleration(m.design, last.x_measured, last.y_measured, last.u)
    return _stretch(m, last, np.zeros_like(last.x), last.xdot - designed, last.eta_bar)


def _stretch(m: Models, s: States, moved: np.ndarray, total: np.ndarray, eta_bar: np.ndarray) -> Stretch:
    contributions, details = instantaneous(m, s)
    place = np.column_stack([s.y[:, 2], s.altitude_m, s.y[:, 0]])
    return Stretch(s.t_s, total, contributions | {"integration": moved}, details, eta_bar, place)


class Figures:
    """Of one acceleration, per axis: sum of squares, largest magnitude, largest share of the bound."""

    def __init__(self) -> None:
        self.square_sum, self.largest, self.bound_share = np.zeros((3, 3))

    def add(self, values: np.ndarray, eta_bar: np.ndarray) -> None:
        """Take in n frames: values, eta_bar (n, 3) rad/s2."""
        self.square_sum += (values**2).sum(axis=0)
        self.largest = np.maximum(self.largest, np.abs(values).max(axis=0))
        self.bound_share = np.maximum(self.bound_share, _share(values, eta_bar).max(axis=0))


def _share(values: np.ndarray, eta_bar: np.ndarray) -> np.ndarray:
    """Of the bound, (n, 3); nothing is no share of a bound of nothing."""
    size = np.abs(values)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(size > 0.0, size / eta_bar, 0.0)


@dataclass
class AxisBound:
    """One axis against its bound; exceedances: the first stays above it, as the document has them."""

    smallest_constant_rad_s2: float = 0.0
    worst_ratio: float = 0.0
    worst_at_s: float = 0.0
    exceeded_frames: int = 0
    stays: int = 0
    exceedances: list[Document] = field(default_factory=list)
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
    bounds: tuple[AxisBound, ...] = field(default_factory=lambda: tuple(AxisBound() for _ in AXES))

    @classmethod
    def of(cls, scenario: Scenario, stretches: Iterable[Stretch]) -> "Tally":
        """The tally of a scenario's flight."""
        kept = cls(np.array(Declared.of(scenario).constant_rad_s2), 1.0 / scenario.rate_hz)
        for stretch in stretches:
            kept.add(stretch)
        return kept

    def add(self, stretch: Stretch) -> None:
        """Add the frames of a stretch to the tally."""
        self.frames += stretch.t_s.size
        for name, values in stretch.named.items():
            self.figures.setdefault(name, Figures()).add(values, stretch.eta_bar)
        for source, details in stretch.details.items():
            kept = self.details.setdefault(source, {})
            for name, values in details.items():
                kept.setdefault(name, Figures()).add(values, stretch.eta_bar)
        needed = (np.abs(stretch.uncertainty) - (stretch.eta_bar - self.constant)).max(axis=0)
        ratio = _share(stretch.uncertainty, stretch.eta_bar)
        for axis, bound in enumerate(self.bounds):
            bound.smallest_constant_rad_s2 = max(bound.smallest_constant_rad_s2, float(needed[axis]))
            _note(bound, ratio[:, axis], stretch, axis, self.frame_s)

    @property
    def exceeded(self) -> bool:
        """Whether the uncertainty was above its bound on any axis."""
        return any(bound.exceeded_frames for bound in self.bounds)

    def rms(self, name: str) -> np.ndarray:
        """RMS of a source over the flight, (3,) rad/s2."""
        return np.sqrt(self.figures[name].square_sum / max(self.frames, 1))


def _note(bound: AxisBound, ratio: np.ndarray, stretch: Stretch, axis: int, frame_s: float) -> None:
    """Add the stretch's stays above the bound; one that goes on from the stretch before is carried on."""
    worst = int(ratio.argmax())
    if ratio[worst] > bound.worst_ratio:
        bound.worst_ratio, bound.worst_at_s = float(ratio[worst]), float(stretch.t_s[worst])
    above = ratio > 1.0
    bound.exceeded_frames += int(above.sum())
    for first, last in _runs(above):
        peak = first + int(ratio[first:last].argmax())
        airspeed_mps, altitude_m, alpha_rad = stretch.place[peak].tolist()
        stay = {
            "start_s": float(stretch.t_s[first]),
            "end_s": float(stretch.t_s[last - 1]) + frame_s,
            "peak_ratio": float(ratio[peak]),
            "peak_s": float(stretch.t_s[peak]),
            "airspeed_mps": airspeed_mps,
            "altitude_m": altitude_m,
            "alpha_rad": alpha_rad,
            "source": max(CAUSES, key=lambda name: abs(stretch.contributions[name][peak, axis])),
        }
        if not (first == 0 and bound.outside):
            bound.stays += 1
            if len(bound.exceedances) < MAX_EXCEEDANCES:
                bound.exceedances.append(stay)
        elif bound.stays == len(bound.exceedances):
            before = bound.exceedances[-1]
            before["end_s"] = stay["end_s"]
            if stay["peak_ratio"] > before["peak_ratio"]:
                bound.exceedances[-1] = stay | {"start_s": before["start_s"]}
    bound.outside = bool(above[-1])


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """First and past-the-end index of each unbroken run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def tally_of_log(scenario: Scenario, log: Path, frames: Path) -> Tally:
    """Split a log, a row group at a time; every frame goes to `frames`."""
    chunks = read_chunks(log, [name for name in column_names(log) if name in LOGGED])
    return Tally.of(scenario, _written(split(scenario, chunks), frames))


def _written(stretches: Iterable[Stretch], path: Path) -> Iterator[Stretch]:
    """Pass the stretches on, writing each to the file at `path` on the way."""
    with ParquetLog(path) as log:
        log.open(COLUMNS)
        for stretch in stretches:
            found = stretch.named | {ETA_BAR: stretch.eta_bar}
            values = np.stack([found[name] for name in NAMES], axis=-1)  # (n, axis, name)
            log.write(np.column_stack([stretch.t_s, values.reshape(len(values), -1)]))
            yield stretch


def tally_of_flight(scenario: Scenario) -> tuple[Tally, Metrics]:
    """Fly and split as it is flown, keeping no log: the tally and the flight's metrics."""
    loop = Loop(scenario)
    places = [(name, place) for place, name in enumerate(loop.columns) if name in LOGGED]
    try:
        chunks = ({name: rows[:, place] for name, place in places} for rows in loop.chunks())
        return Tally.of(scenario, split(scenario, chunks)), measure(loop.land())
    finally:
        loop.release()
