"""Identify a vehicle: fit a model to its flights, and test the model on parts left out."""

from collections.abc import Sequence

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, fitting, gyro_noise, regression, validation
from beaver_ftc_logs.fit_checks import collinear_regressors, density_ratios, median_inflation
from beaver_ftc_logs.fit_parts import Parts, fit_parts, one_step_residuals
from beaver_ftc_logs.folds import fold_qualities
from beaver_ftc_logs.free_runs import fit_output_error
from beaver_ftc_logs.groups import group_indices
from beaver_ftc_logs.model import Model, NoiseModel
from beaver_ftc_logs.motion_units import refuse_command_unit
from beaver_ftc_logs.noise_models import AR_ORDER
from beaver_ftc_logs.noise_search import whiten_flights
from beaver_ftc_logs.preparation import assume_law_and_air
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.scoring import worst_of
from beaver_ftc_logs.vehicle import Vehicle
from beaver_ftc_logs.whitening import UNFITTED_GYROS_RAD_S, UNFITTED_MA, whiten_samples

SCORES = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds")


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights; `identified` has the results of its tests. Raises BadInput if
    a command is in another unit than in the first flight, or if the flights do not give a model."""
    vehicle, lines = assume_law_and_air(flights, vehicle)
    for flight in flights[1:]:
        refuse_command_unit(flight, flights[0], list(vehicle.surfaces))
    parts = fit_parts(whiten_flights(flights, vehicle))
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
        "collinear": collinear_regressors(parts, model),
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
    all. Q of `gyro_noise` is the least covariance of a whitened residual. A whitening filter has the gain 1
    at frequency 0, so this is the density of the residual there, which the noise of gyros hardly changes.
    """
    if not model.colours:
        return model
    known = [tuple(noise.average) for noise in model.colours]
    Q = min((np.array(noise.noise) for noise in model.colours), key=np.linalg.det)
    powers = [noise.quick for noise in model.colours if noise.quick is not None]
    shared_fields: Document = {
        "wider": max(noise.wider for noise in model.colours),
        "misreads": np.max([noise.misreads for noise in model.colours], axis=0).tolist(),
        "quick": min(powers, default=None),
    }
    models = list(model.colours)
    for ma in UNFITTED_MA:
        if ma not in known:
            parts = fit_parts([whiten_samples(flight, ma) for flight in flights])
            e = one_step_residuals(parts, model)
            models.append(NoiseModel(average=list(ma), noise=np.cov(e.T).tolist(), **shared_fields))
    for gyro_sd in UNFITTED_GYROS_RAD_S:
        ar, R = gyro_noise.yule_walker_predictor(model, Q, gyro_sd, AR_ORDER)
        models.append(NoiseModel(average=[1.0], before=ar.tolist(), noise=R.tolist(), **shared_fields))
    return model.model_copy(update={"colours": models})


def expect_another_day(folds: list[Document], model: Model) -> Document:
    """The errors to expect on a day that was not fitted: mean and worst score of the parts left out. If a
    rate of false alarms is requested and the model has a tail, also: the rate with its bounds, 1/h, the
    minutes of healthy flight that are missing to show this rate without a fitted tail, and the test of the
    threshold: `identified` of `validation.add_ranges_and_threshold`.
    """
    expected: Document = {}
    if scores := [fold["score"] for fold in folds if "score" in fold]:
        for key in SCORES:
            values = [score[key] for score in scores]
            expected[key] = {"mean": float(np.mean(values)), "worst": float(worst_of(key, values))}
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


def check_explained(folds: list[Document], parts: Parts, model: Model) -> None:
    """Raise BadInput if, on parts left out, the model predicts a rate no better than the mean of the rate
    does. The message also names the time, the stillest command and the remarks on the rates.

    shares: explained share of the variance of p, q and r in each part; means: their means, weighted by
    samples.
    """
    known = [fold for fold in folds if fold["samples"]]
    if not known:
        return
    shares = np.array([[fold["explained"][axis] for axis in "pqr"] for fold in known])
    means = regression.by_axis(np.average(shares, axis=0, weights=[fold["samples"] for fold in known]))
    unexplained = {axis: share for axis, share in means.items() if share <= 0.0}
    if not unexplained:
        return
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
