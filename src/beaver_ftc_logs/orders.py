"""Fit a model of a given order to parts of flights. The Bayesian information criterion chooses the order.

h, L            number of past samples of the rates, and of the commands: the order
Z, y            regressors (n, m) and rates (n, 3), rad/s, each row times the weight of its flight
"""

from itertools import product

import numpy as np
from pydantic import ValidationError

from beaver_ftc_logs import least_squares, regression
from beaver_ftc_logs.fit_parts import Parts, usual_step_s
from beaver_ftc_logs.groups import group_surfaces
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.noise_models import fit_noise_models
from beaver_ftc_logs.recording import Floats, Ints
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.vehicle import Vehicle

RATE_LAGS = (1, 2, 3, 4)  # values of h that are tried
COMMAND_LAGS = (2, 3, 4, 6)  # values of L that are tried
_NEWEY_WEST_S = 2.0  # the standard errors allow for correlated residuals over this time
_MIN_RATE_SD = 1e-6  # rad/s, less than any gyro resolves


def bic_by_order(parts: Parts, vehicle: Vehicle) -> dict[tuple[int, int], float]:
    """The Bayesian information criterion of each number of past samples of rates and commands.

    With N = Z / d, the root mean squares d (m,) of the columns of Z, and the m columns of an order; ^+:
    pseudo-inverse:

        beta = (N' N)^+ N' y,    BIC = n log det((y' y - (N' y)' beta) / n) + 3 m log n

    The regressors of each order are among those of the largest, so N' N and N' y are computed once.
    """
    Z, y, _ = stack_data(parts, vehicle, max(RATE_LAGS), max(COMMAND_LAGS))
    N = Z / least_squares.rms_of_columns(Z)
    NN = N.T @ N
    Ny = N.T @ y
    yy = y.T @ y
    bic = {}
    n = len(y)
    for h, L in product(RATE_LAGS, COMMAND_LAGS):
        cols = _order_columns(vehicle, h, L)
        beta = np.linalg.lstsq(NN[np.ix_(cols, cols)], Ny[cols], rcond=1e-12)[0]
        bic[h, L] = n * np.linalg.slogdet((yy - Ny[cols].T @ beta) / n)[1] + 3 * len(cols) * np.log(n)
    return bic


def _order_columns(vehicle: Vehicle, h: int, L: int) -> Ints:
    """Positions of the regressors of an order among those of the largest order: one, rates by lag, signals by
    lag, commands of each group by lag."""
    n_signals = len(vehicle.regressor_columns)
    max_lag = max(RATE_LAGS)
    rates = np.arange(1 + 3 * max_lag) < 1 + 3 * h
    signals = np.arange(n_signals * vehicle.n_signal_lags(max_lag)) < n_signals * vehicle.n_signal_lags(h)
    commands = np.tile(np.arange(max(COMMAND_LAGS)) < L, len(group_surfaces(vehicle)))
    return np.flatnonzero(np.concatenate([rates, signals, commands]))


def fit_of(parts: Parts, model: Model) -> least_squares.Regression:
    """Least squares of a model's order over all flights."""
    return fitted_order(parts, model.vehicle, model.history, model.lags)[0]


def refit(parts: Parts, model: Model) -> Model:
    """A model of the same order and settings, fitted to other flights. Its noise models take over the
    variance inflation (`wider`) of the given model."""
    refitted = fitted_order(parts, model.vehicle, model.history, model.lags)[1]
    noises = [
        noise.model_copy(update={"wider": model.noise_of(noise.average).wider}) for noise in refitted.colours
    ]
    return refitted.model_copy(update={"settings": model.settings, "colours": noises})


def fitted_order(parts: Parts, vehicle: Vehicle, h: int, L: int) -> tuple[least_squares.Regression, Model]:
    """Least squares of a given order over all flights, and its model. Every test of a model needs the same
    fits to parts of the flights, so each fit is made once and kept in the first part:

        fits: (vehicle as JSON, h, L, the parts) -> (fit, model)
    """
    fits = parts[0].fits
    key = (vehicle.model_dump_json(), h, L, *parts)
    if key not in fits:
        fit = fit_order(parts, vehicle, h, L)
        fits[key] = fit, _model_of_fit(fit, parts, vehicle, h, L)
    return fits[key]


def fit_order(parts: Parts, vehicle: Vehicle, h: int, L: int) -> least_squares.Regression:
    """Least squares of a given order over all parts. Raises BadInput if they have fewer than ten samples a
    coefficient of an axis, or if a rate does not move."""
    Z, y, stretch = stack_data(parts, vehicle, h, L)
    if len(y) < 10 * Z.shape[1]:
        raise refusal(
            "identify",
            f"{len(y)} samples known to be healthy",
            f"at least {10 * Z.shape[1]} to fit {Z.shape[1]} coefficients an axis",
        )
    still = [axis for axis, sd in zip("pqr", y.std(axis=0), strict=True) if sd < _MIN_RATE_SD]
    if still:
        raise refusal("identify", f"rate {still[0]} does not move", "flights in which every rate does")
    return least_squares.fit_ols(Z, y, stretch, round(_NEWEY_WEST_S / usual_step_s(parts)))


def stack_data(parts: Parts, vehicle: Vehicle, h: int, L: int) -> tuple[Floats, Floats, Ints]:
    """Regressors Z (n, m), rates y (n, 3) and number of the gap-free stretch (n,) over all parts, each sample
    times the weight of its flight. Every order leaves out the same first samples of a flight; after a gap, a
    larger order leaves out more.

    Columns of the regressors: one, the past, the commands of each group by lag.
    """
    groups = group_surfaces(vehicle)
    max_lag = max(RATE_LAGS + COMMAND_LAGS)
    Z = []
    y = []
    stretches = []
    for i, part in enumerate(parts):
        f = vehicle.n_signal_lags(h)
        X, U, known = regression.build_regressors(part.samples, groups, h, L, labelled=True, f=f)
        used = part.is_usable & known
        used[:max_lag] = False
        n = len(X)
        weight = part.samples.fit_weight
        Z.append(weight * np.column_stack([np.ones(n), X, U.reshape(n, -1)])[used])
        y.append(weight * part.samples.rates[used])
        stretches.append(np.cumsum(np.diff(np.flatnonzero(used), prepend=0) > 1) + 1_000_000 * i)
    return np.vstack(Z), np.vstack(y), np.concatenate(stretches)


def _model_of_fit(fit: least_squares.Regression, parts: Parts, vehicle: Vehicle, h: int, L: int) -> Model:
    """The model of a fit, with a noise model for each moving average of its flights. Raises BadInput if a
    model file cannot hold a number of the fit."""
    names = list(vehicle.surfaces)
    groups = group_surfaces(vehicle)
    first = len(fit.coefficients) - len(groups) * L
    shape = (len(groups), L, 3)
    try:
        model = Model(
            vehicle=vehicle,
            rate_hz=1.0 / usual_step_s(parts),
            groups=[[names[i] for i in group] for group in groups],
            history=h,
            lags=L,
            intercept=fit.coefficients[0].tolist(),
            past=fit.coefficients[1:first].tolist(),
            response=fit.coefficients[first:].reshape(shape).tolist(),
            response_sd=fit.standard_errors[first:].reshape(shape).tolist(),
            noise=fit.residual_covariance.tolist(),
        )
    except ValidationError as error:
        raise refusal(
            "identify",
            f"no model file can hold the {(*error.errors()[0]['loc'], 'numbers')[0]} of this fit",
            "three rates of which none follows from the others, commands as shares of travel",
        ) from None
    return model.model_copy(update={"colours": fit_noise_models(parts, model)})
