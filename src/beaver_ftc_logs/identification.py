"""The whole of an identification: the fit, its tests on what it did not see, and what is said about both.

Letters as in `orders` and `regression`: Z and y regressors and rates of a fit, e and R its residual and the
covariance, ma and ar the colour of the noise. V0 is the airspeed at which the commands count once, m/s.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, fitting, gyro_noise, orders, regression, trust, validation
from beaver_ftc_logs.column_mistakes import refuse_command_unit
from beaver_ftc_logs.folds import fold_qualities
from beaver_ftc_logs.least_squares import left_by
from beaver_ftc_logs.model import FittedRanges, Model, NoiseModel
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import Parts
from beaver_ftc_logs.samples import (
    NOISE_MA_CANDIDATES,
    UNFITTED_GYROS_RAD_S,
    UNFITTED_MA,
    Samples,
    scale_by_airspeed,
    whiten_samples,
)
from beaver_ftc_logs.vehicle import Vehicle

_SCORES = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds")
_DECISIVE_BIC = 10.0
"""By how much a criterion must be less: odds of 150 to 1 [Kass1995, section 3.2]."""
_AIRSPEED_POWERS = (0.0, 1.0, 3.0)
_MAX_ROUNDS = 8


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
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
    }
    settings = model.settings.model_copy(update={"bounds": mass})
    return model.model_copy(update={"settings": settings, "identified": results})


def add_unseen_noise(model: Model, flights: Sequence[Samples]) -> Model:
    """In moving air the model with noise that no fitted flight had: gusts held within a sample or not, and
    noisier gyros, whose colour follows from the model. A law answers noise; which noise a flight has, and how
    much of it, the flight itself shows (`filtering.recent_scale`)."""
    if not model.colours:
        return model
    known = [tuple(noise.average) for noise in model.colours]
    quietest = min((np.array(noise.noise) for noise in model.colours), key=np.linalg.det)
    powers = [noise.quick for noise in model.colours if noise.quick is not None]
    same: Document = {
        "wider": max(noise.wider for noise in model.colours),
        "misreads": np.max([noise.misreads for noise in model.colours], axis=0).tolist(),
        "quick": min(powers, default=None),
    }
    models = list(model.colours)
    for ma in UNFITTED_MA:
        if ma not in known:
            parts = orders.fit_parts([whiten_samples(flight, ma) for flight in flights])
            e = orders.one_step_residuals(parts, model)
            models.append(NoiseModel(average=list(ma), noise=np.cov(e.T).tolist(), **same))
    for gyro_sd in UNFITTED_GYROS_RAD_S:
        ar, R = gyro_noise.yule_walker_predictor(model, quietest, gyro_sd, orders.AR_ORDER)
        models.append(NoiseModel(average=[1.0], before=ar.tolist(), noise=R.tolist(), **same))
    return model.model_copy(update={"colours": models})


def assume_law_and_air(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with what its file leaves open of laws and air, and a line on each with the reason.

    A log of healthy flight shows neither which law nor which air a later flight has: both are taken to be
    others, which costs power and raises no false alarm. Labelled faults show what they do under the law that
    flies, in the air that there is.
    """
    labelled = any(np.isfinite(flight.labels).any() for flight in flights)
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
    """In moving air the flights whitened by the colour that leaves least unexplained of each, and one fit of
    all, in turns.

    A law that answers rates answers their noise: with a residual that is not white, what is noise is taken
    for what the surface does [Ljung1999, section 13.4].
    """
    if not vehicle.moving_air:
        return list(flights)
    from scipy.signal import lfilter

    def stacked(flights: Sequence[Samples]) -> tuple[Floats, Floats]:
        # the commands get as many lags as the rates, not as many as they have at most: the results rest on it
        return orders.stack_data(orders.fit_parts(flights), vehicle, *[max(orders.RATE_LAGS)] * 2)[:2]

    def own_residual(flight: Samples, ma: tuple[float, ...]) -> Floats:
        Z, y = stacked([whiten_samples(flight, ma)])
        if len(y) < 2:
            known = f"{len(y)} samples known to be healthy"
            raise BadInput(f"identify: {flight.name}: {known}, allowed: at least 2")
        return left_by(Z, y)

    alone = [{ma: own_residual(flight, ma) for ma in NOISE_MA_CANDIDATES} for flight in flights]
    colours = [_likeliest_ma(residuals)[1] for residuals in alone]
    whitened = [whiten_samples(flight, ma) for flight, ma in zip(flights, colours, strict=True)]
    for _ in range(_MAX_ROUNDS):
        Z, y = stacked(whitened)
        C = np.linalg.lstsq(Z, y, rcond=None)[0]
        left = [y - Z @ C for Z, y in (stacked([flight]) for flight in flights)]
        white = [{ma: lfilter([sum(ma)], ma, e, axis=0) for ma in NOISE_MA_CANDIDATES} for e in left]
        found = [_likeliest_ma(residuals) for residuals in white]
        if (new := [ma for _, ma in found]) == colours:
            break
        mean = np.mean([log_det for log_det, _ in found])
        colours = new
        whitened = [
            whiten_samples(flight, ma, float(np.exp((mean - log_det) / 6.0)))
            for flight, (log_det, ma) in zip(flights, found, strict=True)
        ]
    return whitened


