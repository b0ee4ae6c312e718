"""The whole of an identification: the fit, its tests on what it did not see, and what is said about both."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.flights.identify import Stretch, fit_model, fit_order, stacked, stretches_of
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.output_error import output_error
from beaver_ftc.flights.regression import spectrum, variance_inflation
from beaver_ftc.flights.regressors import group_indices
from beaver_ftc.flights.samples import Samples
from beaver_ftc.flights.testing import residuals, run_tests
from beaver_ftc.flights.vehicle import Vehicle

Document = dict[str, Any]

_COLLINEAR = 10.0
_BANDS_HZ = ((0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
    stretches = stretches_of(flights)
    model = fit_model(stretches, vehicle)
    tests, bounds = run_tests(stretches, model)
    found = {
        "flights": [
            {
                "name": one.samples.name,
                "samples": int(one.use.sum()),
                "of": len(one.use),
                "notes": list(one.samples.notes),
            }
            for one in stretches
        ],
        "tests": tests,
        "collinear": collinear(stretches, model),
        "colour": colour(stretches, model),
        "spectrum": residual_spectrum(stretches, model),
        "output_error": output_error(stretches, group_indices(model)),
    }
    settings = model.settings.model_copy(update={"bounds": bounds})
    return model.model_copy(update={"settings": settings, "identified": found})


def collinear(stretches: Sequence[Stretch], model: Model) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first."""
    x, _, _ = stacked(stretches, model.vehicle, model.history, model.lags)
    factors = variance_inflation(x[:, 1:])
    worst = sorted(zip(regressor_names(model), factors.tolist(), strict=True), key=lambda pair: -pair[1])
    return [{"regressor": name, "inflation": factor} for name, factor in worst if factor > _COLLINEAR]


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    rates = [f"{rate}[-{k}]" for k in range(1, model.history + 1) for rate in "pqr"]
    signals = [f"{name}[-1]" for name in model.vehicle.signals]
    commands = [
        f"command of {'+'.join(group)}[-{k}]" for group in model.groups for k in range(1, model.lags + 1)
    ]
    return rates + signals + commands


def colour(stretches: Sequence[Stretch], model: Model) -> dict[str, float]:
    """By how much the residual's colour widens the standard errors of the responses: the median, an axis."""
    fit = fit_order(stretches, model.vehicle, model.history, model.lags)
    first = len(fit.colour) - len(model.groups) * model.lags
    return dict(zip("pqr", np.median(fit.colour[first:], axis=0).tolist(), strict=True))


def residual_spectrum(stretches: Sequence[Stretch], model: Model) -> list[Document]:
    """Mean density of the residual by band, over that of white noise of the same variance, an axis."""
    e = np.vstack([residuals(model, stretch)[0] for stretch in stretches])
    frequency, density = spectrum(e, 1.0 / model.rate_hz)
    white = e.var(axis=0) / (0.5 * model.rate_hz)
    bands = []
    for low, high in _BANDS_HZ:
        inside = (frequency > low) & (frequency <= high)
        if inside.any():
            ratio = (density[inside].mean(axis=0) / white).tolist()
            bands.append({"from_hz": low, "to_hz": high, **dict(zip("pqr", ratio, strict=True))})
    return bands


def summary(model: Model) -> str:
    """What was found, in lines for people."""
    found: Document = dict(model.identified)
    used = sum(flight["samples"] for flight in found["flights"])
    lines = [
        f"{model.vehicle.name}: {used} samples at {model.rate_hz:.3g} Hz, flights: {len(found['flights'])}; "
        f"past samples of the rates: {model.history}, of the commands: {model.lags}",
        *(f"  together, not to be told apart: {', '.join(g)}" for g in model.groups if len(g) > 1),
        *(f"  {flight['name']}: {note}" for flight in found["flights"] for note in flight["notes"]),
        *map(_test_line, found["tests"]),
        f"  the residual's colour widens standard errors by {_axes(found['colour'])}",
    ]
    run = found["output_error"]
    if "delay_s" in run:
        lines.append(
            f"  output error: servo lag {_lag(run)}, delay "
            f"{run['delay_s']:.3f} s (sd {run['delay_sd_s']:.3f}), explains of 2 s free runs not fitted "
            f"{_axes(run['explained_of_windows_not_fitted'])}"
        )
    if found["collinear"]:
        worst = found["collinear"][0]
        lines.append(
            f"  {len(found['collinear'])} regressors are collinear (variance inflated over {_COLLINEAR:g} "
            f"times), most {worst['regressor']} ({worst['inflation']:.0f} times)"
        )
    return "\n".join(lines)


def _test_line(test: Document) -> str:
    if not test["samples"]:
        return f"  without {test['left_out']}: nothing in it is known"
    line = f"  without {test['left_out']}: explains {_axes(test['explained'])} of it"
    if "score" in test:
        kept = test["score"]
        line += (
            f"; {len(kept['settings'])} classes {kept['classes']:.3f}, healthy or faulty "
            f"{kept['healthy_or_faulty']:.3f}, side {kept['side']:.3f}, mean error {kept['mean_error']:.3f}"
        )
    return line


def _lag(run: Document) -> str:
    if run["shorter_than_can_be_told"]:
        return "shorter than this rate can tell"
    return f"{run['servo_lag_s']:.3f} s (sd {run['servo_lag_sd_s']:.3f})"


def _axes(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())
