"""The whole of an identification: the fit, its tests on what it did not see, and what is said about both."""

from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, fitting, gyro_noise, regression, trust
from beaver_ftc_logs.model import Colour, Fitted, Model
from beaver_ftc_logs.recording import Floats
from beaver_ftc_logs.regression import group_indices, spectrum, variance_inflation
from beaver_ftc_logs.samples import (
    NOISE_COLOURS,
    UNSEEN_GYROS_RAD_S,
    UNSEEN_NOISE,
    Samples,
    whitened,
    with_pressure,
)
from beaver_ftc_logs.vehicle import Vehicle

_COLLINEAR = 10.0
_FIGURES = {
    "classes": "classes", "healthy_or_faulty": "healthy or faulty", "mean_error": "mean error",
    "held_by_bounds": "held by bounds",
}  # fmt: skip
_DECISIVE = 10.0
"""By how much a criterion must be less: odds of 150 to 1 [Kass1995, section 3.2]."""
_BANDS_HZ = ((0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0))
WINDOW_S = 2.0
_MOST_WINDOWS = 400
_POWERS = (0.0, 1.0, 3.0)
_TURNS = 8
_MOST_DELAY_S, _LEAST_LAG_S, _MOST_LAG_S = 0.6, 0.005, 1.0


def identify(flights: Sequence[Samples], vehicle: Vehicle) -> Model:
    """The model of a vehicle from its flights, with its own account of how good it is in `identified`."""
    vehicle, found_by = assumed(flights, vehicle)
    _check_commands(flights, vehicle)
    stretches = fitting.stretches_of(coloured(flights, vehicle))
    model = fitting.fit_model(stretches, vehicle)
    check_explains(fitting.explained(stretches, model), stretches, model)
    model = with_unseen_noise(fitting.trusted(stretches, model), flights)
    tests, bounds = fitting.run_tests(stretches, model)
    found = {
        "assumed": found_by,
        "flights": [_used(stretch) for stretch in stretches],
        "tests": tests,
        "another_day": another_day(tests, model),
        "collinear": collinear(stretches, model),
        "colour": colour(stretches, model),
        "spectrum": residual_spectrum(stretches, model),
        "output_error": output_error(stretches, group_indices(model)),
    }
    settings = model.settings.model_copy(update={"bounds": bounds})
    return model.model_copy(update={"settings": settings, "identified": found})


def with_unseen_noise(model: Model, flights: Sequence[Samples]) -> Model:
    """In moving air the model with noise that no fitted flight had: gusts held within a sample or not, and
    noisier gyros, whose colour follows from the model. A law answers noise; which noise a flight has, and how
    much of it, the flight itself shows (`filtering.least_scale`)."""
    if not model.colours:
        return model
    known, wider = [tuple(one.average) for one in model.colours], max(one.wider for one in model.colours)
    quietest = min((np.array(one.noise) for one in model.colours), key=np.linalg.det)
    colours = list(model.colours)
    for average in UNSEEN_NOISE:
        if average not in known:
            white = fitting.stretches_of([whitened(one, average) for one in flights])
            left = np.vstack([fitting.residuals(model, one)[1] for one in white])
            colours.append(Colour(average=list(average), noise=np.cov(left.T).tolist(), wider=wider))
    for gyro_rad_s in UNSEEN_GYROS_RAD_S:
        before, noise = gyro_noise.whitener(model, quietest, gyro_rad_s, fitting.AR_ORDER)
        both = {"before": before.tolist(), "noise": noise.tolist()}
        colours.append(Colour(average=[1.0], wider=wider, **both))
    return model.model_copy(update={"colours": colours})


def assumed(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Vehicle, list[str]]:
    """The vehicle with what its file leaves open of laws and air, and a line on each with the reason.

    A log of healthy flight shows neither which law nor which air a later flight has: both are taken to be
    others, which costs power and raises no false alarm. Labelled faults show what they do under the law that
    flies, in the air that there is.
    """
    labelled = any(np.isfinite(one.labels).any() for one in flights)
    why = "labels show faults under it" if labelled else "logs of healthy flight do not tell"
    keys, lines = {"other_laws": "other laws may fly", "moving_air": "the air may move"}, []
    for key, says in keys.items():
        if getattr(vehicle, key) is None:
            vehicle = vehicle.model_copy(update={key: not labelled})
            lines.append(
                f"{key}: {str(not labelled).lower()}, {says if not labelled else 'as fitted'} ({why})"
            )
        else:
            lines.append(f"{key}: {str(getattr(vehicle, key)).lower()}, as the vehicle file says")
    if vehicle.reference_airspeed_mps is None:
        known = any(one.airspeed is not None for one in flights)
        what = "explains no more" if known else "is not logged"
        lines.append(f"reference_airspeed_mps: none, the airspeed {what}")
    return vehicle, lines


