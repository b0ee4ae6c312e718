"""Fit: from recorded flights to a model, with how well it is known and how it does elsewhere.

The fit uses the rows that are known to be healthy. Where labels state the remaining effectiveness, it uses
the faulty rows too, with the commands multiplied by the effectiveness. The Bayesian information criterion
chooses the number of past samples. Every figure of merit comes from held-out data, which the fit did not use:
the two halves of a single flight in turn, or each of several flights in turn.

    parts, rest     flights, or halves of one, with the samples that the fit may use; those that are left out
    fold            model that was fitted without `rest`
    h, L            past samples of the rates, and of the commands
    Z, y            regressors (n, m) and rates (n, 3), rad/s
    e, F, R, W      residual (n, 3), responses (n, G, 3), covariance of the noise (3, 3), whitening matrix, as
                    in `regression`; after `_standardized`, e and F (n, 3, G, 3) are in standard deviations
    ma, ar          moving average of the noise; predictor of a residual from those before
    r               variance of the noise
    g, S            error of the groups' gains (G,), and their covariance that the filter leaves free (G, G)
    known           which groups have an effect that is known (G,)
"""

from collections.abc import Iterator, Sequence
from itertools import groupby, product
from typing import NamedTuple

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, least_squares, regression, trust
from beaver_ftc_logs.bank import build_bank, build_states
from beaver_ftc_logs.diagnose import rows_of_posterior
from beaver_ftc_logs.filtering import (
    bank_posterior,
    fault_evidence,
    page_cusum,
    recent_scale,
)
from beaver_ftc_logs.model import FilterSettings, FittedRanges, Model, NoiseModel
from beaver_ftc_logs.recording import MIN_DIVISOR, Floats, Ints, Mask
from beaver_ftc_logs.regression import FitPart, Parts
from beaver_ftc_logs.runs import constant_stretches, runs_between
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.scoring import score_against_labels
from beaver_ftc_logs.vehicle import Vehicle

LABEL_MARGIN_S = 1.5
"""Labels are good to about a second: what lies nearer to a change is not fitted."""
MIN_LABEL_S = 3.0
"""A label that holds for less is the edge of another."""
RATE_LAGS = (1, 2, 3, 4)
COMMAND_LAGS = (2, 3, 4, 6)
_NEWEY_WEST_S = 2.0
_MIN_RATE_SD = 1e-6
_FAILURE_MARGIN_S = 1.0
_POWER_UNLABELLED = 0.9
"""Where no labels say how often things break, an alarm asks for more: for how much, the benchmark decided.
With parts enough that are not fitted, the rate of false alarms decides instead."""
_DEFAULT_FALSE_ALARMS = 1.0
_TRIM_SPANS_S = (2.0, 8.0)
"""Spans whose means tell the drift of the trim from the residual's colour."""
_POWER_LABELLED = 0.8
"""A coloured residual tells less than a white one: by how much, blocked tests decided."""
_OTHER_DAYS: Document = {
    "trim_sd": 0.1,
    "trim_shift": 0.03,
    "trim_walk": [2.5e-3, 6e-4, 2e-3],
    "gain_sd": 0.1,
    "gain_time_s": 300.0,
    "own_gain_sd": 0.03,
}
"""How far another day may be: chosen on days drawn from one flight, judged on others (`--other-days`). The
drift of the trim is what the means of the residual over 30 s show in that flight."""
_OTHER_LAWS: Document = {
    "own_gain_sd": 0.05,
    "own_gain_time_s": 20.0,
    "name_evidence": 2.0,
    "rename_s": 1.0,
    "one_group": True,
    "bounds": 0.97,
}
"""How far each group's gain wanders under a law and air that the fit has not seen (a law that answers what is
not modelled ties the command to it), and what a name asks for then. Chosen on simulated flights
(`own_logs.py`, seeds 1 to 6).

bounds: the posterior mass of 90 % bounds where no labels choose it. For a second or two after a loss most of
the mass still claims health: 0.9 of it held the truth at the fault in 0.70 to 0.94 of the samples, fewest of
large losses; 0.97 in 0.83 to 0.99, on seeds 401 to 403, which chose it."""
_MOVING_AIR: Document = {"own_gain_sd": 0.08, "own_gain_time_s": 100.0}
_GAIN_WINDOW_S, AR_ORDER = 10.0, 20
"""Whitened by the flight's own noise model and an AR predictor of so many samples; gains differ by flight
rather than within it: chosen on seeds 11 and 12, in light turbulence; what a name asks for on a pa28's
seed 11."""
_POWER_OTHER_LAWS, _LORDEN_FACTOR = 0.4, 2.0
"""A law may feed a gyro's noise to the surfaces, which doubles the residual of one that does not: a sample
then tells less than the fit knows. And so many times the evidence of theory raises an alarm. Chosen in the
same way, the first on seed 1 of five aircraft."""
_GYRO_FACTOR, _GUST_FACTOR = 1.7, 2.5
"""In moving air the noise of another law's flight is so many times wider, gyros' or gusts', for gains too.
Chosen on seeds 71, 73 and 101 to 106: 3 of 240 healthy flights alarmed, and with no such factor 6 of 150."""
_MAX_INFLATION = 200.0
"""Largest noise factor of a window of ten seconds: of few flights one can be far from all others (1,550 of
seed 205, else 5)."""
_DELAYS_SAMPLES = (-0.4, 0.0, 0.4)
"""Delays beside the model's that a flight may have, in samples."""
_USUAL_SHARE = 0.9
"""Share of the samples of the fit whose responses count as usual."""
_MIN_QUICK_SAMPLES = 10
"""Samples with quick responses that a flight must have, for the mean of their errors."""
_RANK_TOLERANCE = 1e-9
_MIN_EFFECT_POWER, _EFFECT_POWER_CAP = 1e-6, 12.5
"""Of an effect of so many variances of the noise a sample, a fiftieth is half a standard deviation."""
_MAX_SPLITS, _GAIN_SD_CAP = 12, 0.33
"""A gain that is known no better than to a third is not known to be there."""
_N_PRIOR_CHANGES = 20
"""Changes that count as seen before the labels are read, half of them repairs."""
_CREDIBLE_MASSES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
_COVERAGE_GOAL = 0.93
"""Coverage the bounds aim at: 90 % and some of what another day takes away."""


