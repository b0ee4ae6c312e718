"""Fit: from recorded flights to a model, with how well it is known and how it does elsewhere.

Fitted are the stretches known to be healthy; where labels say how much effectiveness was left, the faulty
stretches too, with the commands scaled by it. Half of the choice is refused to the fit: the number of past
samples is taken by the Bayesian information criterion, and every figure of merit comes from parts of the
flights the fit did not see. One flight is cut in two halves of what is known of it; of several, each is left
out in turn.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import extremes, regression, trust
from beaver_ftc_logs.bank import adaptation_of, bank_of
from beaver_ftc_logs.diagnose import Rows, rows_of
from beaver_ftc_logs.filtering import accumulated, evidence, posterior_of
from beaver_ftc_logs.model import Colour, Fitted, Model, Settings
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.samples import Samples, constant_parts
from beaver_ftc_logs.scoring import by_labels
from beaver_ftc_logs.vehicle import Vehicle

EDGE_S = 1.5
"""Labels are good to about a second: what lies nearer to a change is not fitted."""
SHORTEST_S = 3.0
"""A label that holds for less is the edge of another."""
HISTORIES = (1, 2, 3, 4)
LAGS = (2, 3, 4, 6)
_COLOUR_S = 2.0
_STILL_RAD_S = 1e-6
_AFTER_EVENT_S = 1.0
_SURE, _HOLD_S, _POWER_ALONE = 0.995, 0.3, 0.9
"""Where no labels say how often things break, an alarm asks for more: for how much, the benchmark decided.
With parts enough that are not fitted, the rate of false alarms decides instead."""
_PER_HOUR = 1.0
_DRIFT_S = (2.0, 8.0)
"""Spans whose means tell the drift of the trim from the residual's colour."""
_POWER = 0.8
"""A coloured residual tells less than a white one: by how much, blocked tests decided."""
_OTHER_DAYS: dict[str, Any] = {
    "trim_sd": 0.1,
    "trim_shift": 0.03,
    "trim_walk": [2.5e-3, 6e-4, 2e-3],
    "gain_sd": 0.1,
    "gain_time_s": 300.0,
    "own_gain_sd": 0.03,
}
"""How far another day may be: chosen on days drawn from one flight, judged on others (`--other-days`). The
drift of the trim is what the means of the residual over 30 s show in that flight."""
_OTHER_LAWS: dict[str, Any] = {
    "own_gain_sd": 0.05,
    "own_gain_time_s": 20.0,
    "name_evidence": 2.0,
    "rename_s": 1.0,
    "one_group": True,
}
"""How far each group's gain wanders under a law and air that the fit has not seen (a law that answers what is
not modelled ties the command to it), and what a name asks for then. Chosen on simulated flights
(`own_logs.py`, seeds 1 to 6)."""
_MOVING_AIR: dict[str, Any] = {"own_gain_sd": 0.08, "own_gain_time_s": 100.0}
_WINDOW_S, AR_ORDER = 10.0, 20
"""Whitened by the flight's own noise model and an AR predictor of so many samples; gains differ by flight
rather than within it: chosen on seeds 11 and 12, in light turbulence; what a name asks for on a pa28's
seed 11."""
_POWER_OTHER_LAWS, _THEORIES = 0.4, 2.0
"""A law may feed a gyro's noise to the surfaces, which doubles the residual of one that does not: a sample
then tells less than the fit knows. And so many times the evidence of theory raises an alarm. Chosen in the
same way, the first on seed 1 of five aircraft."""
_AFTER_GYROS, _AFTER_GUSTS = 1.7, 2.5
"""In moving air the noise of another law's flight is so many times wider, gyros' or gusts', for gains too.
Chosen on seeds 71, 73 and 101 to 106: 3 of 240 healthy flights alarmed, and with no such factor 6 of 150."""
_MOST_WIDER = 200.0
"""What a part counts at most: of few flights one can be far from all others (1,550 of seed 205, else 5)."""
_DELAYS = (-0.4, 0.0, 0.4)
"""Delays beside the model's that a flight may have, in samples."""
_ALIKE = 1e-9
_MISREAD_PARTS = 4
"""Parts left out whose columns are read wrongly, too: the largest of n is passed by the next, if that is
alike, with the chance 1 / (n + 1)."""
_MOST_PARTS, _MOST_GAIN_SD = 12, 0.33
"""A gain that is known no better than to a third is not known to be there."""
_PRIOR_CHANGES = 20
"""Changes that count as seen before the labels are read, half of them repairs."""
_MASSES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
_WANTED = 0.93
"""Coverage the bounds aim at: 90 % and some of what another day takes away."""