def coloured(flights: Sequence[Samples], vehicle: Vehicle) -> list[Samples]:
    """In moving air the flights whitened by the colour that leaves least unexplained of each, and one fit of
    all, in turns.

    A law that answers rates answers their noise: with a residual that is not white, what is noise is taken
    for what the surface does [Ljung1999, section 13.4].
    """
    order = max(fitting.HISTORIES), max(fitting.HISTORIES)
    found, known = list(flights), None
    for _ in range(_TURNS if vehicle.moving_air else 0):
        x, y, _ = fitting.stacked(fitting.stretches_of(found), vehicle, *order)
        by = np.linalg.lstsq(x, y, rcond=None)[0]
        best = [_colour(fitting.stretches_of([one]), vehicle, order, np.asarray(by)) for one in flights]
        if (now := [colour for _, colour in best]) == known:
            break
        usual, known = np.mean([score for score, _ in best]), now
        found = [
            whitened(one, colour, float(np.exp((usual - score) / 6.0)))
            for one, (score, colour) in zip(flights, best, strict=True)
        ]
    return found


def _colour(
    stretch: list[fitting.Stretch], vehicle: Vehicle, order: tuple[int, int], by: Floats
) -> tuple[float, tuple[float, ...]]:
    """The colour of a flight, and the log determinant of the residual that it leaves."""
    from scipy.signal import lfilter

    x, y, _ = fitting.stacked(stretch, vehicle, *order)
    e = y - x @ by
    left = {one: np.linalg.slogdet(np.cov(lfilter([1.0], one, e, axis=0).T))[1] for one in NOISE_COLOURS}
    colour = min(left, key=lambda one: float(left[one]))
    return float(left[colour]) + 6.0 * float(np.log(sum(colour))), colour


def another_day(tests: list[Document], model: Model) -> Document:
    """What to expect of a day that was not fitted, by parts left out: worst and mean of every figure of
    merit, false alarms an hour and how sure that is, and how many minutes would show it."""
    scores = [test["score"] for test in tests if "score" in test]
    figures = {key: [score[key] for score in scores] for key in _FIGURES if scores}
    found: Document = {
        key: {"mean": float(np.mean(values)), "worst": float((max if key == "mean_error" else min)(values))}
        for key, values in figures.items()
    }
    known, settings = model.fitted, model.settings
    if known is None or known.tail is None or settings.threshold is None:
        return found
    per_hour = settings.false_alarms_per_hour or 0.0
    return found | {
        "false_alarms_per_hour": {
            "asked": per_hour,
            **asdict(extremes.expected(known.tail, settings.threshold)),
        },
        "minutes_left_out": known.tail.minutes,
        "minutes_missing": extremes.minutes_missing(known.tail, per_hour),
        **model.identified,
    }


def by_pressure(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Sequence[Samples], Vehicle]:
    """Flights with commands times the dynamic pressure, and the vehicle that says so, where the airspeed is
    known and this explains more; else both as they are."""
    left_open = {key: None for key in ("other_laws", "moving_air") if getattr(vehicle, key) is None}
    pressed, faster = _by_pressure(flights, assumed(flights, vehicle)[0] if left_open else vehicle)
    return pressed, faster.model_copy(update=left_open) if left_open else faster


