"""The contract between the frame and a compiled scheme, and the scheme `none`, which diagnoses nothing."""

from collections.abc import Callable
from typing import NamedTuple

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.diagnosis import isolation
from beaver_ftc.diagnosis.detection import filters


class CompiledScheme(NamedTuple):
    """Lazy kernels (compiled.py), called with `fdi` (`diagnosis_dtype`), and `belief` and `measured`, the
    records of the expectation and the sensors. A row of plugins.yaml names
    the scheme: `module`, whose SCHEME it is, or `module:NAME`.

    begin(fdi, belief, measured): start the estimators at the first frame.
    predict(fdi, belief, measured, k, t): bring the estimators from the frame before to frame k at t s.
    conclude(fdi, belief, measured, t): from residuals to the alarm, and from then on to a verdict.
    prepare(fdi, belief, measured, k): prepare the estimators for the next frame.
    accumulate(fdi, belief, measured): add one JSBSim frame inside the next frame.
    """

    begin: Callable[..., None]
    predict: Callable[..., None]
    conclude: Callable[..., None]
    prepare: Callable[..., None]
    accumulate: Callable[..., None]


@apart
def predict_nothing(fdi, belief, measured, k, t):
    """The `predict` of a scheme without estimators."""


@apart
def conclude_nothing(fdi, belief, measured, t):
    """The `conclude` of a scheme without a verdict."""


@apart
def prepare_nothing(fdi, belief, measured, k):
    """The `prepare` of a scheme whose estimators need nothing but the means over the frame."""


@apart
def accumulate_nothing(fdi, belief, measured):
    """The `accumulate` of such a scheme."""


@kernel
def begin_filters(fdi, x):
    """Begin the detection filters at the first measurement x (3,) rad/s."""
    filters.begin_fdae(fdi.fdae, fdi.bound.noise, x)
    filters.begin_bank(fdi.bank, fdi.bound.noise)


@kernel
def update_estimators(fdi, belief):
    """Bring the isolation estimators from the frame before to this one, once the bank has its innovation."""
    config, bound, records, mean = fdi.config, fdi.bound, fdi.isolation, belief.means
    known = fdi.verdict.detected
    isolation.update_hypotheses(records, fdi.bank, bound, config, known, mean.G, mean.Gu, mean.Gu_spread)
    if known:
        isolation.predict_estimators(records, bound, belief.x_before, mean.acceleration, config.dt)


@apart
def begin_none(fdi, belief, measured):
    """Begin the detection filters, which the log records (contract.CompiledScheme)."""
    begin_filters(fdi, measured.x)


NONE = CompiledScheme(
    begin_none, predict_nothing, conclude_nothing, prepare_nothing, accumulate_nothing
)  # fmt: skip