Found = TypeVar("Found")


@dataclass(frozen=True)
class Stretch:
    """A flight and which of its samples may be fitted; known: what was made of it and others already."""

    samples: Samples
    use: NDArray[np.bool_]
    known: dict[tuple[object, ...], tuple[object, object]] = field(
        default_factory=dict, repr=False, compare=False
    )


def _once(stretches: Sequence[Stretch], what: tuple[object, ...], make: Callable[[], Found]) -> Found:
    """What is made of these very stretches, once: every test of a model asks for the same fits to parts."""
    memory, key = stretches[0].known, (*what, *map(id, stretches))
    if key not in memory:
        memory[key] = (tuple(stretches), make())  # held: an id is of one object while this lives
    return memory[key][1]  # type: ignore[return-value]


def stretches_of(flights: Sequence[Samples]) -> list[Stretch]:
    """What of each flight is known well enough to be fitted."""
    return [Stretch(samples, usable(samples)) for samples in flights]


def usable(samples: Samples) -> NDArray[np.bool_]:
    """Which samples are known to be healthy, or faulty by a known amount, (n,)."""
    use = np.ones(len(samples.t_s), dtype=bool)
    if samples.events:
        use &= samples.t_s < min(event.t_s for event in samples.events) - _AFTER_EVENT_S
    labelled = np.isfinite(samples.labels).any(axis=0)
    if not labelled.any():
        return use
    labels = samples.labels[:, labelled]
    use &= np.isfinite(labels).all(axis=1)
    for begin, end in constant_parts(labels):
        short = (end - begin) * samples.dt_s < SHORTEST_S
        edge = round(EDGE_S / samples.dt_s)
        use[begin : end if short else begin + edge] = False
        use[max(end - edge, begin) : end] = False
    return use


def fit_model(stretches: Sequence[Stretch], vehicle: Vehicle, settings: Settings | None = None) -> Model:
    """The model that fits these stretches. Raises BadInput where there is too little to fit."""
    history, lags = choose_order(stretches, vehicle)
    model = _model(stretches, vehicle, history, lags)
    model = model.model_copy(update={"settings": settings or prior(stretches, model)})
    return _widened(stretches, model) if model.colours else model


def fit_like(stretches: Sequence[Stretch], model: Model) -> Model:
    """Another fit of the same order and settings to other stretches."""
    fitted = _model(stretches, model.vehicle, model.history, model.lags)
    wider = {tuple(one.average): one.wider for one in model.colours}
    return _with_wider(fitted.model_copy(update={"settings": model.settings}), wider)


def _with_wider(model: Model, wider: dict[tuple[float, ...], float]) -> Model:
    colours = [one.model_copy(update={"wider": wider.get(tuple(one.average), 1.0)}) for one in model.colours]
    return model.model_copy(update={"colours": colours})


def _left_out(
    stretches: Sequence[Stretch], model: Model, tied: list[float]
) -> Iterator[tuple[Model, Sequence[Stretch]]]:
    """Fits like the model to parts of the stretches, with how well each knows its gains; and the rest. tied:
    of the whole, as in `Fitted`."""
    for fitted, kept in _parts(stretches):
        like = fit_like(fitted, model)
        fit = fit_order(fitted, model.vehicle, model.history, model.lags)
        known = gain_sd(fit, model).tolist()
        own = Fitted(commands=[], rates=[], gain_sd=known, tied=tied)
        yield like.model_copy(update={"fitted": own}), kept


def choose_order(stretches: Sequence[Stretch], vehicle: Vehicle) -> tuple[int, int]:
    """Past samples of rates and commands by the Bayesian information criterion."""
    scores = criteria(stretches, vehicle)
    return min(scores, key=lambda order: scores[order])


