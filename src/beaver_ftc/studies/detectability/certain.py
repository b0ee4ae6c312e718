"""The smallest losses that are certain to be detected and isolated along a flight.

A loss of effectiveness of surface s, of magnitude m (0 to 1), changes the innovation by -m z_s. z_s (3,)
rad/s2 is the acceleration by the surface according to the design model. An admissible uncertainty can hide
eta_bar_i of it on axis i. Another fault j, or none, is not excluded as long as the innovation is within
eta_bar_i of its prediction. At a frame,

    detection is certain where       max_i  m |z_s,i| / (2 eta_bar_i)  >  1
    j is excluded for certain where  M_sj(m)  >  1
    M_sj(m) = min_{0 <= b <= 1}  max_i  |m z_s,i - b z_j,i| / (2 eta_bar_i)

M_sj is the fault mismatch function [Zhang2002] of the sharpened scheme; it grows with m. Both conditions hold
for the test of the innovation in single frames, whatever the course of the fault. z is taken along the
healthy flight, so that the response of the loop to the fault within the window is neglected.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement, product
from math import inf

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.model import design_of, responses_at
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.isolability import largest_and_median, least_in_window, loss_limits

DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SETTLED_S = 2.0  # left out: a reference begins with a step
BISECTIONS = 16  # magnitudes are exact to 2^-16
AMPLITUDES = ("amplitude_deg_s", "values_deg_s")  # keys of a reference that are proportional to its size
MAGNITUDES = ("detected", "detected_median", "isolated", "isolated_median")
Log = Mapping[str, np.ndarray]
"""Values (n,) by column of a log, or accelerations (n, 3) rad/s2 by surface."""


@dataclass(frozen=True)
class Excitation:
    """The excitation of the surfaces along a flight of n frames.

    - moment: z of each surface in the class of losses, (n, 3) rad/s2, by its name.
    - bound: eta_bar (n, 3) rad/s2. dt: length of a frame, s.
    - G: effectiveness matrix of the first frame, (3, surfaces) rad/s2 per rad.
    """

    moment: Log
    bound: np.ndarray
    dt: float
    G: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    @property
    def windows(self) -> tuple[int, int]:
        """Numbers of frames within which a fault is to be detected, and isolated."""
        detect, isolate = (max(round(s / self.dt), 1) for s in (DETECT_WITHIN_S, ISOLATE_WITHIN_S))
        return detect, isolate

    @cached_property
    def excluding(self) -> dict[str, dict[str, np.ndarray]]:
        """By fault and other fault, the smallest magnitude (n,) for which each frame alone excludes the
        other."""
        return {
            fault: {
                other: exclusion_magnitude(z, z_other, self.bound)
                for other, z_other in self.moment.items() if other != fault
            }
            for fault, z in self.moment.items()
        }  # fmt: skip


def excitation(scenario: Scenario) -> Excitation:
    """The excitation of a scenario, flown without its faults, from SETTLED_S on.

    Raises BadInput if it cannot be trimmed, SimulationFailed if the flight cannot be completed.
    """
    log = Columns()
    fly(scenario.model_copy(update={"faults": ()}), log)
    first = int(SETTLED_S * scenario.rate_hz)
    moment, bound, G = moments_of(scenario, log)
    settled = {name: z[first:] for name, z in moment.items()}
    return Excitation(settled, bound[first:], 1.0 / scenario.rate_hz, G[first])


def moments_of(scenario: Scenario, log: Log) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """z = G u along a flight of n frames, according to the design model, with the commands u: by name of each
    surface in the class of losses, (n, 3) rad/s2. Also eta_bar (n, 3) rad/s2, and G (n, 3, surfaces) rad/s2
    per rad."""
    aircraft = scenario.airframe
    y = _side_by_side(log, "alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals)
    u = _side_by_side(log, *(f"{surface}_cmd_rad" for surface in aircraft.surfaces))
    bound = _side_by_side(log, *(f"{axis}_eta_bar_rad_s2" for axis in AXES))
    design = design_of(Declared.of(scenario))[0]
    design["linearised"] = design["frozen_alpha"] = False
    G = responses_at(design, np.zeros((len(y), 3)), y)[1]
    moment = G * u[:, None, :]
    z = {name: moment[:, :, aircraft.surfaces.index(name)] for name in aircraft.class_of_losses}
    return z, bound, G


def _side_by_side(log: Log, *names: str) -> np.ndarray:
    """These columns of a log, (n, columns)."""
    return np.column_stack([log[name] for name in names])


def detection_magnitude(z: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) that each frame alone is certain to detect: min_i 2 bound_i / |z_i|. Above 1:
    not even a total loss is detected. z, bound (n, 3) rad/s2.
    """
    with np.errstate(divide="ignore", over="ignore"):
        return np.min(2.0 * bound / np.abs(z), axis=1)


