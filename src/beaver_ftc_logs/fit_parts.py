"""The parts of flights to which a model is fitted, and which of their samples the fit may use.

The fit uses the samples that are known to be healthy and, where labels state the remaining effectiveness, the
faulty ones too, with the commands multiplied by the effectiveness.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats, Mask
from beaver_ftc_logs.regression import Innovations, innovations
from beaver_ftc_logs.runs import constant_runs
from beaver_ftc_logs.samples import Samples

# A label is exact to about a second: samples nearer to a change than this are not fitted.
LABEL_MARGIN_S = 1.5
# A label that holds for a shorter time belongs to the edge of another, and its samples are not fitted.
MIN_LABEL_S = 3.0
_FAILURE_MARGIN_S = 1.0  # the samples in this time before a logged failure are not fitted


@dataclass(frozen=True, eq=False)
class FitPart:
    """A flight (or half of one) and which of its samples the fit may use, is_usable (n,).

    fits: the cache of `orders.fitted_order`: fits to lists of parts that begin with this one.
    """

    samples: Samples
    is_usable: Mask
    fits: dict[Any, Any] = field(default_factory=dict, repr=False)

    @cached_property
    def halves(self) -> tuple["FitPart", "FitPart"]:
        """The usable samples in two halves."""
        rows = np.flatnonzero(self.is_usable)
        middle = int(rows[len(rows) // 2]) if len(rows) else 0
        is_first = np.arange(len(self.is_usable)) < middle
        first = FitPart(self.samples, self.is_usable & is_first)
        return first, FitPart(self.samples, self.is_usable & ~is_first)

    def innovations(self, model: Model) -> Innovations:
        """The innovations of the usable samples by a model. Commands are multiplied by the labelled
        effectiveness."""
        flight = innovations(self.samples, model, labelled=True)
        return flight.at(np.flatnonzero(self.is_usable & flight.is_known))

    def one_step_innovations(self, model: Model) -> Innovations:
        """The same by a model without its noise models."""
        return self.innovations(model.model_copy(update={"colours": []}))


Parts = Sequence[FitPart]


def usual_step_s(parts: Parts) -> float:
    """The usual step of the samples of all flights, s."""
    return float(np.median([part.samples.dt_s for part in parts]))


def one_step_residuals(parts: Parts, model: Model) -> Floats:
    """The residuals of several flights by a model without its noise models, one after the other, (n, 3)."""
    return np.vstack([part.one_step_innovations(model).e for part in parts])


def fit_parts(flights: Sequence[Samples]) -> list[FitPart]:
    """Each flight, with the samples that are known well enough for the fit."""
    return [FitPart(samples, usable_mask(samples)) for samples in flights]


def usable_mask(samples: Samples) -> Mask:
    """Which samples are known to be healthy, or faulty by a known amount, (n,): those before the first logged
    failure and, if a surface has labels, those with all these labels, away from their changes and from the
    ends of the flight, in stretches of at least MIN_LABEL_S."""
    first_s = min((failure.t_s for failure in samples.logged_failures), default=np.inf)
    usable = samples.t_s < first_s - _FAILURE_MARGIN_S
    labelled = np.isfinite(samples.labels).any(axis=0)
    if not labelled.any():
        return usable
    labels = samples.labels[:, labelled]
    usable &= np.isfinite(labels).all(axis=1)
    for begin, end in constant_runs(labels):
        short = (end - begin) * samples.dt_s < MIN_LABEL_S
        n = round(LABEL_MARGIN_S / samples.dt_s)
        usable[begin : end if short else begin + n] = False
        usable[max(end - n, begin) : end] = False
    return usable
