"""The mismatch of a flight in each frame, split into its sources: RMS, peaks, shares of the bound,
exceedances."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.model import acceleration_at
from beaver_ftc.design.table import AIRSPEED, ALPHA
from beaver_ftc.documents.files import Document
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.mismatch.sources import SOURCES, Contributions, Models, instantaneous
from beaver_ftc.studies.mismatch.states import Log, Unlogged, states_of
from beaver_ftc.studies.present.tables import finite

UNEXPLAINED, TOTAL, ETA_BAR, FAULT = "unexplained", "total", "eta_bar", "fault"
MAX_EXCEEDANCES = 100  # of each axis with their times; all are counted
CAUSES = tuple(name for name in SOURCES if name != FAULT)  # the sources whose sum eta_bar must bound
NAMES = (TOTAL, *SOURCES, UNEXPLAINED, ETA_BAR)


def column(axis: str, name: str) -> str:
    """The column of one axis and source."""
    return f"{axis}_{name}_rad_s2"


COLUMNS = ("t_s", *(column(axis, name) for axis in AXES for name in NAMES))


@dataclass(frozen=True)
class Split:
    """A flight of n frames; all accelerations (n, 3) rad/s2 over p, q, r.

    - total: angular acceleration of JSBSim over each frame less f + G u of the design model.
    - contributions: part of each of SOURCES in it. details: each fault and each coefficient, by source.
    - eta_bar: the bound in the same frames. constant (3,): its constant part.
    - place (n, 3): airspeed m/s, altitude m, alpha rad. frame_s: length of a frame, s.
    """

    t_s: np.ndarray
    total: np.ndarray
    contributions: Contributions
    details: dict[str, Contributions]
    eta_bar: np.ndarray
    constant: np.ndarray
    place: np.ndarray
    frame_s: float

    @cached_property
    def named(self) -> Contributions:
        """By name: the total, its sources, and `unexplained`, the total less the sum of the sources."""
        unexplained = self.total - sum(self.contributions[name] for name in SOURCES)
        return {TOTAL: self.total, **self.contributions, UNEXPLAINED: unexplained}

    @cached_property
    def uncertainty(self) -> np.ndarray:
        """eta, the mismatch without the faults, which eta_bar must bound, (n, 3) rad/s2."""
        return self.total - self.contributions[FAULT]

    @property
    def smallest_constant(self) -> np.ndarray:
        """The smallest constant part of a bound that would have covered the flight, (3,) rad/s2: max of |eta|
        - (eta_bar - constant)."""
        return (np.abs(self.uncertainty) - (self.eta_bar - self.constant)).max(axis=0, initial=0.0)

    @cached_property
    def ratios(self) -> np.ndarray:
        """|eta| / eta_bar (n, 3)."""
        return self.shares(self.uncertainty)

    @property
    def exceeded(self) -> bool:
        """Whether |eta| was above eta_bar in any frame on any axis."""
        return bool((self.ratios > 1.0).any())

    def shares(self, values: np.ndarray) -> np.ndarray:
        """|values| / eta_bar (n, 3); 0 / 0 is 0."""
        size = np.abs(values)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(size > 0.0, size / self.eta_bar, 0.0)

    def magnitudes(self, values: np.ndarray, axis: int) -> Document:
        """RMS and largest magnitude of an acceleration on an axis, rad/s2; its RMS over that of the total, 0
        if the total is 0; and its largest share of the bound, None if the bound is 0 there."""
        rms, total_rms = (
            float(np.sqrt(np.mean(acceleration[:, axis] ** 2))) for acceleration in (values, self.total)
        )
        return {
            "rms": rms,
            "max": float(np.abs(values[:, axis]).max()),
            "share": rms / total_rms if total_rms > 0.0 else 0.0,
            "bound_share": finite(float(self.shares(values)[:, axis].max())),
        }

    def bound(self, axis: int) -> Document:
        """The mismatch of an axis compared with its bound, and the first MAX_EXCEEDANCES exceedances."""
        ratio = self.ratios[:, axis]
        stays = _runs(ratio > 1.0)
        worst = int(ratio.argmax())
        return {
            "constant_rad_s2": float(self.constant[axis]),
            "smallest_constant_rad_s2": float(self.smallest_constant[axis]),
            "worst_ratio": finite(float(ratio[worst])),
            "worst_at_s": float(self.t_s[worst]),
            "exceeded_s": int((ratio > 1.0).sum()) * self.frame_s,
            "exceeded_times": len(stays),
            "exceedances": [self._stay(ratio, axis, *stay) for stay in stays[:MAX_EXCEEDANCES]],
        }

    def _stay(self, ratio: np.ndarray, axis: int, first: int, after: int) -> Document:
        """An exceedance from frame `first` to before frame `after`: its times, its peak, and the largest
        of CAUSES at the peak. ratio (n,): |eta| / eta_bar of the axis."""
        peak = first + int(ratio[first:after].argmax())
        names = ("airspeed_mps", "altitude_m", "alpha_rad")
        return {
            "start_s": float(self.t_s[first]),
            "end_s": float(self.t_s[after - 1]) + self.frame_s,
            "peak_ratio": finite(float(ratio[peak])),
            "peak_s": float(self.t_s[peak]),
            **dict(zip(names, self.place[peak].tolist(), strict=True)),
            "source": max(CAUSES, key=lambda name: abs(self.contributions[name][peak, axis])),
        }

    def rows(self) -> np.ndarray:
        """A row for each frame, (n, COLUMNS)."""
        by_name = self.named | {ETA_BAR: self.eta_bar}
        values = np.stack([by_name[name] for name in NAMES], axis=-1)  # (n, axis, name)
        return np.column_stack([self.t_s, values.reshape(len(values), -1)])


def split(scenario: Scenario, log: Log, unlogged: Unlogged) -> Split:
    """Split the mismatch of a flight; log: its columns (n,); unlogged: what the log lacks.

    total[k] = (x[k+1] - x[k]) rate_hz - design_mean[k+1],     sampled[k] = xdot[k] - (f + G u)[k]
    integration = total - sampled,                             eta_bar[k]: the bound at row k+1

    The last row has no next one: total = sampled there, and eta_bar is the bound of the row itself.
    design_mean[k+1]: mean of f + G u over the frame that ends at row k + 1, as the diagnosis computes it.
    (f + G u)[k]: of the design model at the measured state and the command.
    """
    m = Models(scenario)
    s = states_of(log, unlogged)
    contributions, details = instantaneous(m, s)
    sampled = s.xdot - acceleration_at(m.design, s.x_measured, s.y_measured, s.u)
    over_frames = np.diff(s.x, axis=0) * scenario.rate_hz - s.design_mean[1:]
    total = np.concatenate([over_frames, sampled[-1:]])
    return Split(
        t_s=s.t_s,
        total=total,
        contributions=contributions | {"integration": total - sampled},
        details=details,
        eta_bar=np.concatenate([s.eta_bar[1:], s.eta_bar[-1:]]),
        constant=np.array(Declared.of(scenario).constant_rad_s2),
        place=np.column_stack([s.y[:, AIRSPEED], s.altitude_m, s.y[:, ALPHA]]),
        frame_s=1.0 / scenario.rate_hz,
    )


def split_flight(scenario: Scenario) -> tuple[Split, Metrics]:
    """Fly a scenario without a log file: its split, and its metrics."""
    log, unlogged = Columns(), Unlogged()
    flight = fly(scenario, log, watch=unlogged.watch)
    return split(scenario, log, unlogged), measure(flight)


def _runs(mask: np.ndarray) -> list[list[int]]:
    """First and past-the-end index of each unbroken run of True."""
    return np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2).tolist()
