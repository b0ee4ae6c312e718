"""What the bank of filters is given: its hypotheses, what of a flight may differ from the model, the noise.

The hypotheses: healthy, one group of surfaces at a level, two at once, an unknown offset, or that nothing
answers the commands at all. What is likelier is said by the model's settings: levels seen in labelled
flights, how often things change.

Trim, gain, and each group's own gain may differ from the model. All start from it and are bounded, so that a
fault from the start is not learnt away. The trim differs as another loading or rigging would make it (a shift
of each group's command) and a little freely; it wanders. Gains return to the model's in time: airspeed varies
about what it was when the model was identified. A group's own gain that the fit knows worse than
to a step between levels is free by as much: few minutes mean wide bounds.
"""

from collections.abc import Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.trust import claimed

HEALTHY, GROUP, PAIR, UNKNOWN, IDLE = range(5)
_PAIR_SHARE = 0.02
_UNKNOWN_SHARE = 0.05
_IDLE_SHARE = 0.02
_PAIR_LEVELS = (0.25, 0.5, 0.75)
_HEALTHY_AT_FIRST, _IDLE_AT_FIRST = 0.7, 0.2
_LEAST_SCALE, _LARGEST_SCALE = 0.3, 6.0
_FARTHEST = 30.0
"""Of a whitened flight: a fault is not whitened by what was before it, for a fraction of a second."""


Hypothesis = tuple[Floats, int, float, Floats]  # a row of Bank: effectiveness, kind, weight, offset


class Bank(NamedTuple):
    """H hypotheses. effectiveness (H, G); kind (H,); weight (H,) share of the changes that lead there, the
    first is healthy; offset (H, 3) variance of the rates' offset that comes with it, (rad/s)2; start (H,)
    probability of each before the flight; change: probability of a change in a sample; own (H, G): share of
    each group's answer that its own gain is of, what is left of it, or all where a law's answer to noise adds
    to what a surface seems to do."""

    effectiveness: Floats
    kind: np.ndarray
    weight: Floats
    offset: Floats
    start: Floats
    change: float
    own: Floats

    @property
    def idle(self) -> int:
        """The hypothesis that nothing answers the commands: on the ground, or everything lost."""
        return len(self.kind) - 1

    @property
    def faults(self) -> np.ndarray:
        """Which hypotheses say that some surface has lost effectiveness, (H,)."""
        return np.asarray((self.kind == GROUP) | (self.kind == PAIR))

    def faulty(self, group: int) -> np.ndarray:
        """Which hypotheses say that a group has lost effectiveness, (H,)."""
        return np.asarray((self.effectiveness[:, group] < 1.0) & (self.kind != IDLE))


def bank_of(model: Model) -> Bank:
    """The hypotheses of a model: none of a group of which nothing is said, where something is said of any."""
    count, settings = len(model.groups), model.settings
    told = claimed(model)
    known = [group for group in range(count) if told[group] or not any(told)]
    rows: list[Hypothesis] = [(np.ones(count), HEALTHY, settings.repair_share, np.zeros(3))]
    surfaces = sum(len(model.groups[group]) for group in known)
    stuck = "stuck" in model.vehicle.faults
    pairs = len(known) > 1
    single = 1.0 - (_PAIR_SHARE if pairs else 0.0) - (_UNKNOWN_SHARE if stuck else 0.0)
    for group in known:
        levels, weights = _levels(model, group)
        share = single * len(model.groups[group]) / surfaces / len(model.vehicle.faults)
        for offset in _offsets(model, group):
            for level, weight in zip(levels, weights, strict=True):
                rows.append((_with(count, {group: level}), GROUP, share * weight, offset))
    rows += _pairs(count, known)
    if stuck:
        unknown = np.diag(np.array(model.noise)) * settings.jam_sd**2
        rows.append((np.ones(count), UNKNOWN, _UNKNOWN_SHARE, unknown))
    rows.append((np.zeros(count), IDLE, _IDLE_SHARE, np.zeros(3)))
    effectiveness, kind, weight, offset = (np.array(column) for column in zip(*rows, strict=True))
    weight[1:] *= (1.0 - settings.repair_share) / weight[1:].sum()
    change = settings.changes_per_hour / (3600.0 * model.rate_hz)
    own = np.ones_like(effectiveness) if model.vehicle.other_laws else effectiveness
    return Bank(effectiveness, kind, weight, offset, _at_first(kind, weight), change, own)


def _with(count: int, levels: dict[int, float]) -> Floats:
    row = np.ones(count)
    for group, level in levels.items():
        row[group] = level
    return row


def _levels(model: Model, group: int) -> tuple[Floats, Floats]:
    """Levels of effectiveness below 1, and the share of each among the group's faults."""
    settings = model.settings
    seen = settings.levels.get("+".join(model.groups[group]), [])
    even = np.arange(0.0, 1.0 - 0.5 * settings.level_step, settings.level_step)
    levels = np.unique(np.round(np.concatenate([even, np.array(seen, dtype=float)]), 6))
    likelier = np.isin(levels, np.round(seen, 6))
    if not likelier.any() or likelier.all():
        return levels, np.full(len(levels), 1.0 / len(levels))
    share = settings.level_share
    return levels, np.where(likelier, share / likelier.sum(), (1.0 - share) / (~likelier).sum())