def criteria(stretches: Sequence[Stretch], vehicle: Vehicle) -> dict[tuple[int, int], float]:
    """The Bayesian information criterion of each number of past samples of rates and commands.

    Every order's regressors are among those of the largest: one matrix of products serves all.
    """
    x, y, _ = stacked(stretches, vehicle, max(HISTORIES), max(LAGS))
    size = np.maximum(np.sqrt((x**2).mean(axis=0)), TINY)
    products, cross, own = (x / size).T @ (x / size), (x / size).T @ y, y.T @ y
    scores = {}
    for history in HISTORIES:
        for lags in LAGS:
            columns = _columns(vehicle, history, lags)
            found = np.linalg.lstsq(products[np.ix_(columns, columns)], cross[columns], rcond=1e-12)[0]
            log_det = np.linalg.slogdet((own - cross[columns].T @ found) / len(y))[1]
            scores[history, lags] = len(y) * log_det + 3 * len(columns) * np.log(len(y))
    return scores


def _columns(vehicle: Vehicle, history: int, lags: int) -> list[int]:
    """Columns of the largest design that an order has."""
    first, signals = 1 + 3 * max(HISTORIES), len(vehicle.past_names)
    commands = first + signals * vehicle.felt(max(HISTORIES))
    starts = [commands + group * max(LAGS) for group in range(len(regression.groups_of(vehicle)))]
    delayed = [start + lag for start in starts for lag in range(lags)]
    return [*range(1 + 3 * history), *range(first, first + signals * vehicle.felt(history)), *delayed]


def fit_order(stretches: Sequence[Stretch], vehicle: Vehicle, history: int, lags: int) -> regression.Fit:
    """Least squares of given order over all stretches."""
    what = ("order", vehicle.model_dump_json(), history, lags)
    return _once(stretches, what, lambda: _fit_order(stretches, vehicle, history, lags))


def _fit_order(stretches: Sequence[Stretch], vehicle: Vehicle, history: int, lags: int) -> regression.Fit:
    x, y, run = stacked(stretches, vehicle, history, lags)
    if len(y) < 10 * x.shape[1]:
        raise BadInput(
            f"identify: {len(y)} samples known to be healthy, allowed: at least {10 * x.shape[1]} to fit "
            f"{x.shape[1]} coefficients an axis"
        )
    still = [axis for axis, spread in zip("pqr", y.std(axis=0), strict=True) if spread < _STILL_RAD_S]
    if still:
        raise BadInput(f"identify: rate {still[0]} does not move, allowed: flights in which every rate does")
    dt_s = float(np.median([stretch.samples.dt_s for stretch in stretches]))
    return regression.least_squares(x, y, run, round(_COLOUR_S / dt_s))