def fit_parts(flights: Sequence[Samples]) -> list[FitPart]:
    """Return each flight with the samples that are known well enough for the fit."""
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


def fit_model(parts: Parts, vehicle: Vehicle, settings: FilterSettings | None = None) -> Model:
    """The model that fits these flights. Raises BadInput where there is too little to fit."""
    bic = bic_by_order(parts, vehicle)
    model = _fitted(parts, vehicle, *min(bic, key=lambda order: bic[order]))[1]
    model = model.model_copy(update={"settings": settings or estimate_filter_settings(parts, model)})
    return _with_inflated_noise(parts, model) if model.colours else model


def refit(parts: Parts, model: Model) -> Model:
    """A model of the same order and settings, fitted to other flights."""
    refitted = _fitted(parts, model.vehicle, model.history, model.lags)[1]
    colours = [
        noise.model_copy(update={"wider": model.noise_of(noise.average).wider}) for noise in refitted.colours
    ]
    return refitted.model_copy(update={"settings": model.settings, "colours": colours})


class Fold(NamedTuple):
    """A part that is left out, its name, the model that is fitted to the others, with the standard errors of
    its gains, and these."""

    model: Model
    held_out: FitPart
    name: str
    fitted: Parts

    def innovations(self) -> regression.Innovations:
        """The samples in use of the part left out, by the model of the others."""
        return self.held_out.innovations(self.model)


def held_out_folds(parts: Parts, model: Model, most: int | None = _MAX_SPLITS) -> Iterator[Fold]:
    """The folds, of more than `most` flights every so many at once."""
    tied = tied_shares(parts, model).tolist()
    for fitted, held_out, name in validation_folds(parts, most):
        gain_sd = group_gain_sd(fit_of(fitted, model), model).tolist()
        ranges = FittedRanges(commands=[], rates=[], gain_sd=gain_sd, tied=tied)
        yield Fold(refit(fitted, model).model_copy(update={"fitted": ranges}), held_out, name, fitted)


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
    bic, n = {}, len(y)
    for h, L in product(RATE_LAGS, COMMAND_LAGS):
        cols = _order_columns(vehicle, h, L)
        C = np.linalg.lstsq(ZZ[np.ix_(cols, cols)], Zy[cols], rcond=1e-12)[0]
        bic[h, L] = n * np.linalg.slogdet((yy - Zy[cols].T @ C) / n)[1] + 3 * len(cols) * np.log(n)
    return bic