def _by_pressure(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[Sequence[Samples], Vehicle]:
    known = [one.airspeed[np.isfinite(one.airspeed)] for one in flights if one.airspeed is not None]
    speeds_mps = np.concatenate(known) if known else np.empty(0)
    reference_mps = float(np.median(speeds_mps)) if speeds_mps.size else 0.0
    if vehicle.reference_airspeed_mps is not None or reference_mps <= 0.0:
        return flights, vehicle
    pressed = [with_pressure(one, reference_mps, vehicle.powers) for one in flights]
    faster = vehicle.model_copy(update={"reference_airspeed_mps": reference_mps})
    if _criterion(flights, vehicle) - _criterion(pressed, faster) < _DECISIVE:
        return flights, vehicle
    return _by_powers(flights, faster) if vehicle.other_laws else (pressed, faster)


def _criterion(flights: Sequence[Samples], vehicle: Vehicle) -> float:
    """The least Bayesian information criterion of any order."""
    return min(fitting.criteria(fitting.stretches_of(flights), vehicle).values())


def _by_powers(flights: Sequence[Samples], vehicle: Vehicle) -> tuple[list[Samples], Vehicle]:
    """Each surface, or group, in its turn with the power of the airspeed that explains most: slipstream and
    linkages change the square. Another than that must explain decisively more."""

    pressed = [with_pressure(one, vehicle.reference_airspeed_mps or 0.0, vehicle.powers) for one in flights]
    white = coloured(pressed, vehicle)  # a criterion believes each sample, as only white noise lets it

    def with_powers(of: Vehicle, colours: bool = True) -> list[Samples]:
        found = [with_pressure(one, of.reference_airspeed_mps or 0.0, of.powers) for one in flights]
        if not (colours and vehicle.moving_air):
            return found
        return [whitened(one, as_.colour, as_.weight) for one, as_ in zip(found, white, strict=True)]

    least, names = _criterion(with_powers(vehicle), vehicle) - _DECISIVE, list(vehicle.surfaces)
    for group in regression.groups_of(vehicle):
        for power in _POWERS:
            own = vehicle.airspeed_powers | {names[i]: power for i in group}
            other = vehicle.model_copy(update={"airspeed_powers": own})
            if (found := _criterion(with_powers(other), other)) < least:
                least, vehicle = found, other
    return with_powers(vehicle, colours=False), vehicle


def check_explains(tests: list[Document], stretches: Sequence[fitting.Stretch], model: Model) -> None:
    """Raise BadInput where a model explains less of an axis than its mean does, on parts not fitted."""
    known = [test for test in tests if test["samples"]]
    weights = [test["samples"] for test in known]
    shares = {axis: [test["explained"][axis] for test in known] for axis in "pqr"}
    explained = {axis: float(np.average(values, weights=weights)) for axis, values in shares.items() if known}
    if worse := {axis: share for axis, share in explained.items() if share <= 0.0}:
        minutes = sum(int(one.use.sum()) * one.samples.dt_s for one in stretches) / 60.0
        still = min(_movement(stretches, model).items(), key=lambda pair: pair[1])
        raise BadInput(
            f"identify: on parts it was not fitted on the model explains less of {', '.join(worse)} than the "
            f"mean does ({_axes(worse)}), allowed: a model that explains more; what would help: more than "
            f"these {minutes:.1f} min, commands that move more ({still[0]} has a standard deviation of "
            f"{still[1]:.2g}), or the commands that this vehicle follows{_of_rates(stretches, model)}"
        )


def _check_commands(flights: Sequence[Samples], vehicle: Vehicle) -> None:
    """Raise BadInput where a flight's command is in another unit than that of the first."""
    first = Fitted(commands=trust.span(flights[0].commands), rates=trust.span(flights[0].rates))
    for other in flights[1:]:
        trust.check_commands(other.name, other.commands, other.rates, first, list(vehicle.surfaces))


def _of_rates(stretches: Sequence[fitting.Stretch], model: Model) -> str:
    """What the reading has found wrong with the rates, each after a semicolon."""
    rates = tuple(f"{getattr(model.vehicle.rates, axis).column}:" for axis in "pqr")
    notes = [note for one in stretches for note in one.samples.notes if note.startswith(rates)]
    return "".join(f"; {note}" for note in notes)


def _movement(stretches: Sequence[fitting.Stretch], model: Model) -> dict[str, float]:
    """Standard deviation of each surface's command."""
    commands = np.vstack([stretch.samples.commands[stretch.use] for stretch in stretches])
    return dict(zip(model.vehicle.surfaces, np.nanstd(commands, axis=0).tolist(), strict=True))


def _used(stretch: fitting.Stretch) -> Document:
    samples, use = stretch.samples, stretch.use
    return {"name": samples.name, "samples": int(use.sum()), "of": len(use), "notes": list(samples.notes)}


def collinear(stretches: Sequence[fitting.Stretch], model: Model) -> list[Document]:
    """Regressors whose coefficient's variance the others inflate more than tenfold, worst first; None where
    the others make it up."""
    x, _, _ = fitting.stacked(stretches, model.vehicle, model.history, model.lags)
    factors = variance_inflation(x[:, 1:])
    worst = sorted(zip(regressor_names(model), factors.tolist(), strict=True), key=lambda pair: -pair[1])
    told = [(name, factor if isfinite(factor) else None) for name, factor in worst if factor > _COLLINEAR]
    return [{"regressor": name, "inflation": factor} for name, factor in told]


def regressor_names(model: Model) -> list[str]:
    """Names of the columns of the fit after the constant, in their order."""
    rates = [f"{rate}[-{k}]" for k in range(1, model.history + 1) for rate in "pqr"]
    felt = range(1, model.vehicle.felt(model.history) + 1)
    signals = [f"{name}[-{k}]" for k in felt for name in model.vehicle.past_names]
    delays, groups = range(1, model.lags + 1), map("+".join, model.groups)
    return rates + signals + [f"command of {group}[-{k}]" for group in groups for k in delays]


def colour(stretches: Sequence[fitting.Stretch], model: Model) -> dict[str, float]:
    """By how much the residual's colour widens the standard errors of the responses: the median, an axis."""
    fit = fitting.fit_order(stretches, model.vehicle, model.history, model.lags)
    first = len(fit.colour) - len(model.groups) * model.lags
    return dict(zip("pqr", np.median(fit.colour[first:], axis=0).tolist(), strict=True))


def residual_spectrum(stretches: Sequence[fitting.Stretch], model: Model) -> list[Document]:
    """Mean density of the residual by band, over that of white noise of the same variance, an axis."""
    e = np.vstack([fitting.residuals(model, stretch)[1] for stretch in stretches])
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
        *(f"  {line}" for line in found.get("assumed", [])),
        *(f"  together, not distinguishable: {', '.join(g)}" for g in model.groups if len(g) > 1),
        *_pressure_lines(model),
        *dict.fromkeys(
            f"  noise of the colour {', '.join(f'{c:.3g}' for c in one.average)}: {one.wider:.2g} times as "
            "wide, in squares, as gains of 10 s left out differ, and other laws may"
            for one in model.colours
        ),
        *(f"  {line}" for line in trust.unclaimed_lines(model)),
        *(f"  {flight['name']}: {note}" for flight in found["flights"] for note in flight["notes"]),
        *map(_test_line, found["tests"]),
        *_another_day_lines(found["another_day"], len(found["flights"])),
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
        worst, many = found["collinear"][0], len(found["collinear"])
        lines.append(
            f"  {many} {'regressors are' if many > 1 else 'regressor is'} collinear (variance inflated over "
            f"{_COLLINEAR:g} times), most {worst['regressor']} ({_times(worst['inflation'])})"
        )
    return "\n".join(lines)


def _another_day_lines(found: Document, flights: int) -> list[str]:
    """What to expect of a flight that was not fitted; one flight tells of its halves, not of another day."""
    of = (
        "another day, each left out in turn"
        if flights > 1
        else "another half of this day, not of another day"
    )
    lines = []
    if "classes" in found:
        says = [
            f"{name} {found[key]['mean']:.3f} ({found[key]['worst']:.3f})" for key, name in _FIGURES.items()
        ]
        lines.append(f"  expect of {of}, mean (worst): {', '.join(says)}")
    if "false_alarms_per_hour" in found:
        rate, missing = found["false_alarms_per_hour"], found["minutes_missing"]
        lines.append(
            f"  false alarms: {rate['asked']:g} an hour asked for, {rate['low']:.2g} to {rate['high']:.2g} "
            f"at 90 %, by {found['minutes_left_out']:.1f} min of health left out"
        )
        if missing:
            lines.append(f"  to show this rate without a fitted tail {missing:.0f} min of health are missing")
        if found.get("parts"):
            alarmed = f"{found['alarmed']} of {found['parts']} parts left out alarm"
            lines.append(f"  at the threshold of the others {alarmed}")
    return lines


def _pressure_lines(model: Model) -> list[str]:
    if (reference_mps := model.vehicle.reference_airspeed_mps) is None:
        return []
    others = "".join(f", {n} with airspeed^{x:g}" for n, x in model.vehicle.airspeed_powers.items() if x != 2)
    return [f"  surfaces work with the dynamic pressure, 1 at {reference_mps:.4g} m/s{others}"]


def _test_line(test: Document) -> str:
    if not test["samples"]:
        return f"  without {test['left_out']}: nothing in it is known"
    line = f"  without {test['left_out']}: explains {_axes(test['explained'])} of it"
    if "score" not in test:
        return line
    kept = test["score"]
    return (
        f"{line}; {len(kept['settings'])} classes {kept['classes']:.3f}, healthy or faulty "
        f"{kept['healthy_or_faulty']:.3f}, side {kept['side']:.3f}, mean error {kept['mean_error']:.3f}"
    )


def _lag(run: Document) -> str:
    if run["shorter_than_can_be_told"]:
        return "shorter than this rate can tell"
    return f"{run['servo_lag_s']:.3f} s (sd {run['servo_lag_sd_s']:.3f})"


def _times(factor: float | None) -> str:
    return "made up by the others" if factor is None else f"{factor:.0f} times"


def _axes(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {value:.3f}" for axis, value in values.items())


def output_error(stretches: Sequence[fitting.Stretch], groups: list[list[int]]) -> dict[str, Any]:
    """Fit on every other window, test on the rest. Returns servo lag and delay in s, their standard errors,
    and the share of the rates' variance explained over free-running windows not fitted, an axis."""
    from scipy.optimize import least_squares

    dt_s = float(np.median([stretch.samples.dt_s for stretch in stretches]))
    commands, rates = _windows(stretches, groups, round(WINDOW_S / dt_s), round(_MOST_DELAY_S / dt_s) + 1)
    if len(rates) < 20 or not np.ptp(rates, axis=(0, 1)).all():
        return {"windows": len(rates), "says": "too few gap-free windows in which every rate moves"}
    fitted, kept = slice(0, None, 2), slice(1, None, 2)
    spread = rates.std(axis=(0, 1))
    start, low, high = _start(len(groups), dt_s)

    def residual(parameters: Floats, part: slice) -> Floats:
        run = _run(parameters, commands[part], rates[part], dt_s)
        return ((run - rates[part]) / spread).ravel()

    found = least_squares(residual, start, bounds=(low, high), args=(fitted,), loss="soft_l1", max_nfev=40)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0) * float(found.fun @ found.fun) / len(found.fun))
    rest = residual(found.x, kept).reshape(-1, 3) * spread
    explained = 1.0 - rest.var(axis=0) / rates[kept].reshape(-1, 3).var(axis=0)
    return {
        "windows": len(rates),
        "servo_lag_s": float(found.x[0]),
        "servo_lag_sd_s": float(errors[0]),
        "delay_s": float(found.x[1]),
        "delay_sd_s": float(errors[1]),
        "shorter_than_can_be_told": bool(found.x[0] < 2.0 * _LEAST_LAG_S),
        "explained_of_windows_not_fitted": dict(zip("pqr", explained.tolist(), strict=True)),
    }