def stacked(
    stretches: Sequence[Stretch], vehicle: Vehicle, history: int, lags: int
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Regressors, rates and run number over all stretches: the same samples for any order.

    Columns of the regressors: one, the past, the commands of each group by lag.
    """
    groups, reach = regression.groups_of(vehicle), max(HISTORIES + LAGS)
    xs, ys, runs = [], [], []
    for number, stretch in enumerate(stretches):
        one, felt = stretch.samples, vehicle.felt(history)
        past, commands, ok = regression.build(one, groups, history, lags, True, felt)
        use = stretch.use & ok
        use[:reach] = False
        n = len(past)
        xs.append(one.weight * np.column_stack([np.ones(n), past, commands.reshape(n, -1)])[use])
        ys.append(one.weight * one.rates[use])
        runs.append(np.cumsum(np.diff(np.flatnonzero(use), prepend=0) > 1) + 1_000_000 * number)
    return np.vstack(xs), np.vstack(ys), np.concatenate(runs)


def _model(stretches: Sequence[Stretch], vehicle: Vehicle, history: int, lags: int) -> Model:
    what = ("model", vehicle.model_dump_json(), history, lags)
    return _once(stretches, what, lambda: _fit_model(stretches, vehicle, history, lags))


def _fit_model(stretches: Sequence[Stretch], vehicle: Vehicle, history: int, lags: int) -> Model:
    fit = fit_order(stretches, vehicle, history, lags)
    names, groups = list(vehicle.surfaces), regression.groups_of(vehicle)
    first = len(fit.coefficients) - len(groups) * lags
    shape = (len(groups), lags, 3)
    model = Model(
        vehicle=vehicle,
        rate_hz=1.0 / float(np.median([stretch.samples.dt_s for stretch in stretches])),
        groups=[[names[i] for i in group] for group in groups],
        history=history,
        lags=lags,
        intercept=fit.coefficients[0].tolist(),
        past=fit.coefficients[1:first].tolist(),
        response=fit.coefficients[first:].reshape(shape).tolist(),
        response_sd=fit.standard_errors[first:].reshape(shape).tolist(),
        noise=fit.covariance.tolist(),
    )
    return model.model_copy(update={"colours": _colours(stretches, model)})


def _colours(stretches: Sequence[Stretch], model: Model) -> list[Colour]:
    """The colours that flights are whitened by, with the noise of each."""
    found = []
    for colour in sorted({one.samples.colour for one in stretches} - {()}):
        alike = [residuals(model, one) for one in stretches if one.samples.colour == colour]
        found.append(_with_predictor(list(colour), alike))
    return found


def _with_predictor(average: list[float], residual: Sequence[tuple[NDArray[np.int64], Floats]]) -> Colour:
    """A noise model with an AR predictor of the residual, by least squares where samples follow one another,
    and the remaining noise; without a predictor where too few do."""
    parts = [e[begin:end] for rows, e in residual for begin, end in _runs(rows)]
    ends = [part[AR_ORDER:] for part in parts]
    if sum(map(len, ends)) < 10 * 3 * AR_ORDER:
        return Colour(average=average, noise=np.cov(np.vstack(parts).T).tolist())
    x = np.vstack([
        np.hstack([part[AR_ORDER - j : len(part) - j] for j in range(1, AR_ORDER + 1)])
        for part in parts if len(part) > AR_ORDER
    ])  # fmt: skip
    y = np.vstack(ends)
    by = np.linalg.lstsq(x, y, rcond=None)[0]
    return Colour(average=average, before=by.tolist(), noise=np.cov((y - x @ by).T).tolist())


def prior(stretches: Sequence[Stretch], model: Model) -> Settings:
    """What the flights say about faults to come: levels seen, and how often they changed.

    A flight may be tested less hard than these: the rate is the geometric mean of theirs and the usual.
    """
    hours = sum(stretch.use.sum() * stretch.samples.dt_s for stretch in stretches) / 3600.0
    changes, repairs, levels = 0, 0, {}
    names = list(model.vehicle.surfaces)
    for group in model.groups:
        column = names.index(group[0])
        seen = [_levels(stretch, column) for stretch in stretches] if len(group) == 1 else []
        levels["+".join(group)] = sorted({level for flight in seen for level in flight if level < 1.0})
        changes += sum(max(len(flight) - 1, 0) for flight in seen)
        repairs += sum(int(level == 1.0) for flight in seen for level in flight[1:])
    levels = {name: found for name, found in levels.items() if found}
    moving = model.vehicle.moving_air
    delays_s = [share / model.rate_hz for share in ((0.0,) if moving else _DELAYS)]
    laws = _OTHER_LAWS | (_MOVING_AIR if moving else {}) if model.vehicle.other_laws else {}
    if not levels:
        walk = _drift(stretches, model)
        usual = model.model_copy(update={"settings": Settings(trim_walk=walk, **laws)})
        most = (1.0 if moving else _POWER_OTHER_LAWS) if laws else _POWER_ALONE
        power = min(most, 1.0 / dispersion(stretches, usual))
        alarm = {"alarm": _SURE, "hold_s": _HOLD_S}
        return Settings(**alarm, **laws, power=power, trim_walk=walk, delays_s=delays_s)
    return Settings(
        levels=levels,
        changes_per_hour=float(np.sqrt((changes + 1) / hours * Settings().changes_per_hour)),
        **(_OTHER_DAYS | laws),
        delays_s=delays_s,
        repair_share=(repairs + _PRIOR_CHANGES / 2) / (changes + _PRIOR_CHANGES),
        power=_POWER,
    )


def dispersion(stretches: Sequence[Stretch], model: Model) -> float:
    """How many times as far, in squares, the gains of parts left out are from 1 as the filter believes.

    Residuals e = F (g - 1) + noise of a part give the gains g of its groups, least squares with trims aside.
    Were the noise white and flights alike, the squares of g - 1 in the covariance (F' F)^-1 + S would be as
    many as gains, on average; S is what the filter leaves free. What flights differ in and colour make more:
    so much less does a sample tell of an effectiveness [McCullagh1989, section 4.5]. One part counts as seen
    that is as believed.
    """
    whole = [(stretch.samples, stretch.use) for stretch in stretches]
    squares = number = float(len(model.groups))
    for tested, kept in _left_out(stretches, model, trust.tied(whole, model).tolist()):
        told = np.array(trust.claimed(tested))
        for one in kept:
            x, e = _answers(tested, one)
            x = x.sum(axis=3)[:, :, told].reshape(e.size, -1)
            farther, rank = _farther(x, e.ravel(), _gain_covariance(tested, told))
            squares, number = squares + farther, number + rank
    return squares / number


def _widened(stretches: Sequence[Stretch], model: Model) -> Model:
    """The model with the noise of each colour so many times wider as the gains of ten seconds left out, each
    axis of an answer with its own, are farther from 1, in squares, than it and the filter let them be: quiet
    gyros show what the model itself lacks."""
    whole = [(stretch.samples, stretch.use) for stretch in stretches]
    found: dict[tuple[float, ...], list[float]] = {}
    for tested, kept in _left_out(stretches, model, trust.tied(whole, model).tolist()):
        told = np.array(trust.claimed(tested))
        between: Floats = np.asarray(np.kron(_gain_covariance(tested, told), np.ones((3, 3))), dtype=float)
        for one in kept:
            x, e = _answers(tested, one)
            x = x[:, :, told].reshape(*e.shape, -1)
            count = max(round(len(e) * one.samples.dt_s / _WINDOW_S), 1)
            for part in np.array_split(np.arange(len(e)), count):
                f, left = x[part] - x[part].mean(axis=0), e[part] - e[part].mean(axis=0)
                squares, rank = _farther(f.reshape(left.size, -1), left.ravel(), between)
                found.setdefault(one.samples.colour, []).append(min(squares / max(rank, 1), _MOST_WIDER))
    wider = {colour: max(float(np.mean(ratio)), 1.0) for colour, ratio in found.items()}
    if model.vehicle.other_laws:
        wider = {
            one: size * (_AFTER_GYROS if _of_gyros(one) else _AFTER_GUSTS) for one, size in wider.items()
        }
    return _with_wider(model, wider)


def _of_gyros(colour: Sequence[float]) -> bool:
    """Whether noise takes from the next sample what it added to one, as an instrument's does."""
    return len(colour) > 1 and colour[1] < 0.0


def _gain_covariance(model: Model, told: NDArray[np.bool_]) -> Floats:
    """Covariance of the gains of groups told that the filter leaves free."""
    free = adaptation_of(model).covariance[3:, 3:]
    return np.asarray(free[0, 0] + np.diag(np.diag(free)[1:][told]))


def _farther(x: Floats, e: Floats, between: Floats) -> tuple[float, int]:
    """Squares of the gains of residuals e (m,) on answers x (m, G), in their covariance and what lies between
    flights, and how many gains there are."""
    information, score = x.T @ x, x.T @ e
    gains = np.linalg.lstsq(information, score, rcond=_ALIKE)[0]
    apart = np.eye(len(gains)) + between @ information  # singular by rounding where nothing tells a gain
    squares = max(float(score @ np.linalg.lstsq(apart, gains, rcond=_ALIKE)[0]), 0.0)
    return squares, int(np.linalg.matrix_rank(information, tol=_ALIKE * np.trace(information)))


def _answers(model: Model, kept: Stretch) -> tuple[Floats, Floats]:
    """What each axis of each group's answer does to the residuals (n, 3) of a part, (n, 3, G, 3), both in sd
    of the noise, without means."""
    _, residual, answers = whitened_residual(model, kept)
    whiten = np.linalg.inv(np.linalg.cholesky(np.array(model.with_noise_model(kept.samples.colour).noise))).T
    x, e = np.einsum("nga,ab->nbga", answers, whiten), residual @ whiten
    return x - x.mean(axis=0), e - e.mean(axis=0)


def _drift(stretches: Sequence[Stretch], model: Model) -> list[float]:
    """Drift of the trim a sample, in residual sd, that parts left out show; the usual at least.

    Means of n samples of a random walk, with steps of variance w, and of noise whose mean has the variance
    c / n differ from the next with the variance 2 c / n + 2 n w / 3: two n tell w from c.
    """
    squares, counts, lengths = np.zeros((2, 3)), np.zeros(2), np.round(np.array(_DRIFT_S) * model.rate_hz)
    for fitted, kept in _parts(stretches):
        like = fit_like(fitted, model)
        for one in kept:
            rows, residual, _ = whitened_residual(like, one)
            noise = np.array(like.with_noise_model(one.samples.colour).noise)
            white = residual / np.sqrt(np.maximum(np.diag(noise), TINY))
            for begin, end in _runs(rows):
                for i, n in enumerate(lengths.astype(int).tolist()):
                    means = white[begin:end][: (end - begin) // n * n].reshape(-1, n, 3).mean(axis=1)
                    squares[i] += (np.diff(means, axis=0) ** 2).sum(axis=0)
                    counts[i] += max(len(means) - 1, 0)
    least = np.array(Settings().trim_walk)
    if not counts.all():
        return least.tolist()
    short, long = squares / counts[:, None]
    n, m = lengths
    walk = 1.5 * (m * long - n * short) / (m**2 - n**2)
    return np.maximum(np.sqrt(np.maximum(walk, 0.0)), least).tolist()


def _runs(rows: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Begin and end of what of increasing places follows one another."""
    edges = [0, *(np.flatnonzero(np.diff(rows) > 1) + 1).tolist(), len(rows)]
    return list(pairwise(edges))


def _levels(stretch: Stretch, column: int) -> list[float]:
    """The levels of one surface's label in their order, edges left out."""
    values = stretch.samples.labels[:, column][stretch.use]
    return [round(level, 6) for level, _ in groupby(values[np.isfinite(values)].tolist())]


def folds(stretches: Sequence[Stretch]) -> list[tuple[list[Stretch], Stretch, str]]:
    """What is fitted, what is kept, and what the kept part is called."""
    if len(stretches) > 1:
        rest = [[other for other in stretches if other is not kept] for kept in stretches]
        return [(fitted, kept, kept.samples.name) for fitted, kept in zip(rest, stretches, strict=True)]
    (only,) = stretches
    first, second = _once(stretches, ("halves",), lambda: _halves(only))
    return [([first], second, "second half"), ([second], first, "first half")]


def _halves(only: Stretch) -> tuple[Stretch, Stretch]:
    """What is known of a flight in two halves."""
    known = np.flatnonzero(only.use)
    middle = int(known[len(known) // 2]) if len(known) else 0
    early = np.arange(len(only.use)) < middle
    return Stretch(only.samples, only.use & early), Stretch(only.samples, only.use & ~early)


def trusted(stretches: Sequence[Stretch], model: Model) -> Model:
    """The model with what it was fitted on, and how it did on parts that were left out: how noisy they were,
    and at which evidence of a fault they would alarm as often as declared."""
    used = [(stretch.samples, stretch.use) for stretch in stretches]
    scale, misread, parts = 1.0, 0.0, list[extremes.Part]()
    for tested, kept in _left_out(stretches, model, trust.tied(used, model).tolist()):
        for one in kept:
            noise, part = _in_health(tested, one)
            scale = max(scale, noise)
            if len(parts) < _MISREAD_PARTS:
                misread = max(misread, _misread(tested, one))
            parts.append(part)
    fit = fit_order(stretches, model.vehicle, model.history, model.lags)
    known = trust.fitted_on(used, model, gain_sd(fit, model), scale)
    asked = model.vehicle.false_alarms_per_hour
    per_hour = _PER_HOUR if asked is None and not model.settings.levels else asked
    tail = extremes.tail_of(parts)
    if tail is None and asked is not None:
        says = f"{_minutes(parts):.1f} min of health left out have too few peaks of the evidence to tell"
        more = extremes.SHOWN * 60.0 / asked - _minutes(parts)
        raise BadInput(f"identify: false_alarms_per_hour {asked:g}: {says}, allowed: {more:.0f} min more")
    calibrates = bool(tail or model.vehicle.other_laws)
    threshold = _threshold(tail, per_hour, model) if per_hour and calibrates else None
    settings = {"false_alarms_per_hour": per_hour, "threshold": threshold}
    return model.model_copy(
        update={
            "fitted": known.model_copy(update={"tail": tail, "misread": misread}),
            "settings": model.settings.model_copy(update=settings),
            "identified": dict(_alone(parts, per_hour, model)),
        }
    )


def _threshold(tail: extremes.Tail | None, per_hour: float, model: Model) -> float:
    """By the tail; under laws of which the parts left out say nothing, by theory if that asks for more."""
    theories = (1.0 if model.vehicle.moving_air else _THEORIES) if model.vehicle.other_laws else 0.0
    least = theories * extremes.sure_threshold(model.rate_hz, per_hour)
    return max(extremes.threshold_for(tail, per_hour), least) if tail is not None else least


def _misread(model: Model, kept: Stretch) -> float:
    """How much likelier a sample of a part left out, in health, is with its columns read wrongly, at most."""
    rates = np.where(kept.use[:, None], kept.samples.rates, np.nan)
    more, _ = trust.mended_likelier(replace(kept.samples, rates=rates), model)
    return max(0.0, *more.values()) if more else 0.0


def _minutes(parts: Sequence[extremes.Part]) -> float:
    return 60.0 * sum(hours for _, hours in parts)


def _alone(parts: Sequence[extremes.Part], per_hour: float | None, model: Model) -> Document:
    """What parts left out say of another day: how many would have alarmed, each at the threshold that the
    others ask for, and how often."""
    tails = [extremes.tail_of([*parts[:i], *parts[i + 1 :]]) for i in range(len(parts))]
    if per_hour is None or len(parts) < 2 or not all(tails):
        return {}
    limits = [_threshold(tail, per_hour, model) for tail in tails if tail]
    alarms = [int((peaks >= limit).sum()) for (peaks, _), limit in zip(parts, limits, strict=True)]
    return {
        "parts": len(parts),
        "minutes": _minutes(parts),
        "alarmed": sum(count > 0 for count in alarms),
        "alarms": sum(alarms),
    }


def _in_health(model: Model, kept: Stretch) -> tuple[float, extremes.Part]:
    """Of a part left out the largest scale of the noise, the peaks of the alarm statistic in health, and its
    healthy hours."""
    bank = bank_of(model)
    posterior, _, scale = posterior_of(kept.samples, model, bank)
    gained, labels = evidence(posterior, bank), kept.samples.labels
    well = kept.use & ~(labels < 1.0).any(axis=1) & (posterior[:, bank.idle] < 0.5)
    rows = np.flatnonzero(well)
    sums = [accumulated(gained[rows[begin:end]], np.inf) for begin, end in _runs(rows)]
    peaks = np.concatenate([extremes.peaks_of(one) for one in sums])
    return float(scale[kept.use].max(initial=1.0)), (peaks, len(rows) * kept.samples.dt_s / 3600.0)


def _parts(stretches: Sequence[Stretch]) -> list[tuple[list[Stretch], list[Stretch]]]:
    """What is fitted and what is left out: halves of one flight, or each flight; of many every twelfth."""
    if len(stretches) == 1:
        return [(fitted, [kept]) for fitted, kept, _ in folds(stretches)]
    count = min(len(stretches), _MOST_PARTS)
    turns = [[i for i in range(len(stretches)) if i % count == turn] for turn in range(count)]
    return [
        ([one for i, one in enumerate(stretches) if i not in out], [stretches[i] for i in out])
        for out in turns
    ]


def gain_sd(fit: regression.Fit, model: Model) -> Floats:
    """Standard error of each group's gain, (G,), colour included: of its response summed over lags, along
    itself, weighed by the noise; for `other_laws` of the factor of the whole response. Where a surface's slow
    effect is made up by the past, as an elevator's by alpha, its sum is not known, and its factor is.

    Responses b with errors of covariance V tell their factor with the variance 1 / (b' V^-1 b).
    """
    groups, lags = len(model.groups), model.lags
    first = len(fit.coefficients) - groups * lags
    noise = np.sqrt(np.maximum(np.diag(fit.covariance), TINY))
    found, information = np.zeros(groups), np.full(groups, TINY)
    for g in range(groups):
        part = slice(first + g * lags, first + (g + 1) * lags)
        together, errors = fit.correlation[part, part], fit.standard_errors[part] / noise
        own = fit.coefficients[part].sum(axis=0) / noise
        variance = np.einsum("la,lm,ma->a", errors, together, errors)
        found[g] = np.sqrt(own**2 @ np.maximum(variance, 0.0)) / max(float(own @ own), TINY)
        known = fit.coefficients[part] / noise / np.maximum(errors, TINY)
        information[g] += np.einsum("la,lm,ma->", known, np.linalg.pinv(together, rcond=_ALIKE), known)
    return np.minimum(1.0 / np.sqrt(information) if model.vehicle.other_laws else found, _MOST_GAIN_SD)


def explained(stretches: Sequence[Stretch], model: Model) -> list[Document]:
    """What the model explains of parts left out, one entry a fold."""
    return [
        {"left_out": name, **prediction(fit_like(fitted, model), kept)}
        for fitted, kept, name in folds(stretches)
    ]


def run_tests(stretches: Sequence[Stretch], model: Model) -> tuple[list[Document], float]:
    """One entry a fold, and the posterior mass with which the bounds hold the labels as they should."""
    entries: list[Document] = []
    held: list[list[float]] = []
    for fitted, kept, name in folds(stretches):
        tested = fit_like(fitted, model)
        entry: Document = {"left_out": name, **prediction(tested, kept)}
        labels = np.where(kept.use[:, None], kept.samples.labels, np.nan)
        if np.isfinite(labels).all(axis=1).any():
            by_mass = _rows_by_mass(tested, kept)
            entry["score"] = by_labels(by_mass[model.settings.bounds], labels)
            held.append([by_labels(by_mass[mass], labels)["held_by_bounds"] for mass in _MASSES])
        entries.append(entry)
    if not held:
        return entries, model.settings.bounds
    return entries, _MASSES[int(np.argmin(np.abs(np.mean(held, axis=0) - _WANTED)))]


def _rows_by_mass(model: Model, kept: Stretch) -> dict[float, Rows]:
    bank = bank_of(model)
    posterior, _, _ = posterior_of(kept.samples, model, bank)
    settings = [model.settings.model_copy(update={"bounds": m}) for m in {*_MASSES, model.settings.bounds}]
    return {
        one.bounds: rows_of(kept.samples, model.model_copy(update={"settings": one}), bank, posterior)
        for one in settings
    }


def prediction(model: Model, kept: Stretch) -> Document:
    """Share of the rates' variance that one-step prediction explains, and the residual, an axis."""
    rows, residual = residuals(model, kept)
    rates = kept.samples.rates[rows]
    if not len(rates):
        return {"samples": 0}
    explained = 1.0 - residual.var(axis=0) / np.maximum(rates.var(axis=0), TINY)
    return {
        "samples": len(rates),
        "explained": dict(zip("pqr", explained.tolist(), strict=True)),
        "residual_rad_s": dict(zip("pqr", residual.std(axis=0).tolist(), strict=True)),
    }


def whitened_residual(model: Model, kept: Stretch) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Places (n,) of the samples in use, the unpredicted part of the residual (n, 3), and answers
    (n, G, 3) as they show in it."""
    ok, unexplained, answers = regression.in_white(kept.samples, model, scaled=True)
    rows = np.flatnonzero(kept.use & ok)
    constant = model.constant(kept.samples.colour)
    return rows, (unexplained - answers.sum(axis=1) - constant)[rows], answers[rows]


def residuals(model: Model, kept: Stretch) -> tuple[NDArray[np.int64], Floats]:
    """Places (n,) of the samples in use, and their one-step residuals (n, 3)."""
    ok, unexplained, answers = regression.predicted(kept.samples, model, scaled=True)
    rows = np.flatnonzero(kept.use & ok)
    return rows, (unexplained - answers.sum(axis=1) - np.array(model.intercept))[rows]
