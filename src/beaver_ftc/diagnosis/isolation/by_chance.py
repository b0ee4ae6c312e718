"""What the statistical detector makes of a loss of the published class: improbable, doubted, or shown.

A loss that shows by itself is never excluded by chance. One that only the end of a loss that was never seen
would explain is doubted: the isolation does not name it.
"""

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection import statistical


@kernel
def weigh(fie, tests, blocks, isolation, loss_of, abrupt, hidden):
    """Fill `improbable` of estimator fie: whether chance excludes its loss; and bring `shown` and `doubted`
    to this frame.

    hidden: a gust may hide the error of a vane from the sensor monitor. What that excludes leaves a surface
    by accident, so all estimators are doubted then. loss_of (n,): the estimator of each surface's loss;
    abrupt: whether a fault is declared to stay as it is.
    """
    others, s = isolation.estimator, fie.surface
    fie.improbable = 0
    if not fie.shown and (fie.doubted or not abrupt):
        fie.shown = statistical.confirms_loss(tests, blocks, others, loss_of, s)  # later may be its end
    if fie.shown or not statistical.excludes_loss(tests, blocks, others, loss_of, s, False, abrupt):
        return
    fie.improbable = statistical.excludes_loss(tests, blocks, others, loss_of, s, True, abrupt)
    fie.doubted = max(fie.doubted, 1)
    if fie.improbable and hidden:
        for other in others[: isolation.config.n]:
            other.doubted = max(other.doubted, 1)
