"""The hypotheses of the bank of filters.

They are: all healthy; one group of surfaces at a level of effectiveness; two groups at once; if a
surface may be stuck, an unknown offset of the rates; nothing answers the commands. The shares below and the
levels in labelled flights give their prior probabilities.

Letters as in `filtering`. Index g is a group.
"""

from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats
from beaver_ftc_logs.trust import known_effects

HEALTHY, GROUP_LOSS, PAIR_LOSS, UNKNOWN_OFFSET, NO_RESPONSE = range(5)
# Shares of the changes that do not restore health, before they are normalised to the sum 1: changes to a loss
# of two groups, to an unknown offset, to no response.
_PAIR_SHARE = 0.02
_OFFSET_SHARE = 0.05
_SILENT_SHARE = 0.02
_PAIR_LEVELS = (0.25, 0.5, 0.75)  # a coarse grid, for the time of `diagnose`
# Probabilities before the flight.
_PRIOR_HEALTHY = 0.7
_PRIOR_NO_RESPONSE = 0.2
# Least probability of a hypothesis; also the rounding error of a sum of probabilities.
MIN_PROBABILITY = 1e-15


# A hypothesis: effectiveness of each group (G,), kind, transition share, variance of the rate offset (3,).
HypothesisRow = tuple[Floats, int, float, Floats]


class HypothesisBank(NamedTuple):
    """H hypotheses of G groups; the first is healthy, the last that nothing answers the commands: on the
    ground, or everything lost.

    effectiveness (H, G). hypothesis_kind (H,). transition_share (H,): share of all changes of hypothesis that
    lead to this one. rate_offset_variance (H, 3): variance of the offset of the rates that comes with it,
    (rad/s)2. prior_probability (H,): probability before the flight. change_probability_per_sample:
    probability that the hypothesis changes within a sample. own_gain_share (H, G): share of a group's healthy
    response that the group's own gain multiplies: the effectiveness; 1 if other laws may fly, where the
    response of a control law to noise adds to the effect of a surface.
    """

    effectiveness: Floats
    hypothesis_kind: np.ndarray
    transition_share: Floats
    rate_offset_variance: Floats
    prior_probability: Floats
    change_probability_per_sample: float
    own_gain_share: Floats

    @property
    def is_fault_hypothesis(self) -> np.ndarray:
        """Whether a hypothesis is a loss of effectiveness of one or two groups, (H,)."""
        return (self.hypothesis_kind == GROUP_LOSS) | (self.hypothesis_kind == PAIR_LOSS)

    def is_fault_of_group(self, g: int) -> np.ndarray:
        """Whether a hypothesis contains a loss of effectiveness of group g, (H,)."""
        return (self.effectiveness[:, g] < 1.0) & (self.hypothesis_kind != NO_RESPONSE)


def build_bank(model: Model) -> HypothesisBank:
    """The hypotheses of a model. A group whose effect is unknown has none, unless all effects are unknown."""
    settings = model.settings
    n = len(model.groups)
    known = known_effects(model)
    groups = [g for g in range(n) if known[g] or not any(known)]
    rows: list[HypothesisRow] = [(np.ones(n), HEALTHY, settings.repair_share, np.zeros(3))]
    stuck = "stuck" in model.vehicle.faults
    single_share = 1.0 - _PAIR_SHARE * (len(groups) > 1) - _OFFSET_SHARE * stuck
    rows += _single_hypotheses(model, groups, single_share)
    rows += _pair_hypotheses(n, groups)
    if stuck:
        stuck_variance = np.diag(np.array(model.noise)) * settings.jam_sd**2
        rows.append((np.ones(n), UNKNOWN_OFFSET, _OFFSET_SHARE, stuck_variance))
    rows.append((np.zeros(n), NO_RESPONSE, _SILENT_SHARE, np.zeros(3)))
    effectiveness, kind, transition_share, offset = (np.array(values) for values in zip(*rows, strict=True))
    transition_share[1:] *= (1.0 - settings.repair_share) / transition_share[1:].sum()
    rate = settings.changes_per_hour / (3600.0 * model.rate_hz)
    own_gain_share = np.ones_like(effectiveness) if model.vehicle.other_laws else effectiveness
    return HypothesisBank(
        effectiveness=effectiveness,
        hypothesis_kind=kind,
        transition_share=transition_share,
        rate_offset_variance=offset,
        prior_probability=_prior_probabilities(transition_share),
        change_probability_per_sample=rate,
        own_gain_share=own_gain_share,
    )


