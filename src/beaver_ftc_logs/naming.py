"""Which surfaces an alarm names.

P           probability of each hypothesis of the bank (n, H)
p_fault     probability of any fault (n,)
nameable    whether the evidence is enough for a name (n,)
"""

import numpy as np

from beaver_ftc_logs.bank import GROUP_LOSS, UNKNOWN_OFFSET, HypothesisBank
from beaver_ftc_logs.energy import UNKNOWN_SURFACE
from beaver_ftc_logs.log_rows import Names, join_names
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints, Mask

# Without `one_group`: a group is named if the probability of its faults exceeds this share of that of any
# fault.
_NAME_SHARE = 0.5
# Largest probability that the name ever leaves out the surface at fault, if the model is right and all groups
# are equally probable at first: the likelihood ratio of another group to the true one ever exceeds the
# inverse with at most this probability (Ville's inequality).
_EXCLUSION_RISK = 0.001


def surfaces_at_fault(
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
