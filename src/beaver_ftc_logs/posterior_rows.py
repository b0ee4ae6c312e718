"""From the probabilities of the hypotheses to rows: alarm, names, effectiveness and its bounds.

P, P_live   probability of each hypothesis of the bank (n, H); of the first all is healthy, of the last
            nothing answers the commands; without the last, if something answers (n, H - 1)
levels, p   levels of effectiveness of one group (L,), ascending, and their probabilities (n, L)
a           effectiveness of each group (n, G), with bounds low and high
faulty      whether the alarm stands (n,), 0 or 1
alarmed     whether the evidence is enough for an alarm (n,)
nameable    whether it is enough for a name (n,)
calm        whether `healthy` and `nothing answers` have in sum a probability above 1/2 (n,)
"""

import numpy as np

from beaver_ftc_logs.bank import HypothesisBank
from beaver_ftc_logs.evidence import fault_evidence, page_cusum
from beaver_ftc_logs.groups import expand_groups
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.naming import surfaces_at_fault
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Mask
from beaver_ftc_logs.runs import last_true_row
from beaver_ftc_logs.samples import Samples

# If the probability that nothing answers the commands is larger, there is no verdict on any surface.
NO_RESPONSE_LIMIT = 0.5


def rows_of_posterior(
    samples: Samples, model: Model, bank: HypothesisBank, P: Floats, mass: float | None = None
) -> LogRows:
    """The rows that follow from the probabilities P (n, H). mass: probability inside the bounds; that of the
    model's settings if None or 0. Effectiveness and bounds hold if something answers the commands.

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
    P_live = P[:, :-1] / np.maximum(1.0 - P[:, -1], MIN_DIVISOR)[:, None]
    mass = mass or model.settings.bounds
    per_group = [_group_bounds(bank, P_live, g, model, mass) for g in range(len(model.groups))]
    a, low, high = (np.column_stack(column) for column in zip(*per_group, strict=True))
    if model.vehicle.other_laws:  # only an alarm excludes health
        high[faulty == 0] = 1.0
    return LogRows(
        t_s=samples.t_s,
        faulty=faulty,
        isolated_surfaces=surfaces_at_fault(model, bank, P, p_fault, faulty, _latched(nameable, calm)),
        effectiveness=expand_groups(a, model),
        effectiveness_low=expand_groups(low, model),
        effectiveness_high=expand_groups(high, model),
        fault_probability=p_fault,
        evidence_start_time_s=samples.t_s[start],
    )


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
