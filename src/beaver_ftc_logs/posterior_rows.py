"""From the probabilities of the hypotheses to rows: alarm, names, effectiveness and its bounds.

P           probability of each hypothesis of the bank (n, H); of the first all is healthy, of the last
            nothing answers the commands
levels, p   levels of effectiveness of one group (L,), ascending, and their probabilities (n, L)
a           effectiveness of each group (n, G), with bounds low and high
faulty      whether the alarm stands (n,), 0 or 1
alarmed     whether the evidence is enough for an alarm (n,)
nameable    whether it is enough for a name (n,)
calm        whether `healthy` and `nothing answers` have in sum a probability above 1/2 (n,)
"""

import numpy as np

from beaver_ftc_logs.bank import GROUP_LOSS, UNKNOWN_OFFSET, HypothesisBank
from beaver_ftc_logs.energy import UNKNOWN_SURFACE
from beaver_ftc_logs.filtering import fault_evidence, page_cusum
from beaver_ftc_logs.groups import expand_groups
from beaver_ftc_logs.log_rows import LogRows, Names, join_names
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints, Mask
from beaver_ftc_logs.runs import last_true_row
from beaver_ftc_logs.samples import Samples

# Without `one_group`: a group is named if the probability of its faults exceeds this share of that of any
# fault.
_NAME_SHARE = 0.5
# Largest probability that the name ever leaves out the surface at fault, if the model is right and all groups
# are equally probable at first: the likelihood ratio of another group to the true one ever exceeds the
# inverse with at most this probability (Ville's inequality).
_EXCLUSION_RISK = 0.001
# If the probability that nothing answers the commands is larger, there is no verdict on any surface.
NO_RESPONSE_LIMIT = 0.5


def rows_of_posterior(
    samples: Samples, model: Model, bank: HypothesisBank, P: Floats, mass: float | None = None
) -> LogRows:
    """The rows that follow from the probabilities P (n, H). mass: probability inside the bounds; that of the
    model's settings if None or 0.

                    threshold mu of the evidence       no threshold
        alarmed     Page's sum >= mu, and not calm     p_fault >= alarm
        nameable    the same with mu_name              as alarmed

    mu, mu_name: evidence for an alarm and for a name, natural logarithm of odds, also the limits of the sums;
    p_fault (n,): probability of any fault; alarm: of the settings. Alarm and name stand until a calm row
    (`_latched`). Under other laws, the upper bound is 1 without an alarm. start: last row in which Page's sum
    is 0, or the first row.
    """
    p_fault = P[:, bank.is_fault_hypothesis].sum(axis=1)
    calm = P[:, 0] + P[:, -1] > 0.5
    mu = model.settings.threshold
    steps = fault_evidence(P, bank)
    evidence = page_cusum(steps, mu or np.inf)
    alarmed = nameable = p_fault >= model.settings.alarm
    if mu is not None:
        mu_name = model.settings.name_evidence * mu
        alarmed = (evidence >= mu) & ~calm
        nameable = (page_cusum(steps, mu_name) >= mu_name) & ~calm
    faulty = _latched(alarmed, calm).astype(np.int64)
    start = np.maximum(last_true_row(evidence <= 0.0), 0)
    a, low, high = _effectiveness(model, bank, P, mass or model.settings.bounds)
    if model.vehicle.other_laws:  # only an alarm excludes health
        high[faulty == 0] = 1.0
    return LogRows(
        t_s=samples.t_s,
        faulty=faulty,
        isolated_surfaces=_surfaces_at_fault(model, bank, P, p_fault, faulty, _latched(nameable, calm)),
        effectiveness=expand_groups(a, model),
        effectiveness_low=expand_groups(low, model),
        effectiveness_high=expand_groups(high, model),
        fault_probability=p_fault,
        evidence_start_time_s=samples.t_s[start],
    )


def _effectiveness(model: Model, bank: HypothesisBank, P: Floats, mass: float) -> tuple[Floats, ...]:
    """The median effectiveness of each group, and bounds with the probability `mass` between them, (n, G)
    each, if something answers. Where the probability that nothing answers exceeds NO_RESPONSE_LIMIT, the
    effectiveness is 1 and the bounds are 0 and 1."""
    p_silent = P[:, -1]
    P_live = P[:, :-1] / np.maximum(1.0 - p_silent, MIN_DIVISOR)[:, None]
    per_group = [_group_bounds(bank, P_live, g, model, mass) for g in range(len(model.groups))]
    a, low, high = (np.column_stack(column) for column in zip(*per_group, strict=True))
    silent = p_silent > NO_RESPONSE_LIMIT
    a[silent] = 1.0
    low[silent] = 0.0
    high[silent] = 1.0
    return a, low, high


def _group_bounds(
    bank: HypothesisBank, P_live: Floats, g: int, model: Model, mass: float
) -> tuple[Floats, ...]:
    """The median effectiveness of a group, and bounds with the probability `mass` between them, (n,) each.

    If surfaces move together, one of them may have lost everything and the others nothing. The upper bound of
    a group of several surfaces is therefore 1, and the lower one 0 unless 1 is the only level within bounds.
    """
    levels, p = _group_levels(bank, P_live, g)
    if model.vehicle.other_laws:  # all levels are equally probable before the flight
        p = p / _group_levels(bank, bank.prior_probability[None, :-1], g)[1]
        p /= p.sum(axis=1, keepdims=True)
    low, high = _credible_bounds(levels, p, mass)
    if len(model.groups[g]) > 1:
        low = np.where(low < levels[-2:].mean(), 0.0, low)
        high = np.ones_like(high)
    # The median has the least mean absolute error. 1e-12: rounding of the sum must not skip a level.
    return levels[(np.cumsum(p, axis=1) >= 0.5 - 1e-12).argmax(axis=1)], low, high


