"""Checks of a fit: collinear regressors, and the autocorrelation of the residual."""

from math import isfinite

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import orders, regression
from beaver_ftc_logs.fit_parts import Parts, one_step_residuals
from beaver_ftc_logs.least_squares import spectral_density, variance_inflation
from beaver_ftc_logs.model import Model

# Regressors are reported if the others inflate the variance of their coefficient more than this.
LEAST_INFLATION = 10.0
_BANDS_HZ = ((0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))


def collinear_regressors(parts: Parts, model: Model) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first. The
    inflation of a regressor is None where the others determine it, or where it is constant."""
    Z, _, _ = orders.stack_data(parts, model.vehicle, model.history, model.lags)
    factors = variance_inflation(Z[:, 1:]).tolist()
    named = zip(factors, regressor_names(model), strict=True)
    return [
        {"regressor": name, "inflation": factor if isfinite(factor) else None}
        for factor, name in sorted(named, key=lambda pair: -pair[0])
        if factor > LEAST_INFLATION
    ]


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order: past rates, past signals, and the
    commands of each group; [-k]: k samples before."""
    h = model.history
    signals = model.vehicle.regressor_columns
    commands = [(f"command of {'+'.join(group)}",) for group in model.groups]
    lagged = [
        ("pqr", h),
        (signals, model.vehicle.n_signal_lags(h)),
        *((command, model.lags) for command in commands),
    ]
    return [f"{name}[-{k}]" for names, n_lags in lagged for k in range(1, n_lags + 1) for name in names]


def median_inflation(parts: Parts, model: Model) -> dict[str, float]:
    """Median factor by which the autocorrelation of the residual enlarges the standard errors of the
    responses, by axis."""
    # The responses are the last rows, `lags` of each group.
    inflation = orders.fit_of(parts, model).standard_error_inflation[-len(model.groups) * model.lags :]
    return regression.by_axis(np.median(inflation, axis=0))


def density_ratios(parts: Parts, model: Model) -> list[Document]:
    """Mean spectral density of the residual by band and axis, over that of white noise of the same variance.

    The frequency 0 is left out, and so is a band that holds none of the frequencies of the density.
    """
    e = one_step_residuals(parts, model)
    f, density = spectral_density(e, model.rate_hz)
    white = e.var(axis=0) / (0.5 * model.rate_hz)
    bands = []
    for lo, hi in _BANDS_HZ:
        inside = (f > lo) & (f <= hi)
        if inside.any():
            ratio = density[inside].mean(axis=0) / white
            bands.append({"from_hz": lo, "to_hz": hi, **regression.by_axis(ratio)})
    return bands