def mismatch(
    z: np.ndarray, other: np.ndarray, bound: np.ndarray, limits: tuple[float, float] = (0.0, 1.0)
) -> np.ndarray:
    """M_sj (n,) with m z_s = z and z_j = other, both (n, 3) rad/s2; limits: of b. In the code a = z / (2
    bound), b = other / (2 bound), and t is the b of the module.

    max_i |a_i - b_i t| is convex and piecewise linear in t. Its minimum is where two of +-(a_i - b_i t) are
    equal, where one of them is zero (i = j, sign -1), or at a limit. All these t are tried; a t beyond a
    limit is clipped to it.
    """
    a, b = z / (2.0 * bound), other / (2.0 * bound)
    best = np.full(len(a), np.inf)
    for (i, j), sign in product(combinations_with_replacement(range(3), 2), (1.0, -1.0)):
        with np.errstate(all="ignore"):
            corner = (a[:, i] - sign * a[:, j]) / (b[:, i] - sign * b[:, j])
        t = np.clip(np.nan_to_num(corner, nan=0.0, posinf=0.0, neginf=0.0), *limits)
        best = np.minimum(best, np.abs(a - t[:, None] * b).max(axis=1))
    return best


def exclusion_magnitude(z: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) for which each frame alone excludes the other fault, by bisection of M_sj(m) =
    1; infinite where not even a total loss does."""
    low, high = np.zeros(len(z)), np.ones(len(z))
    possible = mismatch(z, other, bound) > 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        enough = mismatch(middle[:, None] * z, other, bound) > 1.0
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.where(possible, high, np.inf)


def least_distinguished_rad(column: np.ndarray, other: np.ndarray, bound: np.ndarray) -> float:
    """The smallest deflection off its command, rad, of one surface that the rates of a frame are certain to
    distinguish from every deflection of another. column, other (3,): their columns of G, rad/s2 per rad;
    bound (3,) rad/s2. Infinite if the columns are parallel."""
    per_rad = float(mismatch(column[None], other[None], bound[None], (-inf, inf))[0])
    return 1.0 / per_rad if per_rad > 1e-9 * np.abs(column / (2.0 * bound)).max() else inf


def axis_of(scenario: Scenario, surface: str) -> str:
    """The axis on which a surface has its largest effect."""
    aircraft = scenario.airframe
    return AXES[aircraft.dominant_axis[aircraft.surfaces.index(surface)]]


def judge(flight: Excitation, fault: str) -> Document:
    """Smallest magnitudes of a fault that are certain to be detected and isolated in time along a flight.

    detected, isolated: at every instant at which it may begin. `..._median`: at half of these instants. None:
    not even a total loss. confused_with: the fault that only the largest losses exclude. why: the limit in
    words.
    """
    z = flight.moment[fault]
    detect, isolate = flight.windows
    detected = least_in_window(detection_magnitude(z, flight.bound), detect)
    excluded = {
        other: least_in_window(magnitude, isolate) for other, magnitude in flight.excluding[fault].items()
    }
    isolated = np.maximum(detected[: len(z) - isolate + 1], np.max(list(excluded.values()), axis=0))
    rival = max(excluded, key=lambda other: (excluded[other].max(), np.median(excluded[other])))
    magnitudes = (*largest_and_median(detected, 1.0), *largest_and_median(isolated, 1.0))
    return {
        **dict(zip(MAGNITUDES, magnitudes, strict=True)),
        "confused_with": rival,
        "why": _why(flight, fault, rival, detected.max(), excluded[rival], isolate),
    }


def pairs_of(flight: Excitation) -> list[Document]:
    """A row for each fault and other fault: the smallest loss that distinguishes them, and the delay."""
    return [
        {"fault": fault, "other": other, **loss_limits(magnitude, flight.windows[1], flight.dt)}
        for fault, others in flight.excluding.items()
        for other, magnitude in others.items()
    ]


def _why(
    flight: Excitation, fault: str, rival: str, detected: float, excluded: np.ndarray, frames: int
) -> str:
    """What limits the detection or isolation of this fault, in words, at the worst instant of its begin."""
    if detected > 1.0:
        share = 1.0 / detected
        return (
            f"{fault} barely moves: within {DETECT_WITHIN_S:g} s even a total loss reaches only "
            f"{100 * share:.0f} % of the detection limit"
        )
    if excluded.max() > 1.0:
        start = int(excluded.argmax())
        window = slice(start, start + frames)
        difference = mismatch(
            flight.moment[fault][window], flight.moment[rival][window], flight.bound[window]
        ).max()
        return (
            f"a fault of {rival} explains even a total loss: within {ISOLATE_WITHIN_S:g} s the difference "
            f"reaches only {100 * difference:.0f} % of the detection limit"
        )
    as_soon = excluded.max() <= detected + 2.0**-BISECTIONS
    return "isolated as soon as detected" if as_soon else f"a fault of {rival} explains smaller losses"
