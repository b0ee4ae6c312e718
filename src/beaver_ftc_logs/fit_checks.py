"""What a reader is told of a fit beside its quality: collinear regressors, and the colour of the residual."""

from math import isfinite

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import orders, regression
from beaver_ftc_logs.least_squares import spectral_density, variance_inflation
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.regression import Parts

LEAST_INFLATION = 10.0
"""Of the variance of a coefficient by the other regressors, from which it is said."""
_BANDS_HZ = ((0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))


def collinear_names(parts: Parts, model: Model) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first; None where
    the others make it up."""
    Z, _, _ = orders.stack_data(parts, model.vehicle, model.history, model.lags)
    factors = variance_inflation(Z[:, 1:]).tolist()
    named = zip(factors, regression.regressor_names(model), strict=True)
    return [
        {"regressor": name, "inflation": factor if isfinite(factor) else None}
        for factor, name in sorted(named, key=lambda pair: -pair[0])
        if factor > LEAST_INFLATION
    ]


def median_inflation(parts: Parts, model: Model) -> dict[str, float]:
    """By how much the residual's colour widens the standard errors of the responses: the median, an axis."""
    inflation = orders.fit_of(parts, model).standard_error_inflation[-len(model.groups) * model.lags :]
    return regression.by_axis(np.median(inflation, axis=0))


def density_ratios(parts: Parts, model: Model) -> list[Document]:
    """Mean density of the residual by band, over that of white noise of the same variance, an axis."""
    e = orders.one_step_residuals(parts, model)
    f, density = spectral_density(e, model.rate_hz)
    white = e.var(axis=0) / (0.5 * model.rate_hz)
    bands = []
    for lo, hi in _BANDS_HZ:
        inside = (f > lo) & (f <= hi)
        if inside.any():
            ratio = density[inside].mean(axis=0) / white
            bands.append({"from_hz": lo, "to_hz": hi, **regression.by_axis(ratio)})
    return bands