def _order_columns(vehicle: Vehicle, h: int, L: int) -> Ints:
    """Columns of the largest design that an order has."""
    n, most = len(vehicle.regressor_columns), max(RATE_LAGS)
    rates = np.arange(1 + 3 * most) < 1 + 3 * h
    signals = np.arange(n * vehicle.n_signal_lags(most)) < n * vehicle.n_signal_lags(h)
    commands = np.tile(np.arange(max(COMMAND_LAGS)) < L, len(regression.group_surfaces(vehicle)))
    return np.flatnonzero(np.concatenate([rates, signals, commands]))


def fit_of(parts: Parts, model: Model) -> least_squares.Regression:
    """Least squares of a model's order over all flights."""
    return _fitted(parts, model.vehicle, model.history, model.lags)[0]


def _fitted(parts: Parts, vehicle: Vehicle, h: int, L: int) -> tuple[least_squares.Regression, Model]:
    """Least squares of given order over all flights, and its model: made once, since every test of a model
    needs the same fits to parts of them."""
    fits, key = parts[0].fits, (vehicle.model_dump_json(), h, L, *map(id, parts))
    if key not in fits:
        fit = fit_order(parts, vehicle, h, L)
        # with the parts, which are held: an id is of one object
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
    """Regressors, rates and run number over all flights; the same first samples are left out
    for any order.

    Columns of the regressors: one, the past, the commands of each group by lag.
    """
    groups = regression.group_surfaces(vehicle)
    most = max(RATE_LAGS + COMMAND_LAGS)
    Z, y, stretches = [], [], []
    for i, part in enumerate(parts):
        X, U, known = regression.build_regressors(part.samples, groups, h, L, True, vehicle.n_signal_lags(h))
        used = part.is_usable & known
        used[:most] = False
        n, weight = len(X), part.samples.fit_weight
        Z.append(weight * np.column_stack([np.ones(n), X, U.reshape(n, -1)])[used])
        y.append(weight * part.samples.rates[used])
        stretches.append(np.cumsum(np.diff(np.flatnonzero(used), prepend=0) > 1) + 1_000_000 * i)
    return np.vstack(Z), np.vstack(y), np.concatenate(stretches)


def _model_of_fit(fit: least_squares.Regression, parts: Parts, vehicle: Vehicle, h: int, L: int) -> Model:
    names = list(vehicle.surfaces)
    groups = regression.group_surfaces(vehicle)
    first = len(fit.coefficients) - len(groups) * L
    shape = (len(groups), L, 3)
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
    noises = []
    for ma in sorted({part.samples.noise_ma_coefficients for part in parts} - {()}):
        own = _parts_in(parts, ma)
        noise = _fit_noise_model(own, model)
        noises.append(_with_errors(own, model, noise) if vehicle.other_laws else noise)
    return model.model_copy(update={"colours": noises})


def _parts_in(parts: Parts, ma: Sequence[float]) -> list[FitPart]:
    """The parts that are whitened by this moving average."""
    return [part for part in parts if part.samples.noise_ma_coefficients == tuple(ma)]


def quick_error_share(parts: Parts, model: Model) -> float:
    """Estimate the error of unusually quick responses, as a share of them, at most 1: the largest of the
    flights left out; 1 if none of them has such responses enough.

    In variances of the noise of the fit, the residual of a sample has the variance r (1 + share^2 power),
    with the variance r of the noise of this flight and the power of the quick responses.
    """
    shares = []
    for fold in held_out_folds(parts, model):
        flight = fold.innovations()
        power = flight.quick_power(fold.model.rate_hz)
        unusual = power > flight.noise.usual_quick_power
        if unusual.sum() >= _MIN_QUICK_SAMPLES:
            squares = ((flight.e - np.median(flight.e, axis=0)) @ flight.W) ** 2
            r = max(least_squares.noise_scale(squares), 1.0)
            shares.append(((squares[unusual].mean(axis=1) / r - 1.0) / power[unusual]).mean())
    return float(np.sqrt(np.clip(max(shares, default=1.0), 0.0, 1.0)))


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
    p = np.vstack([_centred(flight.F) ** 2 for flight in flights]).mean(axis=0) / r
    q = np.maximum(one_step_residuals(own, model).var(axis=0) / r - 1.0, 0.0)
    most = np.minimum(np.sqrt(p @ q) / np.maximum(p.sum(axis=1), MIN_DIVISOR), _GAIN_SD_CAP)
    powers = np.concatenate([flight.quick_power(model.rate_hz) for flight in flights])
    usual = float(np.quantile(powers, _USUAL_SHARE))
    return noise.model_copy(update={"misreads": (most / np.sqrt(3.0)).tolist(), "quick": usual})