def _latched(alarmed: Mask, calm: Mask) -> Mask:
    """Whether the last alarmed row is later than the last calm row without an alarm, (n,)."""
    return last_true_row(alarmed) > last_true_row(calm & ~alarmed)


def _group_levels(bank: HypothesisBank, P_live: Floats, g: int) -> tuple[Floats, Floats]:
    """The levels of a group (L,), of which the last is 1, and the probability of each (n, L): the sum of
    P_live (n, H - 1), of the hypotheses in which something answers, over those with this level."""
    levels, level_of = np.unique(bank.effectiveness[:-1, g], return_inverse=True)
    p = np.zeros((len(P_live), len(levels)))
    for h, j in enumerate(level_of):
        p[:, j] += P_live[:, h]
    return levels, p


def _credible_bounds(levels: Floats, p: Floats, mass: float) -> tuple[Floats, Floats]:
    """Low and high (n,): the range of the most probable levels, as few as have the probability `mass` in sum,
    half a step wider on both sides, but within 0 and 1. levels (L,), p (n, L)."""
    order = np.argsort(-p, axis=1, kind="stable")
    ranked = np.take_along_axis(p, order, axis=1)
    chosen = np.cumsum(ranked, axis=1) - ranked < mass
    kept = np.where(chosen, levels[order], np.nan)
    low = np.nanmin(kept, axis=1)
    high = np.nanmax(kept, axis=1)
    edges = np.concatenate([[0.0], 0.5 * (levels[1:] + levels[:-1]), [1.0]])
    return edges[np.searchsorted(levels, low)], edges[np.searchsorted(levels, high) + 1]


def _surfaces_at_fault(
    model: Model, bank: HypothesisBank, P: Floats, p_fault: Floats, faulty: Ints, nameable: Mask
) -> Names:
    """The named surfaces of each row, (n,): those of the likely groups (`_likely_groups`). While the alarm
    stands, a row without a name is `unknown`. The first row of an alarm takes its new name. Later the old
    name stays if one of these is true:

        1. an unknown offset is likelier than a fault of known surfaces
        2. the old name is not `unknown`, and the new name has stood for less than `rename_s`
        3. the old name is not `unknown`, `one_group` is set, and the new name is `unknown` or contains all
           surfaces of the old one: an excluded surface stays excluded

    p_fault (n,): probability of any fault. names (n,): by the probabilities of each row alone; result (n,).
    new: name of this row by `names`; old: name of the row before by `result`; n_same: number of rows directly
    before that have the same new name.
    """
    likely = _likely_groups(model, bank, P, p_fault)
    names = join_names(likely & nameable[:, None], model.group_names)
    result = np.full(len(P), "", dtype=object)
    is_offset = P[:, bank.hypothesis_kind == UNKNOWN_OFFSET].sum(axis=1) > p_fault
    n_hold = round(model.settings.rename_s * model.rate_hz)
    n_same = 0
    for k in np.flatnonzero(faulty):
        new = names[k] or UNKNOWN_SURFACE
        old = result[k - 1] if k else ""
        n_same = n_same + 1 if k and new == (names[k - 1] or UNKNOWN_SURFACE) else 0
        excludes_none = new == UNKNOWN_SURFACE or set(old.split("+")) <= set(new.split("+"))
        is_barred = n_same < n_hold or (model.settings.one_group and excludes_none)  # 2, 3
        keeps_old = old and (is_offset[k] or (old != UNKNOWN_SURFACE and is_barred))
        result[k] = old if keeps_old else new
    return result


def _likely_groups(model: Model, bank: HypothesisBank, P: Floats, p_fault: Floats) -> Mask:
    """The groups (n, G) that the name of a row may have.

    one_group   groups
    false       those whose faults have more than _NAME_SHARE of p_fault (n,)
    true        those whose loss alone is more than _EXCLUSION_RISK times as probable as the likeliest loss;
                none in a row in which these are all of several groups that can have a loss
    """
    faults = [bank.is_fault_of_group(g) for g in range(len(model.groups))]
    if not model.settings.one_group:
        p_groups = np.column_stack([P[:, of_group].sum(axis=1) for of_group in faults])
        return p_groups / np.maximum(p_fault, MIN_DIVISOR)[:, None] > _NAME_SHARE
    losses = [of_group & (bank.hypothesis_kind == GROUP_LOSS) for of_group in faults]
    p_loss = np.column_stack([P[:, of_group].sum(axis=1) for of_group in losses])
    likely = p_loss > _EXCLUSION_RISK * p_loss.max(axis=1, keepdims=True)
    can_lose = np.any(losses, axis=1)
    if can_lose.sum() > 1:
        likely &= ~likely[:, can_lose].all(axis=1, keepdims=True)
    return likely
