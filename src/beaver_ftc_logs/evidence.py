"""The evidence for a fault, from the probabilities of the hypotheses; and Page's sum of it [Page1954]."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc_logs.bank import MIN_PROBABILITY, HypothesisBank
from beaver_ftc_logs.recording import Floats


def fault_evidence(p: Floats, bank: HypothesisBank) -> Floats:
    """Increase of the log odds of a fault by each sample, (n,), from the probabilities p (n, H):

        z[k] = log odds(f[k]) - log odds((1 - change) f[k-1] + entry)

    f: probability of a loss of effectiveness (`is_fault_hypothesis`: not of an unknown offset), at least
    MIN_PROBABILITY from 0 and 1; change: probability that the hypothesis changes within a sample; entry: the
    probability of a change to a fault. Before the first sample, the prior probability of a fault is used. The
    sum of z is the logarithm of a likelihood ratio.
    """
    is_fault = bank.is_fault_hypothesis
    share = bank.transition_share
    change = bank.change_probability_per_sample
    fault = np.clip(p[:, is_fault].sum(axis=1), MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
    entry = change * share[is_fault].sum() / share.sum()
    prior = np.append(bank.prior_probability[is_fault].sum(), (1.0 - change) * fault[:-1] + entry)
    return np.log(fault / (1.0 - fault)) - np.log(prior / (1.0 - prior))


@kernel(allocates=True)
def page_cusum(z, top):
    """Page's sum of the evidence z (n,), between 0 and top:

    sums[k] = min(max(sums[k-1] + z[k], 0), top)
    """
    page = 0.0
    sums = np.zeros(len(z))
    for k in range(len(z)):
        page = min(max(page + z[k], 0.0), top)
        sums[k] = page
    return sums