def _offsets(model: Model, group: int) -> list[Floats]:
    """Variances of the rates' offset that may come with a loss, (3,) each: none, or that of the group stuck
    anywhere within its travel, along the axes it moves most."""
    _, _, response, noise = model.arrays()
    total = np.abs(response[group]).sum(axis=0) / np.sqrt(np.diag(noise))
    share = np.clip(total / max(total.max(), TINY), 0.3, 1.0)
    kinds = {"loss": np.zeros(3), "stuck": np.diag(noise) * (model.settings.jam_sd * share) ** 2}
    return [kinds[kind] for kind in model.vehicle.faults]


def _pairs(count: int, known: list[int]) -> list[Hypothesis]:
    """Two of the known groups at once, on a coarse grid."""
    both = list(product(combinations(known, 2), product(_PAIR_LEVELS, repeat=2)))
    return [
        (_with(count, dict(zip(groups, levels, strict=True))), PAIR, _PAIR_SHARE / len(both), np.zeros(3))
        for groups, levels in both
    ]


def _at_first(kind: np.ndarray, weight: Floats) -> Floats:
    """Probability of each hypothesis before the flight, (H,): mostly healthy, any fault allowed."""
    faults = (kind != HEALTHY) & (kind != IDLE)
    start = weight * (1.0 - _HEALTHY_AT_FIRST - _IDLE_AT_FIRST) / weight[faults].sum()
    start[0] = _HEALTHY_AT_FIRST
    start[-1] = _IDLE_AT_FIRST
    return np.asarray(start)


class Adaptation(NamedTuple):
    """Of the N = 4 + G states: trim (3,) rad/s a sample, gain, own gain of each group.

    mean (N,) and covariance (N, N) before the flight; bound (N,) on the distance from the mean; keep (N,)
    share of that distance left a sample later; walk (N,) variance added a sample.
    """

    mean: Floats
    covariance: Floats
    bound: Floats
    keep: Floats
    walk: Floats


def adaptation_of(model: Model) -> Adaptation:
    """The bounds of adaptation that a model's settings say."""
    settings, groups = model.settings, len(model.groups)
    _, _, response, noise = model.arrays()
    variance = np.diag(noise)
    shift = response.sum(axis=1) * settings.trim_shift
    covariance = np.zeros((4 + groups, 4 + groups))
    covariance[:3, :3] = np.diag(variance * settings.trim_sd**2) + shift.T @ shift
    covariance[3, 3] = settings.gain_sd**2
    covariance[range(4, 4 + groups), range(4, 4 + groups)] = settings.own_gain_sd**2 + _unknown(model)
    times_s = np.array([np.inf] * 3 + [settings.gain_time_s] + [settings.own_gain_time_s] * groups)
    keep = np.exp(-1.0 / (model.rate_hz * times_s))
    walk = (1.0 - keep**2) * np.diag(covariance)
    walk[:3] = variance * np.array(settings.trim_walk) ** 2
    reach = np.array([settings.trim_bound] * 3 + [settings.gain_bound] * (1 + groups))
    mean = np.array([0.0, 0.0, 0.0, 1.0] + [0.0] * groups)
    return Adaptation(mean, covariance, np.sqrt(np.diag(covariance)) * reach, keep, walk)


def _unknown(model: Model) -> Floats:
    """Variance of each group's gain by which it is known worse than to a step between levels, (G,)."""
    known = np.zeros(len(model.groups))
    if model.fitted is not None and model.fitted.gain_sd:
        known += np.array(model.fitted.gain_sd) ** 2
    return np.maximum(known - model.settings.level_step**2, 0.0)


class Noise(NamedTuple):
    """What of a sample is noise.

    constant (3,) of the model, rad/s; covariance (3, 3) of a sample, (rad/s)2; power: share of a white
    residual's information in this one; tail: degrees of freedom of its t distribution; memory in samples, and
    least and largest value, of the running scale of the covariance; farthest: square of a residual from
    which on a sample tells nothing more; wider: how many times the covariance is that of residuals.
    """

    constant: Floats
    covariance: Floats
    power: float
    tail: float
    memory: float
    least: float
    largest: float
    farthest: float
    wider: float


def noise_of(model: Model, colour: Sequence[float] = ()) -> Noise:
    """The noise that a model's settings say, of a colour."""
    settings, farthest = model.settings, _FARTHEST if len(model.noise_predictor(colour)) else np.inf
    memory = settings.noise_memory_s * model.rate_hz
    return Noise(
        model.constant(colour), model.arrays()[3], settings.power, settings.tail, memory,
        _LEAST_SCALE, _LARGEST_SCALE, farthest, model.noise_factor(colour),
    )  # fmt: skip
