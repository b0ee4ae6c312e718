"""The hypotheses a flight is filtered under: healthy, one group of surfaces at a level, two at once, an
unknown offset, or that nothing answers the commands at all.

What is likelier is said by the model's settings: levels seen in labelled flights, how often things change.
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats

HEALTHY, GROUP, PAIR, UNKNOWN, IDLE = range(5)
_PAIR_SHARE = 0.02
_UNKNOWN_SHARE = 0.05
_IDLE_SHARE = 0.02
_PAIR_LEVELS = (0.25, 0.5, 0.75)
_HEALTHY_AT_FIRST, _IDLE_AT_FIRST = 0.7, 0.2


@dataclass(frozen=True)
class Bank:
    """H hypotheses. effectiveness (H, G); kind (H,); weight (H,) share of the changes that lead there, the
    first is healthy; offset (H, 3) variance of the rates' offset that comes with it, (rad/s)2."""

    effectiveness: Floats
    kind: np.ndarray
    weight: Floats
    offset: Floats

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
    """The hypotheses of a model."""
    count, settings = len(model.groups), model.settings
    rows: list[tuple[Floats, int, float, Floats]] = [
        (np.ones(count), HEALTHY, settings.repair_share, np.zeros(3))
    ]
    surfaces = sum(len(group) for group in model.groups)
    stuck = "stuck" in model.vehicle.faults
    pairs = count > 1
    single = 1.0 - (_PAIR_SHARE if pairs else 0.0) - (_UNKNOWN_SHARE if stuck else 0.0)
    for group in range(count):
        levels, weights = _levels(model, group)
        share = single * len(model.groups[group]) / surfaces / len(model.vehicle.faults)
        for offset in offsets(model, group):
            rows += [
                (_with(count, {group: level}), GROUP, share * weight, offset)
                for level, weight in zip(levels, weights, strict=True)
            ]
    rows += _pairs(count)
    if stuck:
        unknown = np.diag(np.array(model.noise)) * settings.jam_sd**2
        rows.append((np.ones(count), UNKNOWN, _UNKNOWN_SHARE, unknown))
    rows.append((np.zeros(count), IDLE, _IDLE_SHARE, np.zeros(3)))
    effectiveness, kind, weight, offset = (np.array(column) for column in zip(*rows, strict=True))
    weight[1:] *= (1.0 - settings.repair_share) / weight[1:].sum()
    return Bank(effectiveness, kind, weight, offset)


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


def offsets(model: Model, group: int) -> list[Floats]:
    """Variances of the rates' offset that may come with a loss: none, or that of a surface that is stuck."""
    kinds = {"loss": np.zeros(3), "stuck": _jam(model, group)}
    return [kinds[kind] for kind in model.vehicle.faults]


def _jam(model: Model, group: int) -> Floats:
    """Variance of the rates' offset where the group is stuck anywhere within its travel, (3,): along the axes
    the group moves most."""
    _, _, response, noise = model.arrays()
    total = np.abs(response[group]).sum(axis=0) / np.sqrt(np.diag(noise))
    share = np.clip(total / max(total.max(), 1e-300), 0.3, 1.0)
    return np.asarray(np.diag(noise) * (model.settings.jam_sd * share) ** 2)


def _pairs(count: int) -> list[tuple[Floats, int, float, Floats]]:
    """Two groups at once, on a coarse grid."""
    both = [(a, b) for a in range(count) for b in range(a + 1, count)]
    if not both:
        return []
    weight = _PAIR_SHARE / (len(both) * len(_PAIR_LEVELS) ** 2)
    return [
        (_with(count, {a: one, b: other}), PAIR, weight, np.zeros(3))
        for a, b in both
        for one in _PAIR_LEVELS
        for other in _PAIR_LEVELS
    ]


def at_first(bank: Bank) -> Floats:
    """Probability of each hypothesis before the flight, (H,): mostly healthy, any fault allowed."""
    faults = (bank.kind != HEALTHY) & (bank.kind != IDLE)
    start = bank.weight * (1.0 - _HEALTHY_AT_FIRST - _IDLE_AT_FIRST) / bank.weight[faults].sum()
    start[0] = _HEALTHY_AT_FIRST
    start[bank.idle] = _IDLE_AT_FIRST
    return np.asarray(start)
