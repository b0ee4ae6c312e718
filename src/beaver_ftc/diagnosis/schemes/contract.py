"""What a compiled scheme is: the contract between the frame and its kernels."""

from collections.abc import Callable
from typing import NamedTuple

from beaver_ftc.compiled import apart


class CompiledScheme(NamedTuple):
    """Lazy kernels (compiled.py), called with `fdi` (diagnosis/scheme.py), and `belief` and `measured`, the
    records of the expectation and the sensors. A row of plugins.yaml names their file.

    begin(fdi, belief, measured): start the estimators at the first frame.
    predict(fdi, belief, measured, k, t): bring the estimators from the frame before to frame k at t s.
    conclude(fdi, belief, measured, t): from residuals to the alarm, and from then on to a verdict.
    prepare(fdi, belief, measured, k): prepare the estimators for the next frame.
    accumulate(fdi, belief, measured): take in one JSBSim frame inside the next frame.
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
