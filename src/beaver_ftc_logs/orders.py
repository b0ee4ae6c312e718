"""Fit a model of a given order to recorded flights, and the noise of its residual.

The fit uses the rows that are known to be healthy. Where labels state the remaining effectiveness, it uses
the faulty rows too, with the commands multiplied by the effectiveness. The Bayesian information criterion
chooses the number of past samples.

    parts           flights, or halves of one, with the samples that the fit may use
    h, L            past samples of the rates, and of the commands
    Z, y            regressors (n, m) and rates (n, 3), rad/s
    e, F, R, W      residual (n, 3), responses (n, G, 3), covariance of the noise (3, 3), whitening matrix, as
                    in `regression`
    ma, ar          moving average of the noise; predictor of a residual from those before
"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from pydantic import ValidationError

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import least_squares, regression
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints, Mask
from beaver_ftc_logs.regression import FitPart, Parts
from beaver_ftc_logs.runs import constant_stretches
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.vehicle import Vehicle

# Labels are good to about a second: what lies nearer to a change is not fitted.
LABEL_MARGIN_S = 1.5
# A label that holds for less is the edge of another.
MIN_LABEL_S = 3.0
RATE_LAGS = (1, 2, 3, 4)  # h and L that are tried
COMMAND_LAGS = (2, 3, 4, 6)
_NEWEY_WEST_S = 2.0  # over which residuals may be correlated
_MIN_RATE_SD = 1e-6  # rad/s, less than any gyro resolves
_FAILURE_MARGIN_S = 1.0  # before a logged failure, that is not fitted
# Samples of the AR predictor in the noise model of a flight: chosen on seeds 11 and 12, in light turbulence,
# and for the evidence that a name needs on seed 11 of a pa28.
AR_ORDER = 20
# Share of the samples of the fit whose responses count as usual.
_USUAL_SHARE = 0.9
RANK_TOLERANCE = 1e-9  # of an eigenvalue over the largest: a smaller one is rounding
# Powers of a group's effect, in variances of the noise in a sample: a smaller one is no motion; a larger one
# counts as the cap, a fiftieth of which is half a standard deviation.
_MIN_EFFECT_POWER = 1e-6
_EFFECT_POWER_CAP = 12.5
# A gain that is known no better than to a third is not known to be there.
GAIN_SD_CAP = 0.33


def fit_parts(flights: Sequence[Samples]) -> list[FitPart]:
    """Each flight, with the samples that are known well enough for the fit."""
    return [FitPart(samples, usable_mask(samples)) for samples in flights]


def usable_mask(samples: Samples) -> Mask:
    """Which samples are known to be healthy, or faulty by a known amount, (n,)."""
    first_s = min((failure.t_s for failure in samples.logged_failures), default=np.inf)
    usable = samples.t_s < first_s - _FAILURE_MARGIN_S
    labelled = np.isfinite(samples.labels).any(axis=0)
    if not labelled.any():
        return usable
    labels = samples.labels[:, labelled]
    usable &= np.isfinite(labels).all(axis=1)
    for begin, end in constant_stretches(labels):
        short = (end - begin) * samples.dt_s < MIN_LABEL_S
        n = round(LABEL_MARGIN_S / samples.dt_s)
        usable[begin : end if short else begin + n] = False
        usable[max(end - n, begin) : end] = False
    return usable


def bic_by_order(parts: Parts, vehicle: Vehicle) -> dict[tuple[int, int], float]:
    """The Bayesian information criterion of each number of past samples of rates and commands.

    Every order's regressors are among those of the largest: one matrix of products serves all. With the
    coefficients C of m regressors on n samples, it is n log det((y' y - (Z' y)' C) / n) + 3 m log n.
    """
    Z, y, _ = stack_data(parts, vehicle, max(RATE_LAGS), max(COMMAND_LAGS))
    X = Z / least_squares.rms_of_columns(Z)
    ZZ = X.T @ X
    Zy = X.T @ y
    yy = y.T @ y
    bic = {}
    n = len(y)
    for h, L in product(RATE_LAGS, COMMAND_LAGS):
        cols = _order_columns(vehicle, h, L)
        C = np.linalg.lstsq(ZZ[np.ix_(cols, cols)], Zy[cols], rcond=1e-12)[0]
        bic[h, L] = n * np.linalg.slogdet((yy - Zy[cols].T @ C) / n)[1] + 3 * len(cols) * np.log(n)
    return bic


def _order_columns(vehicle: Vehicle, h: int, L: int) -> Ints:
    """Columns of the largest design that an order has."""
    n = len(vehicle.regressor_columns)
    max_lag = max(RATE_LAGS)
    rates = np.arange(1 + 3 * max_lag) < 1 + 3 * h
    signals = np.arange(n * vehicle.n_signal_lags(max_lag)) < n * vehicle.n_signal_lags(h)
    commands = np.tile(np.arange(max(COMMAND_LAGS)) < L, len(regression.group_surfaces(vehicle)))
    return np.flatnonzero(np.concatenate([rates, signals, commands]))


def fit_of(parts: Parts, model: Model) -> least_squares.Regression:
    """Least squares of a model's order over all flights."""
    return fitted_order(parts, model.vehicle, model.history, model.lags)[0]


def refit(parts: Parts, model: Model) -> Model:
    """A model of the same order and settings, fitted to other flights."""
    refitted = fitted_order(parts, model.vehicle, model.history, model.lags)[1]
    colours = [
        noise.model_copy(update={"wider": model.noise_of(noise.average).wider}) for noise in refitted.colours
    ]
    return refitted.model_copy(update={"settings": model.settings, "colours": colours})


def fitted_order(parts: Parts, vehicle: Vehicle, h: int, L: int) -> tuple[least_squares.Regression, Model]:
    """Least squares of given order over all flights, and its model. Each fit is made once: every test of a
    model needs the same fits to parts of the flights.

    fits, of the first part: (vehicle as JSON, h, L, id of each part) -> (fit, model, parts).
    """
    fits = parts[0].fits
    key = (vehicle.model_dump_json(), h, L, *map(id, parts))
    if key not in fits:
        fit = fit_order(parts, vehicle, h, L)
        # The entry keeps its parts alive, so that no other object gets the id of one of them.
        fits[key] = fit, _model_of_fit(fit, parts, vehicle, h, L), tuple(parts)
    return fits[key][:2]


def fit_order(parts: Parts, vehicle: Vehicle, h: int, L: int) -> least_squares.Regression:
    """Least squares of given order over all flights."""
    Z, y, stretch = stack_data(parts, vehicle, h, L)
    if len(y) < 10 * Z.shape[1]:
        allowed = f"at least {10 * Z.shape[1]} to fit {Z.shape[1]} coefficients an axis"
        raise BadInput(f"identify: {len(y)} samples known to be healthy, allowed: {allowed}")
    still = [axis for axis, sd in zip("pqr", y.std(axis=0), strict=True) if sd < _MIN_RATE_SD]
    if still:
        raise BadInput(f"identify: rate {still[0]} does not move, allowed: flights in which every rate does")
    dt_s = regression.usual_step_s(parts)
    return least_squares.fit_ols(Z, y, stretch, round(_NEWEY_WEST_S / dt_s))


def stack_data(parts: Parts, vehicle: Vehicle, h: int, L: int) -> tuple[Floats, Floats, Ints]:
    """Regressors, rates and run number over all flights. Every order leaves out the same first samples.

    Columns of the regressors: one, the past, the commands of each group by lag.
    """
    groups = regression.group_surfaces(vehicle)
    max_lag = max(RATE_LAGS + COMMAND_LAGS)
    Z = []
    y = []
    stretches = []
    for i, part in enumerate(parts):
        X, U, known = regression.build_regressors(part.samples, groups, h, L, True, vehicle.n_signal_lags(h))
        used = part.is_usable & known
        used[:max_lag] = False
        n = len(X)
        weight = part.samples.fit_weight
        Z.append(weight * np.column_stack([np.ones(n), X, U.reshape(n, -1)])[used])
        y.append(weight * part.samples.rates[used])
        stretches.append(np.cumsum(np.diff(np.flatnonzero(used), prepend=0) > 1) + 1_000_000 * i)
    return np.vstack(Z), np.vstack(y), np.concatenate(stretches)


def _model_of_fit(fit: least_squares.Regression, parts: Parts, vehicle: Vehicle, h: int, L: int) -> Model:
    """The model file of a fit, with a noise model for each moving average. Raises BadInput where a number
    of the fit is none that a file can hold."""
    names = list(vehicle.surfaces)
    groups = regression.group_surfaces(vehicle)
    first = len(fit.coefficients) - len(groups) * L
    shape = (len(groups), L, 3)
    try:
        model = Model(
            vehicle=vehicle,
            rate_hz=1.0 / regression.usual_step_s(parts),
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
        reason = f"no model file can hold the {error.errors()[0]['loc'][0]} of this fit"
        allowed = "three rates of which none follows from the others, commands as shares of travel"
        raise BadInput(f"identify: {reason}, allowed: {allowed}") from None
    noises = []
    for ma in sorted({part.samples.noise_ma_coefficients for part in parts} - {()}):
        own = parts_of_noise(parts, ma)
        noise = _fit_noise_model(own, model)
        noises.append(_with_errors(own, model, noise) if vehicle.other_laws else noise)
    return model.model_copy(update={"colours": noises})


def parts_of_noise(parts: Parts, ma: Sequence[float]) -> list[FitPart]:
    """The parts that are whitened by this moving average."""
    return [part for part in parts if part.samples.noise_ma_coefficients == tuple(ma)]


def _fit_noise_model(own: Parts, model: Model) -> NoiseModel:
    """The noise of flights of one moving average, with an AR predictor of the residual, by least squares
    where samples follow one another; without a predictor where too few do."""
    ma = list(own[0].samples.noise_ma_coefficients)
    L = AR_ORDER
    runs = [run for part in own for run in part.innovations(model).residual_runs()]
    long = [run for run in runs if len(run) > L]
    if sum(len(run) - L for run in long) < 10 * 3 * L:
        return NoiseModel(average=ma, noise=np.cov(np.vstack(runs).T).tolist())
    Z = np.vstack([np.hstack([run[L - lag : -lag] for lag in range(1, L + 1)]) for run in long])
    y = np.vstack([run[L:] for run in long])
    ar = np.linalg.lstsq(Z, y, rcond=None)[0]
    return NoiseModel(average=ma, before=ar.tolist(), noise=np.cov((y - Z @ ar).T).tolist())


def _with_errors(own: Parts, model: Model, noise: NoiseModel) -> NoiseModel:
    """The noise of some flights with how far a fit may misread the effect of each group in it, as a share,
    (G,): the standard deviation of an error that is anywhere below the largest; and with the power of the
    quick part of the responses that the flights exceed in a tenth of their samples, in variances of the
    noise.

    What the past predicts of a residual is no noise, but what the model lacks. A law that feeds it to the
    surfaces makes it look like their effect. On an axis with the power q of what is lacking and p of the
    effect, both in variances of the noise, the effect is then misread by sqrt(q / p) of itself at most; over
    axes, that least squares weighs by p, by sqrt(sum q p) / sum p. A law that feeds back otherwise shows it.
    """
    flights = [part.innovations(model.model_copy(update={"colours": [noise]})) for part in own]
    r = np.diag(np.array(noise.noise))
    p = np.vstack([centred(flight.F) ** 2 for flight in flights]).mean(axis=0) / r
    q = np.maximum(one_step_residuals(own, model).var(axis=0) / r - 1.0, 0.0)
    misread = np.minimum(np.sqrt(p @ q) / np.maximum(p.sum(axis=1), MIN_DIVISOR), GAIN_SD_CAP)
    powers = np.concatenate([flight.quick_power(model.rate_hz) for flight in flights])
    usual = float(np.quantile(powers, _USUAL_SHARE))
    return noise.model_copy(update={"misreads": (misread / np.sqrt(3.0)).tolist(), "quick": usual})


def centred(values: Floats) -> Floats:
    """Values (n, ...) less their mean over n; none of none."""
    return values - values.mean(axis=0) if len(values) else values


def tied_shares(parts: Parts, model: Model) -> Floats:
    """Share of the effect of each group on the rates that past, signals and the other groups explain, (G,).
    If it is near 1, the law ties the group to the quantities that it controls, and its effect is not
    identifiable; it is 1 if the group never moved. If the effect is far above the noise, the unexplained part
    decides: the share may be larger.

    The effect y = U_g B_g W is in standard deviations of the noise; e = y - Z b is the part that the other
    columns of the fit do not explain."""
    Z, _, _ = stack_data(parts, model.vehicle, model.history, model.lags)
    B = np.array(model.response)
    W = np.linalg.inv(np.linalg.cholesky(np.array(model.noise))).T
    shares = np.ones(len(B))
    for g, columns in enumerate(np.arange(Z.shape[1])[-B.shape[1] * len(B) :].reshape(len(B), -1)):
        y = Z[:, columns] @ B[g] @ W
        y = y - y.mean(axis=0)
        power = float((y**2).sum()) / len(y)
        if power > _MIN_EFFECT_POWER:
            e = least_squares.left_by(np.delete(Z, columns, axis=1), y)
            shares[g] = max(1.0 - float((e**2).sum()) / len(y) / min(power, _EFFECT_POWER_CAP), 0.0)
    return shares


def group_gain_sd(fit: least_squares.Regression, model: Model) -> Floats:
    """Standard error of the gain of each group, (G,), with the colour of the residual. The gain is that of
    the response summed over the lags, weighted by the noise, or, with `other_laws`, the factor of the whole
    response: if the past explains the slow effect of a surface, as alpha does for an elevator, the sum is not
    known, but the factor is.

    A response z with errors of covariance C determines its factor with the variance 1 / (z' C^-1 z), both in
    the standard errors s (L, 3) of the coefficients; b (3,) is the sum over the lags, in standard deviations
    of the noise.
    """
    n = len(model.groups)
    L = model.lags
    first = len(fit.coefficients) - n * L
    sd = np.sqrt(np.maximum(np.diag(fit.residual_covariance), MIN_DIVISOR))
    gain_sd = np.zeros(n)
    for g in range(n):
        rows = slice(first + g * L, first + (g + 1) * L)
        C = fit.coefficient_error_correlation[rows, rows]
        s = fit.standard_errors[rows] / sd
        if model.vehicle.other_laws:
            z = fit.coefficients[rows] / sd / np.maximum(s, MIN_DIVISOR)
            information = np.einsum("la,lm,ma->", z, np.linalg.pinv(C, rcond=RANK_TOLERANCE), z)
            gain_sd[g] = 1.0 / np.sqrt(MIN_DIVISOR + information)
        else:
            b = fit.coefficients[rows].sum(axis=0) / sd
            v = np.einsum("la,lm,ma->a", s, C, s)
            gain_sd[g] = np.sqrt(b**2 @ np.maximum(v, 0.0)) / max(float(b @ b), MIN_DIVISOR)
    return np.minimum(gain_sd, GAIN_SD_CAP)


def one_step_innovations(model: Model, part: FitPart) -> regression.Innovations:
    """The usable samples by a model without its noise models."""
    return part.innovations(model.model_copy(update={"colours": []}))


def one_step_residuals(parts: Parts, model: Model) -> Floats:
    """The residuals of several flights by a model without its noise models, one after the other, (n, 3)."""
    return np.vstack([one_step_innovations(model, part).e for part in parts])