def _likeliest_ma(residuals: dict[tuple[float, ...], Floats]) -> tuple[float, tuple[float, ...]]:
    """The log determinant of what the likeliest moving average leaves, and this: by profile likelihood, as of
    an ARMAX model. residuals: in a flight that is whitened by each, (n, 3)."""
    log_dets = {ma: float(np.linalg.slogdet(np.cov(e.T))[1]) for ma, e in residuals.items()}
    best = min(log_dets, key=lambda ma: log_dets[ma] - 6.0 * float(np.log(sum(ma))))
    return log_dets[best], best


def expect_another_day(folds: list[Document], model: Model) -> Document:
    """Estimate the errors on a day that was not fitted, by parts left out: worst and mean of every figure of
    merit, false alarms an hour and how sure that is, and how many minutes would show it."""
    scores = [fold["score"] for fold in folds if "score" in fold]
    values = {key: [score[key] for score in scores] for key in _SCORES if scores}
    expected: Document = {
        key: {"mean": float(np.mean(each)), "worst": float((max if key == "mean_error" else min)(each))}
        for key, each in values.items()
    }
    tail = model.fitted.tail
    threshold = model.settings.threshold
    if tail is None or threshold is None:
        return expected
    target = model.settings.false_alarms_per_hour or 0.0
    return expected | {
        "false_alarms_per_hour": {"asked": target, **extremes.false_alarm_rate(tail, threshold)},
        "minutes_left_out": tail.minutes,
        "minutes_missing": max(60.0 * extremes.RULED_OUT_COUNT / target - tail.minutes, 0.0),
        **model.identified,
    }


def scale_if_better(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Sequence[Samples], Vehicle]:
    """Flights with commands times the dynamic pressure, and the vehicle that says so, where the airspeed is
    known and this explains more; else both as they are. Where other laws may fly, each group of surfaces with
    the power of the airspeed that explains most; another than that of the pressure must explain decisively
    more."""
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
        # a criterion believes each sample, as only white noise lets it
        white = whiten_flights(_scaled(flights, best), best) if best.moving_air else None
        least = _min_bic(_scaled(flights, best, white), best) - _DECISIVE_BIC
        names = list(best.surfaces)
        for group, power in product(regression.group_surfaces(best), _AIRSPEED_POWERS):
            powers = best.airspeed_powers | {names[i]: power for i in group}
            candidate = best.model_copy(update={"airspeed_powers": powers})
            if (bic := _min_bic(_scaled(flights, candidate, white), candidate)) < least:
                least, best = bic, candidate
    found = {key: getattr(best, key) for key in ("reference_airspeed_mps", "airspeed_powers")}
    return _scaled(flights, best), vehicle.model_copy(update=found)


def _scaled(
    flights: Sequence[Samples], vehicle: Vehicle, white: Sequence[Samples] | None = None
) -> list[Samples]:
    """Flights with commands times the airspeed over V0 to the power of each surface; whitened as those are
    that are given."""
    V0, powers = vehicle.reference_airspeed_mps or 0.0, vehicle.surface_airspeed_powers
    scaled = [scale_by_airspeed(flight, V0, powers) for flight in flights]
    if white is None:
        return scaled
    pairs = zip(scaled, white, strict=True)
    return [whiten_samples(flight, one.noise_ma_coefficients, one.fit_weight) for flight, one in pairs]


