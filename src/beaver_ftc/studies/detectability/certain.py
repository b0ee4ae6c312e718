"""How small a loss is certain to be found along a flight, and what it can be taken for.

A loss of effectiveness of surface s, of magnitude m, changes the innovation by -m z_s; z_s (3,) rad/s2 is the
moment of the surface by the design model. An admissible uncertainty can hide eta_bar_i of it on axis i, and
another fault j, or none, survives as long as the rest is within eta_bar_i of what it predicts. At a frame,

    detection is certain where       max_i  m |z_s,i| / (2 eta_bar_i)  >  1
    j is excluded for certain where  M_sj(m)  >  1
    M_sj(m) = min_{0 <= b <= 1}  max_i  |m z_s,i - b z_j,i| / (2 eta_bar_i)

M_sj is the fault mismatch function [Zhang2002] of the sharpened scheme; it grows with m. Both hold for the
frame-by-frame test of the innovation, whatever the fault's course; z is taken along the healthy flight, so
the loop's answer to the fault within the window is neglected.
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
from beaver_ftc.studies.detectability.isolability import best_in_window, largest_and_median, loss_limits

DETECT_WITHIN_S, ISOLATE_WITHIN_S = 0.5, 1.0
SETTLED_S = 2.0  # the start of a reference is a step of its own
BISECTIONS = 16  # magnitudes to 2^-16
AMPLITUDES = ("amplitude_deg_s", "values_deg_s")  # parameters of a reference
MAGNITUDES = ("detected", "detected_median", "isolated", "isolated_median")
Log = Mapping[str, np.ndarray]
"""Values (n,) by column, or (n, 3) rad/s2 by surface."""


@dataclass(frozen=True)
class Excitation:
    """Along a flight of n frames: the moment of each surface that leads an axis, (n, 3) rad/s2 by its name,
    the bound on the uncertainty (n, 3) rad/s2, and the length of a frame dt s. G: as it begins, (3, surfaces)
    rad/s2 per rad.
    """

    moment: Log
    bound: np.ndarray
    dt: float
    G: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    @property
    def windows(self) -> tuple[int, int]:
        """The frames in which a fault is to be detected, and isolated."""
        detect, isolate = (max(round(s / self.dt), 1) for s in (DETECT_WITHIN_S, ISOLATE_WITHIN_S))
        return detect, isolate

    @cached_property
    def excluding(self) -> dict[str, dict[str, np.ndarray]]:
        """By fault and other fault, the least magnitude (n,) from which each frame excludes the other."""
        return {
            fault: {
                other: exclusion_magnitude(z, of, self.bound)
                for other, of in self.moment.items() if other != fault
            }
            for fault, z in self.moment.items()
        }  # fmt: skip


def excitation(scenario: Scenario) -> Excitation:
    """Fly the scenario without its faults and weigh what the surfaces did with the design model.

    Raises BadInput when it cannot be trimmed, SimulationFailed when the flight ends before it has settled.
    """
    log = Columns()
    fly(scenario.model_copy(update={"faults": ()}), log)
    first = int(SETTLED_S * scenario.rate_hz)
    moment, bound, G = moments_of(scenario, log)
    of = {name: along[first:] for name, along in moment.items()}
    return Excitation(of, bound[first:], 1.0 / scenario.rate_hz, G[first])


def moments_of(scenario: Scenario, log: Log) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Along a flight of n frames, by the design model: the moment of each surface that leads an axis, (n, 3)
    rad/s2 by its name; the bound (n, 3) rad/s2; and G (n, 3, surfaces) rad/s2 per rad."""
    aircraft = scenario.airframe
    y = _side_by_side(log, "alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", *aircraft.signals)
    u = _side_by_side(log, *(f"{surface}_cmd_rad" for surface in aircraft.surfaces))
    bound = _side_by_side(log, *(f"{axis}_eta_bar_rad_s2" for axis in AXES))
    design = design_of(Declared.of(scenario))[0]
    design["linearised"] = design["frozen_alpha"] = False
    G = responses_at(design, np.zeros((len(y), 3)), y)[1]
    moment = G * u[:, None, :]
    of = {name: moment[:, :, aircraft.surfaces.index(name)] for name in aircraft.class_of_losses}
    return of, bound, G


def _side_by_side(log: Log, *names: str) -> np.ndarray:
    return np.column_stack([log[name] for name in names])