def _fit_noise_model(own: Parts, model: Model) -> NoiseModel:
    """The noise of flights of one moving average, with an AR predictor of the residual, by least squares
    where samples follow one another; without a predictor where too few do."""
    ma, L = list(own[0].samples.noise_ma_coefficients), AR_ORDER
    runs = [run for part in own for run in part.innovations(model).residual_runs()]
    long = [run for run in runs if len(run) > L]
    if sum(len(run) - L for run in long) < 10 * 3 * L:
        return NoiseModel(average=ma, noise=np.cov(np.vstack(runs).T).tolist())
    Z = np.vstack([np.hstack([run[L - lag : -lag] for lag in range(1, L + 1)]) for run in long])
    y = np.vstack([run[L:] for run in long])
    ar = np.linalg.lstsq(Z, y, rcond=None)[0]
    return NoiseModel(average=ma, before=ar.tolist(), noise=np.cov((y - Z @ ar).T).tolist())


def estimate_filter_settings(parts: Parts, model: Model) -> FilterSettings:
    """Estimate the settings of later faults from the flights: levels seen, and how often they changed."""
    moving, other_laws = model.vehicle.moving_air, model.vehicle.other_laws
    extra: Document = {"delays_s": [d / model.rate_hz for d in ((0.0,) if moving else _DELAYS_SAMPLES)]}
    if other_laws:
        extra |= _OTHER_LAWS | (_MOVING_AIR if moving else {})
        if model.colours:
            extra["quick_error"] = quick_error_share(parts, model)
    surfaces = list(model.vehicle.surfaces)
    alone = [group[0] for group in model.groups if len(group) == 1]
    labelled = {name: _label_levels(parts, surfaces.index(name)) for name in alone}
    faults = {name: {level for one in each for level in one if level < 1} for name, each in labelled.items()}
    if levels := {name: sorted(seen) for name, seen in faults.items() if seen}:
        changed_to = [level for each in labelled.values() for one in each for level in one[1:]]
        n, hours = len(changed_to), sum(part.is_usable.sum() * part.samples.dt_s for part in parts) / 3600.0
        # A flight may be tested less hard than these: the rate is the geometric mean of theirs and the usual.
        rate = np.sqrt((n + 1) / hours * FilterSettings().changes_per_hour)
        repair_share = (changed_to.count(1.0) + _N_PRIOR_CHANGES / 2) / (n + _N_PRIOR_CHANGES)
        seen = {"levels": levels, "changes_per_hour": float(rate), "repair_share": repair_share}
        return FilterSettings(**(_OTHER_DAYS | extra | seen), power=_POWER_LABELLED)
    extra |= {"trim_walk": _estimate_trim_walk(parts, model)}
    drifting = model.model_copy(update={"settings": FilterSettings(**extra)})
    most = (1.0 if moving else _POWER_OTHER_LAWS) if other_laws else _POWER_UNLABELLED
    return FilterSettings(**extra, power=min(most, 1.0 / gain_overdispersion(parts, drifting)))


def _label_levels(parts: Parts, i: int) -> list[list[float]]:
    """The levels of one surface's label in their order, edges left out, of each flight."""
    labels = [part.samples.labels[:, i][part.is_usable] for part in parts]
    return [[round(level, 6) for level, _ in groupby(one[np.isfinite(one)].tolist())] for one in labels]