def _min_bic(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion of any order."""
    return min(orders.bic_by_order(orders.fit_parts(flights), vehicle).values())


def check_explained(folds: list[Document], parts: Parts, model: Model) -> None:
    """Raise BadInput where a model explains less of an axis than its mean does, on parts not fitted."""
    known = [fold for fold in folds if fold["samples"]]
    counts = [fold["samples"] for fold in known]
    shares = np.array([[fold["explained"][axis] for axis in "pqr"] for fold in known])
    means = regression.by_axis(np.average(shares, axis=0, weights=counts)) if known else {}
    if unexplained := {axis: share for axis, share in means.items() if share <= 0.0}:
        minutes = sum(int(part.is_usable.sum()) * part.samples.dt_s for part in parts) / 60.0
        commands = np.vstack([part.samples.commands[part.is_usable] for part in parts])
        sds = dict(zip(model.vehicle.surfaces, np.nanstd(commands, axis=0).tolist(), strict=True))
        stillest = min(sds, key=lambda name: sds[name])
        prefixes = tuple(f"{getattr(model.vehicle.rates, axis).column}:" for axis in "pqr")
        notes = [note for part in parts for note in part.samples.notes if note.startswith(prefixes)]
        raise BadInput(
            f"identify: on parts it was not fitted on the model explains less of {', '.join(unexplained)} "
            f"than the mean does ({_axis_text(unexplained)}), allowed: a model that explains more; what "
            f"would help: more than these {minutes:.1f} min, commands that move more ({stillest} has a "
            f"standard deviation of {sds[stillest]:.2g}), or the commands that this vehicle follows"
            + "".join(f"; {note}" for note in notes)
        )


def _check_units(flights: Sequence[Samples], vehicle: Vehicle) -> None:
    """Raise BadInput where a flight's command is in another unit than that of the first."""
    commands, rates = trust.central_ranges(flights[0].commands), trust.central_ranges(flights[0].rates)
    first = FittedRanges(commands=commands, rates=rates)
    for flight in flights[1:]:
        refuse_command_unit(flight.name, flight.commands, flight.rates, first, list(vehicle.surfaces))


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    h = model.history
    signals = model.vehicle.regressor_columns
    commands = [(f"command of {'+'.join(group)}",) for group in model.groups]
    lagged = [
        ("pqr", h),
        (signals, model.vehicle.n_signal_lags(h)),
        *((one, model.lags) for one in commands),
    ]
    return [f"{name}[-{k}]" for names, most in lagged for k in range(1, most + 1) for name in names]


def identification_text(model: Model) -> str:
    """Return the identification as lines of text."""
    results: Document = dict(model.identified)
    n_samples = sum(flight["samples"] for flight in results["flights"])
    lines = [
        f"{model.vehicle.name}: {n_samples} samples at {model.rate_hz:.3g} Hz, flights: "
        f"{len(results['flights'])}; "
        f"past samples of the rates: {model.history}, of the commands: {model.lags}",
        *(f"  {line}" for line in results.get("assumed", [])),
        *(f"  together, not distinguishable: {', '.join(group)}" for group in model.groups if len(group) > 1),
        *_pressure_lines(model),
        *dict.fromkeys(
            f"  noise of the colour {', '.join(f'{c:.3g}' for c in noise.average)}: {noise.wider:.2g} times "
            "as wide, in squares, as gains of 10 s left out differ, and other laws may"
            for noise in model.colours
        ),
        *(f"  {line}" for line in trust.unknown_sentences(model)),
        *(f"  {flight['name']}: {note}" for flight in results["flights"] for note in flight["notes"]),
        *map(_fold_text, results["tests"]),
        *_day_lines(results["another_day"], len(results["flights"])),
    ]
    return "\n".join(lines)


def _day_lines(expected: Document, n_flights: int) -> list[str]:
    """Return lines on flights that were not fitted; one flight informs on its halves, not on another day."""
    unit = "another half of this day, not of another day"
    if n_flights > 1:
        unit = "another day, each left out in turn"
    lines = []
    if "classes" in expected:
        scores = [
            f"{key.replace('_', ' ')} {expected[key]['mean']:.3f} ({expected[key]['worst']:.3f})"
            for key in _SCORES
        ]
        lines.append(f"  expect of {unit}, mean (worst): {', '.join(scores)}")
    if "false_alarms_per_hour" in expected:
        alarms = expected["false_alarms_per_hour"]
        missing = expected["minutes_missing"]
        lines.append(
            f"  false alarms: {alarms['asked']:g} an hour asked for, "
            f"{alarms['low']:.2g} to {alarms['high']:.2g} at 90 %, "
            f"by {expected['minutes_left_out']:.1f} min of health left out"
        )
        if missing:
            lines.append(f"  to show this rate without a fitted tail {missing:.0f} min of health are missing")
        if expected.get("parts"):
            alarmed = f"{expected['alarmed']} of {expected['parts']} parts left out alarm"
            lines.append(f"  at the threshold of the others {alarmed}")
    return lines


def _pressure_lines(model: Model) -> list[str]:
    if (V0 := model.vehicle.reference_airspeed_mps) is None:
        return []
    powers = "".join(
        f", {surface} with airspeed^{power:g}"
        for surface, power in model.vehicle.airspeed_powers.items()
        if power != 2
    )
    return [f"  surfaces work with the dynamic pressure, 1 at {V0:.4g} m/s{powers}"]


def _fold_text(fold: Document) -> str:
    if not fold["samples"]:
        return f"  without {fold['left_out']}: nothing in it is known"
    line = f"  without {fold['left_out']}: explains {_axis_text(fold['explained'])} of it"
    if "score" not in fold:
        return line
    scores = fold["score"]
    return (
        f"{line}; {len(scores['settings'])} classes {scores['classes']:.3f}, healthy or faulty "
        f"{scores['healthy_or_faulty']:.3f}, side {scores['side']:.3f}, mean error {scores['mean_error']:.3f}"
    )


def _axis_text(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())