def detection_magnitude(z: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) certain to be detected by each frame alone; above 1 where a total loss is not.

    z, bound (n, 3) rad/s2.
    """
    with np.errstate(divide="ignore", over="ignore"):
        return np.min(2.0 * bound / np.abs(z), axis=1)


def mismatch(
    z: np.ndarray, other: np.ndarray, bound: np.ndarray, limits: tuple[float, float] = (0.0, 1.0)
) -> np.ndarray:
    """M_sj (n,) of m z_s = `z` and z_j = `other`, (n, 3): convex and piecewise linear in b, within limits."""
    a, b = z / (2.0 * bound), other / (2.0 * bound)
    best = np.full(len(a), np.inf)
    # least where two of +-(a_i - b_i t) are equal, one axis with itself at its zero, or at an end
    for (i, j), sign in product(combinations_with_replacement(range(3), 2), (1.0, -1.0)):
        with np.errstate(all="ignore"):
            corner = (a[:, i] - sign * a[:, j]) / (b[:, i] - sign * b[:, j])
        share = np.clip(np.nan_to_num(corner, nan=0.0, posinf=0.0, neginf=0.0), *limits)
        best = np.minimum(best, np.abs(a - share[:, None] * b).max(axis=1))
    return best


def exclusion_magnitude(z: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) for which each frame alone excludes the other fault; inf where 1 does not."""
    low, high = np.zeros(len(z)), np.ones(len(z))
    possible = mismatch(z, other, bound) > 1.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        enough = mismatch(middle[:, None] * z, other, bound) > 1.0
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.where(possible, high, np.inf)


def least_distinguished_rad(column: np.ndarray, other: np.ndarray, bound: np.ndarray) -> float:
    """The least deflection off its command, rad, of a surface with this column of G (3,) that a frame's rates
    are certain to tell from every deflection of another; inf where the columns are parallel. bound (3,)."""
    least = float(mismatch(column[None], other[None], bound[None], (-inf, inf))[0])
    return 1.0 / least if least > 1e-9 * np.abs(column / (2.0 * bound)).max() else inf


def axis_of(scenario: Scenario, surface: str) -> str:
    """The axis on which a surface shows most."""
    aircraft = scenario.airframe
    return AXES[aircraft.dominant_axis[aircraft.surfaces.index(surface)]]


def judge(seen: Excitation, fault: str) -> Document:
    """Magnitudes from which a fault is certain to be found along a flight.

    detected, isolated: whenever it strikes; `_median`: in half of the instants at which it may strike;
    None: not even a total loss. confused_with: the fault that survives longest; why: in words.
    """
    z = seen.moment[fault]
    detect, isolate = seen.windows
    found = best_in_window(detection_magnitude(z, seen.bound), detect)
    excluded = {other: best_in_window(least, isolate) for other, least in seen.excluding[fault].items()}
    isolated = np.maximum(found[: len(z) - isolate + 1], np.max(list(excluded.values()), axis=0))
    rival = max(excluded, key=lambda other: (excluded[other].max(), np.median(excluded[other])))
    least = (*largest_and_median(found, 1.0), *largest_and_median(isolated, 1.0))
    return {
        **dict(zip(MAGNITUDES, least, strict=True)),
        "confused_with": rival,
        "why": _why(seen, fault, rival, found.max(), excluded[rival], isolate),
    }


def pairs_of(seen: Excitation) -> list[Document]:
    """A row for each fault and other fault: from which size and how soon a flight distinguishes them."""
    return [
        {"fault": fault, "other": other, **loss_limits(least, seen.windows[1], seen.dt)}
        for fault, of_others in seen.excluding.items()
        for other, least in of_others.items()
    ]


def _why(seen: Excitation, fault: str, rival: str, detected: float, excluded: np.ndarray, frames: int) -> str:
    """The limit on this fault, in words, at the worst instant for it to strike."""
    if detected > 1.0:
        share = 1.0 / detected
        return (
            f"{fault} barely moves: within {DETECT_WITHIN_S:g} s even a total loss reaches only "
            f"{100 * share:.0f} % of the detection limit"
        )
    if excluded.max() > 1.0:
        start = int(excluded.argmax())
        window = slice(start, start + frames)
        rest = mismatch(seen.moment[fault][window], seen.moment[rival][window], seen.bound[window]).max()
        return (
            f"a fault of {rival} explains even a total loss: within {ISOLATE_WITHIN_S:g} s the difference "
            f"reaches only {100 * rest:.0f} % of the detection limit"
        )
    as_soon = excluded.max() <= detected + 2.0**-BISECTIONS
    return "isolated as soon as detected" if as_soon else f"a fault of {rival} explains smaller losses"
