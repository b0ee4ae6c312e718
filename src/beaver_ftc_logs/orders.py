"""Fit a model of a given order to recorded flights, and the noise of its residual.

The fit uses the rows that are known to be healthy. Where labels state the remaining effectiveness, it uses
the faulty rows too, with the commands multiplied by the effectiveness. The Bayesian information criterion
chooses the number of past samples.

    parts           flights, or halves of one, with the samples that the fit may use
    h, L            number of past samples of the rates, and of the commands
    Z, y            regressors (n, m) and rates (n, 3), rad/s
    G, B            number of groups of surfaces; response of the rates to their commands (G, L, 3), rad/s
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
from beaver_ftc_logs.groups import group_surfaces
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints, Mask
from beaver_ftc_logs.regression import FitPart, Parts
from beaver_ftc_logs.runs import constant_runs
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.vehicle import Vehicle

# A label is exact to about a second: samples nearer to a change than this are not fitted.
LABEL_MARGIN_S = 1.5
# A label that holds for a shorter time belongs to the edge of another, and its samples are not fitted.
MIN_LABEL_S = 3.0
RATE_LAGS = (1, 2, 3, 4)  # values of h that are tried
COMMAND_LAGS = (2, 3, 4, 6)  # values of L that are tried
_NEWEY_WEST_S = 2.0  # the standard errors allow for correlated residuals over this time
_MIN_RATE_SD = 1e-6  # rad/s, less than any gyro resolves
_FAILURE_MARGIN_S = 1.0  # the samples in this time before a logged failure are not fitted
# Number of earlier residuals in the AR predictor of a noise model: chosen on seeds 11 and 12 in light
# turbulence, and, for the evidence that a name needs, on seed 11 of a pa28.
AR_ORDER = 20
# In this share of the samples of the fit, the power of the quick responses counts as usual.
_USUAL_SHARE = 0.9
RANK_TOLERANCE = 1e-9  # an eigenvalue that is smaller, over the largest, is rounding
# Limits of the power of a group's effect, in variances of the noise in a sample. A smaller power is no
# motion. A larger one counts as the cap: the part of it that may remain, a fiftieth (`trust`), is 0.25, the
# square of half a standard deviation.
_MIN_EFFECT_POWER = 1e-6
_EFFECT_POWER_CAP = 12.5
# Largest standard error of a gain: from 0.25 on, `trust.known_gains` no longer takes the gain as known.
GAIN_SD_CAP = 0.33


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


def bic_by_order(parts: Parts, vehicle: Vehicle) -> dict[tuple[int, int], float]:
    """The Bayesian information criterion of each number of past samples of rates and commands.

    With N = Z / d, the root mean squares d (m,) of the columns of Z, and the m columns of an order:

        beta = (N' N)^-1 N' y,    BIC = n log det((y' y - (N' y)' beta) / n) + 3 m log n

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

        fits: (vehicle as JSON, h, L, id of each part) -> (fit, model, parts)
    """
    fits = parts[0].fits
    key = (vehicle.model_dump_json(), h, L, *map(id, parts))
    if key not in fits:
        fit = fit_order(parts, vehicle, h, L)
        # The entry keeps its parts alive, so that no other object gets the id of one of them.
        fits[key] = fit, _model_of_fit(fit, parts, vehicle, h, L), tuple(parts)
    return fits[key][:2]


def fit_order(parts: Parts, vehicle: Vehicle, h: int, L: int) -> least_squares.Regression:
    """Least squares of a given order over all flights. Raises BadInput if they have fewer than ten samples a
    coefficient of an axis, or if a rate does not move."""
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
    """Regressors Z (n, m), rates y (n, 3) and number of the gap-free run (n,) over all flights, each sample
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
        alike = parts_of_noise(parts, ma)
        noise = _fit_noise_model(alike, model)
        noises.append(_with_errors(alike, model, noise) if vehicle.other_laws else noise)
    return model.model_copy(update={"colours": noises})


def parts_of_noise(parts: Parts, ma: Sequence[float]) -> list[FitPart]:
    """The parts that are whitened by this moving average."""
    return [part for part in parts if part.samples.noise_ma_coefficients == tuple(ma)]


def _fit_noise_model(alike: Parts, model: Model) -> NoiseModel:
    """The noise of flights of one moving average, with an AR predictor of the residual from the p before it,
    by least squares on runs of samples without a gap:

        e[k] = [e[k-1] ... e[k-p]] ar + noise,    ar (3 p, 3)

    Without a predictor if the runs have fewer than ten samples a coefficient of an axis.
    """
    ma = list(alike[0].samples.noise_ma_coefficients)
    p = AR_ORDER
    runs = [run for part in alike for run in part.innovations(model).residual_runs()]
    long = [run for run in runs if len(run) > p]
    if sum(len(run) - p for run in long) < 10 * 3 * p:
        return NoiseModel(average=ma, noise=np.cov(np.vstack(runs).T).tolist())
    E = np.vstack([np.hstack([run[p - lag : -lag] for lag in range(1, p + 1)]) for run in long])
    e = np.vstack([run[p:] for run in long])
    ar = np.linalg.lstsq(E, e, rcond=None)[0]
    return NoiseModel(average=ma, before=ar.tolist(), noise=np.cov((e - E @ ar).T).tolist())


def _with_errors(alike: Parts, model: Model, noise: NoiseModel) -> NoiseModel:
    """The noise model of some flights with two more fields:

        misreads (G,)   share by which a fit may misread the effect of each group: m / sqrt(3), the standard
                        deviation of an error that is uniform between -m and m, where m is at most GAIN_SD_CAP
        quick           power of the quick part of the responses that the flights exceed in a tenth of their
                        samples, in variances of the noise

    The part of a residual that the past predicts is no noise: the model lacks it. A law that feeds it back to
    the surfaces makes it look like their effect. Let q be the power of this part on an axis and p that of the
    effect, both in variances of the noise. The effect on this axis is then misread by at most the share
    sqrt(q / p). Least squares weighs the axes by p. m adds their errors as if these were independent,
    m = sqrt(sum q p) / sum p, so it is no bound: if all axes err alike, the share is sum sqrt(q p) / sum p.
    """
    flights = [part.innovations(model.model_copy(update={"colours": [noise]})) for part in alike]
    r = np.diag(np.array(noise.noise))
    p = np.vstack([centred(flight.F) ** 2 for flight in flights]).mean(axis=0) / r
    q = np.maximum(one_step_residuals(alike, model).var(axis=0) / r - 1.0, 0.0)
    misread = np.minimum(np.sqrt(p @ q) / np.maximum(p.sum(axis=1), MIN_DIVISOR), GAIN_SD_CAP)
    powers = np.concatenate([flight.quick_power(model.rate_hz) for flight in flights])
    usual = float(np.quantile(powers, _USUAL_SHARE))
    return noise.model_copy(update={"misreads": (misread / np.sqrt(3.0)).tolist(), "quick": usual})


def centred(values: Floats) -> Floats:
    """Values (n, ...) less their mean over n; an empty array stays as it is."""
    return values - values.mean(axis=0) if len(values) else values


def tied_shares(parts: Parts, model: Model) -> Floats:
    """Share of the effect of each group on the rates that the other columns of the fit explain, (G,):

        f = U_g B_g W less its mean,   u = f - Z b,   share = max(1 - mean |u|^2 / min(mean |f|^2, cap), 0)

    U_g (n, L): columns of the group in the regressors; f, u (n, 3): its effect in standard deviations of the
    noise, and the part that the other columns Z of the fit do not explain. cap: _EFFECT_POWER_CAP.

    If the share is near 1, the law ties the group to the quantities that it controls, and its effect is not
    identifiable. The share is 1 if mean |f|^2 is at most _MIN_EFFECT_POWER: the group never moved. If the
    effect is far above the noise, the power of the unexplained part decides alone, because of the cap.
    """
    Z, _, _ = stack_data(parts, model.vehicle, model.history, model.lags)
    B = np.array(model.response)
    W = np.linalg.inv(np.linalg.cholesky(np.array(model.noise))).T
    shares = np.ones(len(B))
    for g, columns in enumerate(np.arange(Z.shape[1])[-B.shape[1] * len(B) :].reshape(len(B), -1)):
        f = Z[:, columns] @ B[g] @ W
        f = f - f.mean(axis=0)
        power = float((f**2).sum()) / len(f)
        if power > _MIN_EFFECT_POWER:
            u = least_squares.left_by(np.delete(Z, columns, axis=1), f)
            shares[g] = max(1.0 - float((u**2).sum()) / len(f) / min(power, _EFFECT_POWER_CAP), 0.0)
    return shares


def group_gain_sd(fit: least_squares.Regression, model: Model) -> Floats:
    """Standard error of the gain of each group, (G,), from Newey-West standard errors; at most GAIN_SD_CAP.

        s (L, 3)    standard errors of the group's coefficients, in standard deviations of the noise
        C (L, L)    correlation of their errors
        b (3,)      sum of the coefficients over the lags, in standard deviations of the noise
        v (3,)      variance of b: s' C s by axis
        z (L, 3)    coefficients in their standard errors

    The gain is that of the response summed over the lags, with the variance (b^2).v / |b|^4. With
    `other_laws`, it is the factor of the whole response, with the variance 1 / (sum over the axes of z' C^-1
    z): if the past explains the slow effect of a surface, as alpha does for an elevator, the sum over the
    lags is not known, but the factor is.
    """
    G = len(model.groups)
    L = model.lags
    first = len(fit.coefficients) - G * L
    sd = np.sqrt(np.maximum(np.diag(fit.residual_covariance), MIN_DIVISOR))
    gain_sd = np.zeros(G)
    for g in range(G):
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
    """The innovations of the usable samples by a model without its noise models."""
    return part.innovations(model.model_copy(update={"colours": []}))


def one_step_residuals(parts: Parts, model: Model) -> Floats:
    """The residuals of several flights by a model without its noise models, one after the other, (n, 3)."""
    return np.vstack([one_step_innovations(model, part).e for part in parts])
