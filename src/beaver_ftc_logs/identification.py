"""Identify a vehicle: prepare its flights, fit a model to them, and test the model on parts left out.

Z           regressors (n, m) of a fit (`orders.stack_data`)
y, e        rates (n, 3) of a fit, and its residual (n, 3), rad/s
C           coefficients of a fit (m, 3)
ma          moving average of the noise, 1 first; a flight is *whitened* by it (`whitening.whiten_samples`)
V, V0       airspeed, m/s, and the airspeed at which a command has the effect of the model, m/s
"""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, fitting, gyro_noise, orders, regression, trust, validation
from beaver_ftc_logs.column_mistakes import refuse_command_unit
from beaver_ftc_logs.fit_checks import collinear_names, density_ratios, median_inflation
from beaver_ftc_logs.folds import fold_qualities
from beaver_ftc_logs.free_runs import fit_output_error
from beaver_ftc_logs.groups import group_indices, group_surfaces
from beaver_ftc_logs.least_squares import left_by
from beaver_ftc_logs.loading import have_labels
from beaver_ftc_logs.model import FittedRanges, Model, NoiseModel
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import Parts
from beaver_ftc_logs.samples import Samples, scale_by_airspeed
from beaver_ftc_logs.vehicle import Vehicle
from beaver_ftc_logs.whitening import (
    NOISE_MA_CANDIDATES,
    UNFITTED_GYROS_RAD_S,
    UNFITTED_MA,
    whiten_samples,
)

SCORES = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds")
# A model is decisively better if its information criterion is less by this: odds of 150 to 1 [Kass1995,
# section 3.2].
_DECISIVE_BIC = 10.0
# Powers of the airspeed that are tried for the effect of a surface, besides the square.
_AIRSPEED_POWERS = (0.0, 1.0, 3.0)
# Largest number of rounds of `whiten_flights`.
_MAX_ROUNDS = 8


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights; `identified` has the results of its tests."""
    vehicle, lines = assume_law_and_air(flights, vehicle)
    _check_units(flights, vehicle)
    parts = orders.fit_parts(whiten_flights(flights, vehicle))
    model = fitting.fit_model(parts, vehicle)
    check_explained(fold_qualities(parts, model), parts, model)
    model = add_unseen_noise(validation.add_ranges_and_threshold(parts, model), flights)
    folds, mass = validation.score_folds(parts, model)
    results = {
        "assumed": lines,
        "flights": [
            {
                "name": part.samples.name,
                "samples": int(part.is_usable.sum()),
                "of": len(part.is_usable),
                "notes": list(part.samples.notes),
            }
            for part in parts
        ],
        "tests": folds,
        "another_day": expect_another_day(folds, model),
        "collinear": collinear_names(parts, model),
        "colour": median_inflation(parts, model),
        "spectrum": density_ratios(parts, model),
        "output_error": fit_output_error(parts, group_indices(model)),
    }
    settings = model.settings.model_copy(update={"bounds": mass})
    return model.model_copy(update={"settings": settings, "identified": results})


def add_unseen_noise(model: Model, flights: Sequence[Samples]) -> Model:
    """The model with further noise models, in moving air: one for each moving average of gusts that no fitted
    flight had, and one for each noise of noisier gyros, which follows from the model (`gyro_noise`).
    `diagnose` chooses among all noise models by their likelihood in the suspect flight.

    The new noise models take over the largest inflation and misreading, and the least usual quick power, of
    all.
    """
    if not model.colours:
        return model
    known = [tuple(noise.average) for noise in model.colours]
    # Q of `gyro_noise`: covariance of the quietest whitened residual.
    quietest = min((np.array(noise.noise) for noise in model.colours), key=np.linalg.det)
    powers = [noise.quick for noise in model.colours if noise.quick is not None]
    shared_fields: Document = {
        "wider": max(noise.wider for noise in model.colours),
        "misreads": np.max([noise.misreads for noise in model.colours], axis=0).tolist(),
        "quick": min(powers, default=None),
    }
    models = list(model.colours)
    for ma in UNFITTED_MA:
        if ma not in known:
            parts = orders.fit_parts([whiten_samples(flight, ma) for flight in flights])
            e = orders.one_step_residuals(parts, model)
            models.append(NoiseModel(average=list(ma), noise=np.cov(e.T).tolist(), **shared_fields))
    for gyro_sd in UNFITTED_GYROS_RAD_S:
        ar, R = gyro_noise.yule_walker_predictor(model, quietest, gyro_sd, orders.AR_ORDER)
        models.append(NoiseModel(average=[1.0], before=ar.tolist(), noise=R.tolist(), **shared_fields))
    return model.model_copy(update={"colours": models})


def assume_law_and_air(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with the keys `other_laws` and `moving_air` that its file leaves out, a line on each, and a
    line if there is no reference airspeed.

    Flights without labels show neither which law nor which air a later flight has, so both keys become true.
    An alarm then needs more evidence. If a flight has labels, later flights are assumed to be as these: both
    become false.
    """
    labelled = have_labels(flights)
    reason = "labels show faults under it" if labelled else "logs of healthy flight do not tell"
    texts = {"other_laws": "other laws may fly", "moving_air": "the air may move"}
    lines = []
    for key, text in texts.items():
        if getattr(vehicle, key) is None:
            vehicle = vehicle.model_copy(update={key: not labelled})
            assumed = "as fitted" if labelled else text
            lines.append(f"{key}: {str(not labelled).lower()}, {assumed} ({reason})")
        else:
            lines.append(f"{key}: {str(getattr(vehicle, key)).lower()}, as the vehicle file says")
    if vehicle.reference_airspeed_mps is None:
        airspeed = any(np.isfinite(flight.airspeed).any() for flight in flights)
        why = "explains no more" if airspeed else "is not logged"
        lines.append(f"reference_airspeed_mps: none, the airspeed {why}")
    return vehicle, lines