def _windows(
    stretches: Sequence[fitting.Stretch], groups: list[list[int]], length: int, before: int
) -> tuple[Floats, Floats]:
    """Commands (W, before + length, G) with their past, scaled by labels, and rates (W, length, 3)."""
    commands, rates = [], []
    for stretch in stretches:
        samples = stretch.samples
        effectiveness = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
        grouped = np.column_stack([(samples.commands * effectiveness)[:, g].sum(axis=1) for g in groups])
        good = stretch.use & np.isfinite(grouped).all(axis=1) & np.isfinite(samples.rates).all(axis=1)
        for end in range(before + length, len(good), length):
            part = slice(end - before - length, end)
            if good[part].all() and samples.run[part.start] == samples.run[end - 1]:
                commands.append(grouped[part])
                rates.append(samples.rates[end - length : end])
    step = max(len(rates) // _MOST_WINDOWS, 1)
    shape = (-1, before + length, len(groups))
    return np.reshape(commands[::step], shape), np.reshape(rates[::step], (-1, length, 3))


def _start(groups: int, dt_s: float) -> tuple[Floats, Floats, Floats]:
    """First guess and bounds of lag, delay, A, B and c."""
    values = [0.1, dt_s, *(0.7 * np.eye(3)).ravel(), *np.full(3 * groups, 0.01), *np.zeros(3)]
    free = np.full(len(values) - 2, np.inf)
    low, high = [_LEAST_LAG_S, 0.0, *-free], [_MOST_LAG_S, _MOST_DELAY_S, *free]
    return np.array(values), np.array(low), np.array(high)


def _run(parameters: Floats, commands: Floats, rates: Floats, dt_s: float) -> Floats:
    """Free runs of all windows at once, (W, length, 3)."""
    groups = commands.shape[2]
    lag_s, delay_s = parameters[:2]
    a = parameters[2:11].reshape(3, 3)
    b = parameters[11 : 11 + 3 * groups].reshape(groups, 3)
    c = parameters[11 + 3 * groups :]
    length = rates.shape[1]
    before = commands.shape[1] - length
    whole, part = divmod(delay_s / dt_s, 1.0)
    keep = np.exp(-dt_s / lag_s)
    x, servo = rates[:, 0].copy(), commands[:, 0].copy()
    run = np.empty_like(rates)
    for k in range(commands.shape[1]):
        if k >= before:
            run[:, k - before] = x
            x = x @ a.T + servo @ b + c
        late = max(k - int(whole), 0), max(k - int(whole) - 1, 0)
        command = (1.0 - part) * commands[:, late[0]] + part * commands[:, late[1]]
        servo = keep * servo + (1.0 - keep) * command
    return run
