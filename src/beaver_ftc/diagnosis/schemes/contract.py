"""What a compiled scheme is: the contract between the frame and its kernels."""

from collections.abc import Callable
from typing import NamedTuple


class CompiledScheme(NamedTuple):
    """Lazy kernels (compiled.py), called once a frame with `fdi` (diagnosis/scheme.py), and `belief` and
    `measured`, the records of the expectation and the sensors. A row of plugins.yaml names their file.

    predict(fdi, belief): bring the estimator of the unknown acceleration to this frame.
    detect(fdi, belief, measured, t): raise the alarm if a residual exceeds its threshold; t s.
    evaluate(fdi, measured): after an alarm, what the estimator's network gives at this frame.
    """

    predict: Callable[..., None]
    detect: Callable[..., None]
    evaluate: Callable[..., None]