def _single_hypotheses(model: Model, groups: list[int], share: float) -> Iterator[HypothesisRow]:
    """One group at each of its levels, for each fault kind of the vehicle (`_offset_variances`). share: share
    of the changes that lead to one of these, before it is normalised; each surface has an equal part of it,
    and each fault kind an equal part of this."""
    n_surfaces = sum(len(model.groups[g]) for g in groups)
    for g in groups:
        levels, shares = _levels_and_shares(model, g)
        per_kind = share * len(model.groups[g]) / n_surfaces / len(model.vehicle.faults)
        for offset in _offset_variances(model, g):
            for level, level_share in zip(levels, shares, strict=True):
                yield _effect_row(len(model.groups), {g: level}), GROUP_LOSS, per_kind * level_share, offset


def _effect_row(n: int, levels: dict[int, float]) -> Floats:
    """Effectiveness of each of n groups, (n,): the level of a group in `levels`, otherwise 1."""
    row = np.ones(n)
    row[list(levels)] = list(levels.values())
    return row


def _levels_and_shares(model: Model, g: int) -> tuple[Floats, Floats]:
    """Levels of effectiveness below 1, and the share of each among the group's faults: a grid with the step
    level_step, and the labelled levels. The labelled levels share `level_share` equally, the others the rest;
    if none or all are labelled, all have equal shares."""
    settings = model.settings
    labelled = settings.levels.get(model.group_names[g], [])
    grid = np.arange(0.0, 1.0 - 0.5 * settings.level_step, settings.level_step)
    levels = np.unique(np.round(np.concatenate([grid, np.array(labelled, dtype=float)]), 6))
    is_labelled = np.isin(levels, np.round(labelled, 6))
    n = int(is_labelled.sum())
    share = settings.level_share
    if n in (0, len(levels)):
        return levels, np.full(len(levels), 1.0 / len(levels))
    return levels, np.where(is_labelled, share / n, (1.0 - share) / (len(levels) - n))


def _offset_variances(model: Model, g: int) -> list[Floats]:
    """For each fault kind of the vehicle the variance (3,) of the rates' offset that comes with a loss: 0 for
    a plain loss, and for a group that is stuck anywhere within its travel

        diag(R) (jam_sd ratio)^2

    ratio (3,): effect of the group on each axis over its largest effect, both in sd of the noise, 0.3 to 1.
    """
    B = np.array(model.response)
    R = np.array(model.noise)
    effect = np.abs(B[g]).sum(axis=0) / np.sqrt(np.diag(R))
    ratio = np.clip(effect / max(effect.max(), MIN_DIVISOR), 0.3, 1.0)
    stuck = np.diag(R) * (model.settings.jam_sd * ratio) ** 2
    return [stuck if kind == "stuck" else np.zeros(3) for kind in model.vehicle.faults]


def _pair_hypotheses(n: int, groups: list[int]) -> list[HypothesisRow]:
    """Two of the given groups at once, at the levels _PAIR_LEVELS; n: number of all groups."""
    pairs = list(product(combinations(groups, 2), product(_PAIR_LEVELS, repeat=2)))
    rows = [_effect_row(n, dict(zip(pair, levels, strict=True))) for pair, levels in pairs]
    return [(row, PAIR_LOSS, _PAIR_SHARE / len(pairs), np.zeros(3)) for row in rows]


def _prior_probabilities(share: Floats) -> Floats:
    """Probability of each hypothesis before the flight, (H,): _PRIOR_HEALTHY of the first,
    _PRIOR_NO_RESPONSE of the last, and the remainder for the others in proportion to share (H,), their shares
    of all changes of hypothesis."""
    p = share * (1.0 - _PRIOR_HEALTHY - _PRIOR_NO_RESPONSE) / share[1:-1].sum()
    p[0] = _PRIOR_HEALTHY
    p[-1] = _PRIOR_NO_RESPONSE
    return p