def gain_overdispersion(parts: Parts, model: Model) -> float:
    """Estimate how many times as far, in squares, the gains of parts left out are from 1 as the filter
    believes.

    Residuals e = F (g - 1) + noise of a part give the gains g of its groups, least squares with trims aside.
    Were the noise white and flights alike, the squares of g - 1 in the covariance (F' F)^-1 + S would be as
    many as gains, on average; S is what the filter leaves free. What flights differ in and colour make more:
    so much less does a sample tell of an effectiveness [McCullagh1989, section 4.5]. One part counts as seen
    that is as believed.
    """
    errors = [(float(len(model.groups)), len(model.groups))]
    for fold in held_out_folds(parts, model):
        errors += _gain_errors(fold)
    total, n = np.sum(errors, axis=0)
    return float(total / n)


def _gains(F: Floats, e: Floats) -> tuple[Floats, Floats, Floats]:
    """Information F' F of errors g of gains, what the residual says of them, F' e, and g by least squares, of
    e (n, 3) = F g + noise, F (n, 3, m)."""
    X = F.reshape(e.size, F.shape[2])
    FF, Fe = X.T @ X, X.T @ e.ravel()
    return FF, Fe, np.asarray(np.linalg.lstsq(FF, Fe, rcond=_RANK_TOLERANCE)[0])


def _gain_errors(fold: Fold, window_s: float | None = None, loudness: float = 1.0) -> list[tuple[float, int]]:
    """Squares of the errors g of the groups' gains that a part left out tells, in their covariance and what
    the filter leaves free, S, and how many gains there are; of each window, with a gain for each axis of an
    answer, where there are windows. loudness: variance of the noise, where the filter itself widens it.

        g = (F' F)^-1 F' e,    square = g' ((F' F)^-1 + S)^-1 g = (F' e)' (1 + S F' F)^-1 g
    """
    known = trust.known_effects(fold.model)
    flight = fold.innovations()
    F, e = _standardized(fold.model, flight)
    if not len(e):  # a part without a residual shows no gain
        return []
    P = build_states(fold.model, flight.noise).initial_covariance[3:, 3:]
    S = P[0, 0] + np.diag(np.diag(P)[1:][known])
    F, n = F[:, :, known], 1
    if window_s is None:
        F = F.sum(axis=3)
    else:
        F, S = F.reshape(*e.shape, -1), np.kron(S, np.ones((3, 3)))
        n = max(round(len(e) * fold.held_out.samples.dt_s / window_s), 1)
    errors = []
    for rows in np.array_split(np.arange(len(e)), n):
        FF, Fe, g = _gains(*(_centred(values[rows]) / np.sqrt(loudness) for values in (F, e)))
        A = np.eye(len(g)) + S @ FF  # singular by rounding where nothing tells a gain
        error = max(float(Fe @ np.linalg.lstsq(A, g, rcond=_RANK_TOLERANCE)[0]), 0.0)
        errors.append((error, int(np.linalg.matrix_rank(FF, tol=_RANK_TOLERANCE * np.trace(FF)))))
    return errors


def _with_inflated_noise(parts: Parts, model: Model) -> Model:
    """The model with the noise of each colour so many times wider as the gains of ten seconds left out, each
    axis of an answer with its own, are farther from 1, in squares, than it and the filter let them be: quiet
    gyros show what the model itself lacks."""
    windows: dict[tuple[float, ...], list[float]] = {}
    for fold in held_out_folds(parts, model):
        loudness = _loudness(fold, fold.fitted if len(parts) > 1 else parts)
        errors = _gain_errors(fold, _GAIN_WINDOW_S, loudness)
        found = windows.setdefault(fold.held_out.samples.noise_ma_coefficients, [])
        found.extend(min(error / max(n, 1), _MAX_INFLATION) for error, n in errors)
    colours = []
    for noise in model.colours:
        ma, wider = tuple(noise.average), 1.0
        if windows.get(ma):
            wider = max(float(np.mean(windows[ma])), 1.0)
            if model.vehicle.other_laws:
                # a gyro's noise takes from the next sample what it added to one
                wider *= _GYRO_FACTOR if len(ma) > 1 and ma[1] < 0.0 else _GUST_FACTOR
        colours.append(noise.model_copy(update={"wider": wider}))
    return model.model_copy(update={"colours": colours})


