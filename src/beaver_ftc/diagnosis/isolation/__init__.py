"""Which fault of the class is it? One estimator a hypothesis, and the sets of parameters that fit it."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.isolation.estimators import estimator_names
else:
    __getattr__, __dir__ = lazily(__name__)
