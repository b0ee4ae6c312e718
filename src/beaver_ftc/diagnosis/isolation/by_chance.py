"""Exclusion of a loss of the published class by likelihood ratios: excluded, weakly excluded, or confirmed.

A confirmed loss is never excluded by likelihood. A loss that only the end of an undetected earlier loss could
explain is weakly excluded: the isolation does not name it.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection import statistical


@kernel
def update_exclusion(fie, tests, blocks, isolation, loss_of, abrupt, hidden):
    """Fill `excluded_by_likelihood` of estimator fie; update its `confirmed` and `weakly_excluded`.

    hidden: a gust may hide an error of a vane from the sensor monitor. An exclusion may then be the effect of
    that error, so all estimators become weakly excluded. loss_of (n,): the estimator of each surface's loss;
    abrupt: a fault is declared to stay as it is.
    """
    others, s = isolation.estimator, fie.surface
    fie.excluded_by_likelihood = 0
    if not fie.confirmed and (fie.weakly_excluded or not abrupt):
        fie.confirmed = statistical.confirms_loss(
            tests, blocks, others, loss_of, s
        )  # what follows later may be its end
    if fie.confirmed or not statistical.excludes_loss(tests, blocks, others, loss_of, s, False, abrupt):
        return
    fie.excluded_by_likelihood = statistical.excludes_loss(tests, blocks, others, loss_of, s, True, abrupt)
    fie.weakly_excluded = max(fie.weakly_excluded, 1)
    if fie.excluded_by_likelihood and hidden:
        for other in others[: isolation.config.n]:
            other.weakly_excluded = max(other.weakly_excluded, 1)