def _loudness(fold: Fold, others: Parts) -> float:
    """How many times as wide the filter finds the noise of a flight left out as that of the loudest other
    flight of the same noise; 1 if it is within the range of these, or under the same law. What the filter
    widens by itself (`recent_scale`) is not counted again."""
    model, ma = fold.model, fold.held_out.samples.noise_ma_coefficients
    if not model.vehicle.other_laws:
        return 1.0

    def scale(part: FitPart) -> float:
        _, e = _standardized(model, part.innovations(model))
        scales = recent_scale(e, np.ones(len(e), dtype=bool), model.rate_hz)
        return float(scales.mean()) if len(scales) else 1.0

    return max(scale(fold.held_out) / max([1.0, *map(scale, _parts_in(others, ma))]), 1.0)


def _standardized(model: Model, flight: regression.Innovations) -> tuple[Floats, Floats]:
    """Return the effect F (n, 3, G, 3) of each axis of each group's answer on the residuals of a flight, and
    those e (n, 3), both in sd of the noise, without means; where responses are quick, q times that."""
    sd = np.sqrt(flight.noise.wider * flight.quick_scale(model))[:, None]
    F = np.einsum("nga,ab->nbga", flight.F, flight.W)
    return _centred(F) / sd[:, :, None, None], _centred(flight.e @ flight.W) / sd


def _centred(values: Floats) -> Floats:
    """Values (n, ...) less their mean over n; none of none."""
    return values - values.mean(axis=0) if len(values) else values


