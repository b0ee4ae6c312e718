"""The figures of a split flight, kept while it is read: RMS, peaks, shares of the bound, exceedances."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import UNEXPLAINED, Stretch

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

TOTAL = "total"
MAX_EXCEEDANCES = 100  # kept with their times, per axis; all are counted


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
    parts: dict[str, dict[str, Figures]] = field(default_factory=dict)
    bounds: tuple[AxisBound, AxisBound, AxisBound] = field(
        default_factory=lambda: (AxisBound(), AxisBound(), AxisBound())
    )

    def add(self, stretch: Stretch) -> None:
        """Take in a stretch."""
        self.frames += stretch.t_s.size
        whole = {TOTAL: stretch.total, **stretch.contributions, UNEXPLAINED: stretch.unexplained}
        for name, values in whole.items():
            self.figures.setdefault(name, Figures()).add(values, stretch.eta_bar)
        for source, parts in stretch.parts.items():
            kept = self.parts.setdefault(source, {})
            for name, values in parts.items():
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
    names = [name for name in SOURCES if name != "fault"]
    return max(names, key=lambda name: abs(stretch.contributions[name][frame, axis]))


def tally_for(scenario: "Scenario") -> Tally:
    """An empty tally of a scenario's flight."""
    constant = np.array(scenario.fdi.bounds.constant_rad_s2.as_tuple())
    return Tally(constant, 1.0 / scenario.rate_hz)