def whiten_flights(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """The flights; in moving air, whitened by the likeliest moving average of each.

    A law feeds the noise of the rates back to the surfaces. If the residual is not white, a fit attributes
    noise to the surfaces [Ljung1999, section 13.4]. The moving averages follow from the residuals of one
    common fit to all flights, and this fit follows from the moving averages:

        1. the first averages: for each flight the likeliest by fits to this flight alone, one an average
        2. a common fit to all flights, whitened by their averages
        3. for each flight the likeliest average by the residual of the common fit; stop if none has changed
           since step 4
        4. whiten again, with weights that give all flights the same noise (they are 1 before); continue with
           step 2, for at most _MAX_ROUNDS rounds

    Likelihoods are those of `_likeliest_ma`. Raises BadInput if a flight has fewer than 2 samples for a fit.

    own_residuals, common_residuals: for each flight, moving average -> residual, by step 1 and 3. averages:
    the moving average of each flight by step 3, empty before the first round.
    """
    if not vehicle.moving_air:
        return list(flights)
    from scipy.signal import lfilter

    def stacked(flights: Sequence[Samples]) -> tuple[Floats, Floats]:
        """Regressors and rates of flights for the largest order of the rates."""
        # The commands have as many lags as the rates, not their largest number: the kept results depend on
        # it.
        h = max(orders.RATE_LAGS)
        return orders.stack_data(orders.fit_parts(flights), vehicle, h, h)[:2]

    def own_residual(flight: Samples, ma: tuple[float, ...]) -> Floats:
        """Residual (n, 3) of the fit to one flight, whitened by a moving average."""
        Z, y = stacked([whiten_samples(flight, ma)])
        if len(y) < 2:
            known = f"{len(y)} samples known to be healthy"
            raise BadInput(f"identify: {flight.name}: {known}, allowed: at least 2")
        return left_by(Z, y)

    own_residuals = [{ma: own_residual(flight, ma) for ma in NOISE_MA_CANDIDATES} for flight in flights]
    first = [_likeliest_ma(residuals)[1] for residuals in own_residuals]
    whitened = [whiten_samples(flight, ma) for flight, ma in zip(flights, first, strict=True)]
    averages: list[tuple[float, ...]] = []
    for _ in range(_MAX_ROUNDS):
        Z, y = stacked(whitened)
        C = np.linalg.lstsq(Z, y, rcond=None)[0]
        unwhitened = [y - Z @ C for Z, y in (stacked([flight]) for flight in flights)]
        common_residuals = [
            {ma: lfilter([sum(ma)], ma, e, axis=0) for ma in NOISE_MA_CANDIDATES} for e in unwhitened
        ]
        likeliest = [_likeliest_ma(residuals) for residuals in common_residuals]
        if (new := [ma for _, ma in likeliest]) == averages:
            break
        mean = np.mean([log_det for log_det, _ in likeliest])
        averages = new
        whitened = [
            whiten_samples(flight, ma, float(np.exp((mean - log_det) / 6.0)))
            for flight, (log_det, ma) in zip(flights, likeliest, strict=True)
        ]
    return whitened


def _likeliest_ma(residuals: dict[tuple[float, ...], Floats]) -> tuple[float, tuple[float, ...]]:
    """For the likeliest moving average: log det R of the residual's covariance R, and this average.
    residuals: moving average -> residual (n, 3) of a flight that was whitened by it.

    Whitening by ma(1) / ma(z) multiplies the noise by ma(1), the sum of the average. So the likeliest average
    has the least log det R - 6 log ma(1): the variance of each of the 3 axes is multiplied by ma(1)^2.
    """
    log_dets = {ma: float(np.linalg.slogdet(np.cov(e.T))[1]) for ma, e in residuals.items()}
    best = min(log_dets, key=lambda ma: log_dets[ma] - 6.0 * float(np.log(sum(ma))))
    return log_dets[best], best


def expect_another_day(folds: list[Document], model: Model) -> Document:
    """The errors to expect on a day that was not fitted: mean and worst score of the parts left out. The
    worst of `mean_error` is the largest, of all other scores the least. If a rate of false alarms is
    requested and the model has a tail, also: the rate with its bounds, 1/h, the minutes of healthy flight
    that are missing to show this rate without a fitted tail, and the test of the threshold (`validation`).
    """
    scores = [fold["score"] for fold in folds if "score" in fold]
    scores_by_key = {key: [score[key] for score in scores] for key in SCORES if scores}
    expected: Document = {
        key: {"mean": float(np.mean(by_fold)), "worst": float((max if key == "mean_error" else min)(by_fold))}
        for key, by_fold in scores_by_key.items()
    }
    tail = model.fitted.tail
    threshold = model.settings.threshold
    rate = model.settings.false_alarms_per_hour
    if tail is None or threshold is None or rate is None:
        return expected
    return expected | {
        "false_alarms_per_hour": {"asked": rate, **extremes.false_alarm_rate(tail, threshold)},
        "minutes_left_out": tail.minutes,
        "minutes_missing": max(60.0 * extremes.RULED_OUT_COUNT / rate - tail.minutes, 0.0),
        **model.identified,
    }


def scale_if_better(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Sequence[Samples], Vehicle]:
    """The flights scaled with V / V0 (`scale_by_airspeed`, with the power 2), and the vehicle with V0, if
    this explains decisively more; otherwise both as they are, as if the file states V0 or no airspeed is
    known.

    Where other laws may fly, each group of surfaces in turn takes the best of the other powers if it explains
    decisively more than the power so far, with the powers that the groups before it have taken. V0: median of
    the known airspeeds.
    """
    V = np.concatenate([flight.airspeed for flight in flights])
    V = V[np.isfinite(V)]
    V0 = float(np.median(V)) if V.size else 0.0
    if vehicle.reference_airspeed_mps is not None or V0 <= 0.0:
        return flights, vehicle
    assumed, _ = assume_law_and_air(flights, vehicle)
    best = assumed.model_copy(update={"reference_airspeed_mps": V0})
    if _min_bic(flights, assumed) - _min_bic(_scaled(flights, best), best) < _DECISIVE_BIC:
        return flights, vehicle
    if best.other_laws:
        # The criterion counts every sample as independent, which holds for white noise only.
        white = whiten_flights(_scaled(flights, best), best) if best.moving_air else None
        lowest = _min_bic(_scaled(flights, best, white), best)
        names = list(best.surfaces)
        for group in group_surfaces(best):
            by_bic = {}
            for power in _AIRSPEED_POWERS:
                powers = best.airspeed_powers | {names[i]: power for i in group}
                candidate = best.model_copy(update={"airspeed_powers": powers})
                by_bic[_min_bic(_scaled(flights, candidate, white), candidate)] = candidate
            if lowest - min(by_bic) >= _DECISIVE_BIC:
                lowest = min(by_bic)
                best = by_bic[lowest]
    scaling = {key: getattr(best, key) for key in ("reference_airspeed_mps", "airspeed_powers")}
    return _scaled(flights, best), vehicle.model_copy(update=scaling)


def _scaled(
    flights: Sequence[Samples], vehicle: Vehicle, white: Sequence[Samples] | None = None
) -> list[Samples]:
    """The flights by `scale_by_airspeed`, with the powers of the vehicle; if flights `white` are given, each
    is also whitened as its counterpart in `white`.
    """
    V0 = vehicle.reference_airspeed_mps or 0.0
    powers = vehicle.surface_airspeed_powers
    scaled = [scale_by_airspeed(flight, V0, powers) for flight in flights]
    if white is None:
        return scaled
    pairs = zip(scaled, white, strict=True)
    return [
        whiten_samples(flight, whitened.noise_ma_coefficients, whitened.fit_weight)
        for flight, whitened in pairs
    ]


def _min_bic(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion over all orders."""
    return min(orders.bic_by_order(orders.fit_parts(flights), vehicle).values())


def check_explained(folds: list[Document], parts: Parts, model: Model) -> None:
    """Raise BadInput if, on parts left out, the model predicts a rate no better than the mean of the rate
    does. The message also names the time, the stillest command and the remarks on the rates.

    shares: explained share of the variance of p, q and r in each part; means: their means, weighted by
    samples.
    """
    known = [fold for fold in folds if fold["samples"]]
    counts = [fold["samples"] for fold in known]
    shares = np.array([[fold["explained"][axis] for axis in "pqr"] for fold in known])
    means = regression.by_axis(np.average(shares, axis=0, weights=counts)) if known else {}
    if unexplained := {axis: share for axis, share in means.items() if share <= 0.0}:
        minutes = sum(int(part.is_usable.sum()) * part.samples.dt_s for part in parts) / 60.0
        commands = np.vstack([part.samples.commands[part.is_usable] for part in parts])
        sds = dict(zip(model.vehicle.surfaces, np.nanstd(commands, axis=0).tolist(), strict=True))
        stillest = min(sds, key=lambda name: sds[name])
        prefixes = tuple(f"{column}:" for column in model.vehicle.rate_columns)
        notes = [note for part in parts for note in part.samples.notes if note.startswith(prefixes)]
        raise BadInput(
            f"identify: on parts it was not fitted on the model explains less of {', '.join(unexplained)} "
            f"than the mean does ({axis_text(unexplained)}), allowed: a model that explains more; "
            f"what would help: more than these {minutes:.1f} min, commands that move more ({stillest} has a "
            f"standard deviation of {sds[stillest]:.2g}), or the commands that this vehicle follows"
            + "".join(f"; {note}" for note in notes)
        )


def axis_text(values: dict[str, float]) -> str:
    """The values of p, q and r as text."""
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())


def _check_units(flights: Sequence[Samples], vehicle: Vehicle) -> None:
    """Raise BadInput if a command of a flight is in another unit than in the first flight."""
    commands = trust.central_ranges(flights[0].commands)
    rates = trust.central_ranges(flights[0].rates)
    first = FittedRanges(commands=commands, rates=rates)
    for flight in flights[1:]:
        refuse_command_unit(flight.name, flight.commands, flight.rates, first, list(vehicle.surfaces))