def _estimate_trim_walk(parts: Parts, model: Model) -> list[float]:
    """Drift of the trim a sample, in residual sd, that parts left out show; the usual at least.

    Means of n samples of a random walk, with steps of variance w, and of noise whose mean has the variance
    c / n differ from the next with the variance v = 2 c / n + 2 n w / 3: two n tell w from c.
    """
    flights = [fold.innovations() for fold in held_out_folds(parts, model)]
    runs = [(run, np.diag(flight.R)) for flight in flights for run in flight.residual_runs()]

    def squared_steps(n: int) -> Floats:
        means = ((run[: len(run) // n * n].reshape(-1, n, 3).mean(axis=1), r) for run, r in runs)
        return np.vstack([np.diff(mean, axis=0) ** 2 / np.maximum(r, MIN_DIVISOR) for mean, r in means])

    n1, n2 = (round(span_s * model.rate_hz) for span_s in _TRIM_SPANS_S)
    short, long = squared_steps(n1), squared_steps(n2)
    usual = np.array(FilterSettings().trim_walk)
    if not len(short) or not len(long):
        return usual.tolist()
    v1, v2 = short.mean(axis=0), long.mean(axis=0)
    w = 1.5 * (n2 * v2 - n1 * v1) / (n2**2 - n1**2)
    return np.maximum(np.sqrt(np.maximum(w, 0.0)), usual).tolist()


def validation_folds(parts: Parts, most: int | None = None) -> list[tuple[list[FitPart], FitPart, str]]:
    """Return the fitted flights, the held-out one and its name: halves of one flight; each flight in turn, of
    more than `most` every so many at once."""
    if len(parts) == 1:
        first, second = parts[0].halves
        return [([first], second, "second half"), ([second], first, "first half")]
    n = min(len(parts), most or len(parts))
    return [
        ([part for i, part in enumerate(parts) if i % n != k], one, one.samples.name)
        for k in range(n)
        for one in parts[k::n]
    ]


def add_ranges_and_threshold(parts: Parts, model: Model) -> Model:
    """The model with what it was fitted on, and how it did on parts that were left out in turn: at which
    evidence of a fault they would alarm as often as the vehicle file asks for, or as is usual. Raises
    BadInput if they are too short to tell that."""
    folds = list(held_out_folds(parts, model))
    peaks = [_healthy_peaks(fold) for fold in folds]
    variance = group_gain_sd(fit_of(parts, model), model) ** 2
    if model.vehicle.other_laws:
        # how far another flight's gains are at most before any is left out counts as one flight
        hidden = [noise.misreads for noise in model.colours] or [[0.0] * len(model.groups)]
        deviations = [_squared_deviations(fold) for fold in folds] if len(parts) > 1 else []
        variance += np.nanmean([3.0 * np.max(hidden, axis=0) ** 2, *deviations], axis=0)
    gain_sd = np.minimum(np.sqrt(variance), _GAIN_SD_CAP)
    tail = extremes.fit_peak_tail(peaks)
    ranges = trust.compute_fitted_ranges(parts, tied_shares(parts, model), gain_sd).model_copy(
        update={"tail": tail}
    )
    requested = model.vehicle.false_alarms_per_hour
    if tail is None and requested is not None:
        minutes = 60.0 * sum(hours for _, hours in peaks)
        reason = f"{minutes:.1f} min of health left out have too few peaks of the evidence to tell"
        allowed = f"{extremes.RULED_OUT_COUNT * 60.0 / requested - minutes:.0f} min more"
        raise BadInput(f"identify: false_alarms_per_hour {requested:g}: {reason}, allowed: {allowed}")
    rate = _DEFAULT_FALSE_ALARMS if requested is None and not model.settings.levels else requested
    threshold = _choose_threshold(tail, rate, model) if rate else None
    alarm = {"false_alarms_per_hour": rate, "threshold": threshold}
    return model.model_copy(
        update={
            "fitted": ranges,
            "settings": model.settings.model_copy(update=alarm),
            "identified": _cross_validate(peaks, rate, model),
        }
    )


def _squared_deviations(fold: Fold) -> Floats:
    """Squares of how far the groups' gains are from 1 in a flight left out, beyond the noise's share, (G,);
    nan of a group whose effect it does not show."""
    F, e = _standardized(fold.model, fold.innovations())
    F = F.sum(axis=3)
    squares = np.full(F.shape[2], np.nan)
    known = trust.known_effects(fold.model) & F.any(axis=(0, 1))
    if known.any():  # a part without a residual shows the effect of no group
        FF, _, g = _gains(F[:, :, known], e)
        P = np.linalg.pinv(FF, rcond=_RANK_TOLERANCE, hermitian=True)
        squares[known] = np.maximum(g**2 - np.diag(P) * max(float((e**2).mean()), 1.0), 0.0)
    return squares


def _choose_threshold(tail: extremes.PeakTail | None, target: float, model: Model) -> float:
    """Threshold for `target` false alarms an hour: by the tail, or by theory if there is no tail. Under laws
    of which the parts left out say nothing, by theory if that asks for more."""
    factor = 1.0 if tail is None or model.vehicle.other_laws else 0.0
    if model.vehicle.other_laws and not model.vehicle.moving_air:
        factor = _LORDEN_FACTOR
    least = factor * extremes.lorden_threshold(model.rate_hz, target)
    return max(extremes.threshold_for_rate(tail, target), least) if tail is not None else least


def _cross_validate(
    flights: Sequence[extremes.PeaksAndHours], target: float | None, model: Model
) -> Document:
    """Test the threshold on parts left out: how many would have alarmed, each at the threshold that the
    others ask for, and how often."""
    tails = [extremes.fit_peak_tail([*flights[:i], *flights[i + 1 :]]) for i in range(len(flights))]
    if target is None or len(flights) < 2 or not all(tails):
        return {}
    pairs = zip(flights, tails, strict=True)
    counts = [int((peaks >= _choose_threshold(tail, target, model)).sum()) for (peaks, _), tail in pairs]
    return {
        "parts": len(flights),
        "minutes": 60.0 * sum(hours for _, hours in flights),
        "alarmed": sum(n > 0 for n in counts),
        "alarms": sum(counts),
    }


def _healthy_peaks(fold: Fold) -> extremes.PeaksAndHours:
    """Return for a part left out the peaks of the alarm statistic in health, and its healthy hours."""
    bank, samples = build_bank(fold.model), fold.held_out.samples
    p = bank_posterior(samples, fold.model, bank)
    z = fault_evidence(p, bank)
    answers = p[:, -1] < 0.5
    rows = np.flatnonzero(fold.held_out.is_usable & ~(samples.labels < 1.0).any(axis=1) & answers)
    runs = [page_cusum(z[rows[begin:end]], np.inf) for begin, end in runs_between(np.diff(rows) > 1)]
    peaks = np.concatenate([extremes.peaks_between_zeros(cusum) for cusum in runs])
    return peaks, len(rows) * samples.dt_s / 3600.0


def tied_shares(parts: Parts, model: Model) -> Floats:
    """Share of each group's effect on the rates that past, signals and the other groups make up, (G,): where
    it is near 1 the law ties the group to what it answers to, and its effect cannot be told; 1 where the
    group never moved. An effect far above the noise may be made up to a larger share: what is left counts.

    The effect y = U_g B_g W is in standard deviations of the noise, e = y - Z b what the other columns of the
    fit do not make up of it."""
    Z, _, _ = stack_data(parts, model.vehicle, model.history, model.lags)
    B, W = np.array(model.response), np.linalg.inv(np.linalg.cholesky(np.array(model.noise))).T
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
    """Standard error of each group's gain, (G,), colour included: of its response summed over lags, along
    itself, weighed by the noise; for `other_laws` of the factor of the whole response. Where a surface's slow
    effect is made up by the past, as an elevator's by alpha, its sum is not known, and its factor is.

    Responses z with errors of covariance C tell their factor with the variance 1 / (z' C^-1 z), both in the
    standard errors s (L, 3) of the coefficients; b (3,) is the sum over lags, in sd of the noise.
    """
    n, L = len(model.groups), model.lags
    first = len(fit.coefficients) - n * L
    sd = np.sqrt(np.maximum(np.diag(fit.residual_covariance), MIN_DIVISOR))
    gain_sd = np.zeros(n)
    for g in range(n):
        rows = slice(first + g * L, first + (g + 1) * L)
        C = fit.coefficient_error_correlation[rows, rows]
        s = fit.standard_errors[rows] / sd
        if model.vehicle.other_laws:
            z = fit.coefficients[rows] / sd / np.maximum(s, MIN_DIVISOR)
            information = np.einsum("la,lm,ma->", z, np.linalg.pinv(C, rcond=_RANK_TOLERANCE), z)
            gain_sd[g] = 1.0 / np.sqrt(MIN_DIVISOR + information)
        else:
            b = fit.coefficients[rows].sum(axis=0) / sd
            v = np.einsum("la,lm,ma->a", s, C, s)
            gain_sd[g] = np.sqrt(b**2 @ np.maximum(v, 0.0)) / max(float(b @ b), MIN_DIVISOR)
    return np.minimum(gain_sd, _GAIN_SD_CAP)


def fold_qualities(parts: Parts, model: Model) -> list[Document]:
    """Compute the explained variance of parts left out, one entry a fold."""
    folds = held_out_folds(parts, model, None)
    return [{"left_out": fold.name, **prediction_quality(fold)} for fold in folds]


def score_folds(parts: Parts, model: Model) -> tuple[list[Document], float]:
    """One entry a fold, and the posterior mass with which the bounds hold the labels as they should."""
    entries = fold_qualities(parts, model)
    usual = model.settings.bounds
    coverage: list[list[float]] = []
    for entry, fold in zip(entries, held_out_folds(parts, model, None), strict=True):
        samples = fold.held_out.samples
        labels = np.where(fold.held_out.is_usable[:, None], samples.labels, np.nan)
        if np.isfinite(labels).all(axis=1).any():
            bank = build_bank(fold.model)
            p = bank_posterior(samples, fold.model, bank)
            scores = {
                mass: score_against_labels(rows_of_posterior(samples, fold.model, bank, p, mass), labels)
                for mass in (*_CREDIBLE_MASSES, usual)
            }
            entry["score"] = scores[usual]
            coverage.append([scores[mass]["held_by_bounds"] for mass in _CREDIBLE_MASSES])
    if not coverage:
        return entries, usual
    return entries, _CREDIBLE_MASSES[int(np.argmin(np.abs(np.mean(coverage, axis=0) - _COVERAGE_GOAL)))]


def prediction_quality(fold: Fold) -> Document:
    """Share of the rates' variance that one-step prediction explains, and the residual, an axis."""
    flight = one_step_innovations(fold.model, fold.held_out)
    y, e = fold.held_out.samples.rates[flight.rows], flight.e
    if not len(y):
        return {"samples": 0}
    explained = 1.0 - e.var(axis=0) / np.maximum(y.var(axis=0), MIN_DIVISOR)
    return {
        "samples": len(y),
        "explained": regression.by_axis(explained),
        "residual_rad_s": regression.by_axis(e.std(axis=0)),
    }


def one_step_innovations(model: Model, part: FitPart) -> regression.Innovations:
    """The samples in use by a model, whatever is known of noise."""
    return part.innovations(model.model_copy(update={"colours": []}))


def one_step_residuals(parts: Parts, model: Model) -> Floats:
    """The residuals of several flights, one after the other, (n, 3), whatever is known of noise."""
    return np.vstack([one_step_innovations(model, part).e for part in parts])
