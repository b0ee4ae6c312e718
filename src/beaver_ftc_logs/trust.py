"""Credible or silent: where a model may be believed, and why not elsewhere.

What a model was fitted on is in its file (`Fitted`). A row is credible where the commands, rates and
the airspeed of the last seconds are such as the fit has seen, and where every signal lives. Elsewhere nothing
is said: no name, and bounds of 0 and 1. The size of the residual does not count, since a fault makes it large
too: where it is larger than in the flights of the model, the filter takes the noise to be as much larger, and
a sample counts for less. A log is refused only where a mistake in its columns explains it.
A row uses nothing later than its time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Document
from beaver_ftc_logs import energy, regression
from beaver_ftc_logs.model import Fitted, Model
from beaver_ftc_logs.readings import mended
from beaver_ftc_logs.recording import TINY, Floats
from beaver_ftc_logs.samples import NOISE_COLOURS, Samples, whitened
from beaver_ftc_logs.signals import STILL_S

Mask = NDArray[np.bool_]

_WIDER = 0.5
"""Share of its span by which a range is passed before a row is outside."""
_AIRSPEED = 0.15
_WINDOW_S, _OUTSIDE = 5.0, 0.5
_STILL_LONGER = 3.0
_MISREAD, _ENOUGH = 0.001, 8000
"""Probability with which chance alone may look like a mistake in the columns; samples that are compared."""
_CLIPPED_S = 30.0
_TIED, _PLAIN = 0.98, 12.5
"""Of an effect of so many variances of the noise a sample, a fiftieth is half a standard deviation."""
_UNIT, _SPREAD = 10.0, 1.6
_ALIKE, _OTHER_UNIT = 3.0, 12.0
_IN_UNITS = ": one unit (57.3 is deg for rad, 100 percent: `unit`, `scale`)"
_RARE = (0.001, 0.999)
_MIDDLE = 2.366
"""The median of a square of three axes."""
REVERSED, _LITTLE, _FAINT = -0.3, 0.2, 0.5
"""Gains below which a command works the other way round, or hardly, and another column is another. Of 576
correct logs with faults of any kind none was below 0.98 and 0.87, in light turbulence 0.93 and 0.99
(`own_logs.py`, seeds 31 to 42; 71 to 201)."""


def fitted_on(flights: Sequence[tuple[Samples, Mask]], model: Model, gain_sd: Floats, scale: float) -> Fitted:
    """What a model was fitted on. flights: with the samples used; gain_sd (G,) and scale: of parts not
    fitted."""
    groups = regression.group_indices(model)
    rates = np.vstack([samples.rates[use] for samples, use in flights])
    commands = np.vstack([samples.commands[use] for samples, use in flights])
    known = [samples.airspeed[use] for samples, use in flights if samples.airspeed is not None]
    grouped = np.column_stack([commands[:, group].sum(axis=1) for group in groups])
    return Fitted(
        commands=span(commands),
        rates=span(rates),
        airspeed=span(np.concatenate(known)[:, None])[0] if known else None,
        spread=np.nanstd(rates, axis=0).tolist(),
        correlation=_correlation(grouped).tolist(),
        tied=tied(flights, model).tolist(),
        gain_sd=gain_sd.tolist(),
        still_s=_longest_still(flights),
        scale=scale,
        energy_climb=_unpowered(flights),
        minutes=sum(int(use.sum()) * samples.dt_s for samples, use in flights) / 60.0,
    )


def _unpowered(flights: Sequence[tuple[Samples, Mask]]) -> float | None:
    """How fast the energy height falls in the lowest part of healthy flight, m/s; None where nobody knows."""
    known = [one.energy_climb[use] for one, use in flights if one.energy_climb is not None]
    values = np.concatenate(known) if known else np.empty(0)
    values = values[np.isfinite(values)]
    return float(np.quantile(values, energy.LOWEST)) if values.size else None


def span(values: Floats) -> list[list[float]]:
    """Least and largest of each column but for the rarest, [0, 0] where nothing is known."""
    if not values.shape[1]:
        return []
    known = np.where(np.isfinite(values).any(axis=0), values, 0.0)
    return np.nanquantile(known, _RARE, axis=0).T.tolist()


def _correlation(values: Floats) -> Floats:
    centred = np.nan_to_num(values - np.nanmean(values, axis=0))
    size = np.sqrt((centred**2).sum(axis=0))
    return np.asarray(centred.T @ centred / np.maximum(np.outer(size, size), TINY))


def _longest_still(flights: Sequence[tuple[Samples, Mask]]) -> dict[str, float]:
    names = dict.fromkeys(name for samples, _ in flights for name in samples.still_s)
    return {
        name: max((float(one.still_s[name].max(initial=0.0)) for one, _ in flights if name in one.still_s))
        for name in names
    }


def tied(flights: Sequence[tuple[Samples, Mask]], model: Model) -> Floats:
    """Share of each group's effect on the rates that past, signals and the other groups make up, (G,): where
    it is near 1 the law ties the group to what it answers to, and its effect cannot be told; 1 where the
    group never moved. An effect far above the noise may be made up to a larger share: what is left counts."""
    groups = regression.group_indices(model)
    order = model.history, model.lags, True, model.vehicle.felt(model.history)
    parts = [regression.build(one, groups, *order) for one, _ in flights]
    use = [mask & ok for (_, mask), (_, _, ok) in zip(flights, parts, strict=True)]
    past = np.vstack([part[0][kept] for part, kept in zip(parts, use, strict=True)])
    commands = np.vstack([part[1][kept] for part, kept in zip(parts, use, strict=True)])
    response, noise = np.array(model.response), np.array(model.noise)
    whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
    found = np.ones(len(groups))
    for g in range(len(groups)):
        others = [commands[:, other] for other in range(len(groups)) if other != g]
        known = np.column_stack([np.ones(len(past)), past, *others])
        effect = commands[:, g] @ response[g] @ whiten
        effect = effect - effect.mean(axis=0)
        power = float((effect**2).sum())
        if power > 1e-6 * len(effect):
            rest = effect - known @ np.linalg.lstsq(known, effect, rcond=None)[0]
            found[g] = max(1.0 - float((rest**2).sum()) / min(power, _PLAIN * len(effect)), 0.0)
    return found


def claimed(model: Model) -> list[bool]:
    """Whether anything is said of each group."""
    if model.fitted is None or not model.fitted.tied:
        return [True] * len(model.groups)
    return [tied < _TIED for tied in model.fitted.tied]


def unclaimed(model: Model) -> set[str]:
    """The surfaces of which nothing is said."""
    pairs = zip(model.groups, claimed(model), strict=True)
    return {name for group, told in pairs if not told for name in group}


def unclaimed_lines(model: Model) -> list[str]:
    """Why nothing is said of some groups."""
    if model.fitted is None:
        return []
    says = "of what {} does, {:.1%} follows from the rates, signals and other surfaces of the flights fitted"
    return [
        f"{says.format('+'.join(group), tied)}: its effect cannot be told, nothing is said of it"
        for group, tied, told in zip(model.groups, model.fitted.tied, claimed(model), strict=False)
        if not told
    ]


def check_units(samples: Samples, fitted: Fitted | None) -> None:
    """Raise BadInput where all rates spread so much more or less than in the flights of the model that they
    are in another unit."""
    if fitted is None or not fitted.spread:
        return
    ratio = np.nanstd(samples.rates, axis=0) / np.maximum(fitted.spread, TINY)
    middle = float(np.exp(np.mean(np.log(np.maximum(ratio, TINY)))))
    for unit, size in (("deg/s", 180.0 / np.pi), ("cdeg/s", 18000.0 / np.pi), ("mrad/s", 1000.0)):
        alike = ratio.max() < _UNIT * ratio.min()
        if alike and 1.0 / _SPREAD**2 < middle / size < _SPREAD**2:
            raise BadInput(
                f"{samples.name}: rates spread {middle:.3g} times as widely as in the flights of the model, "
                f"allowed: rates in rad/s; a factor of {1.0 / size:.4g} (`unit: {unit}`) fits"
            )
        if alike and 1.0 / _SPREAD**2 < middle * size < _SPREAD**2:
            raise BadInput(
                f"{samples.name}: rates spread {middle:.3g} times as widely as in the flights of the model, "
                f"allowed: rates in rad/s; a factor of {size:.4g} fits: the model's own were in {unit}?"
            )


def check_commands(
    name: str, commands: Floats, rates: Floats, fitted: Fitted, surfaces: Sequence[str]
) -> None:
    """Raise BadInput where a command moves so much more or less than in the flights of the model, while every
    rate moves alike, that it is in another unit; or so much more than any rate does.

    Shapes: commands (n, S), rates (n, 3).
    """
    turned = _reach(span(rates)) / np.maximum(_reach(fitted.rates), TINY)
    alike = turned.min() > 1.0 / _ALIKE and turned.max() < _ALIKE
    most = _OTHER_UNIT * (1.0 if alike else max(turned.max(), 1.0))
    ratios = _reach(span(commands)) / np.maximum(_reach(fitted.commands), TINY)
    for surface, ratio in zip(surfaces, ratios.tolist(), strict=True):
        if most < ratio < 1e4 or (alike and 1e-4 < ratio < 1.0 / _OTHER_UNIT):
            raise BadInput(
                f"{name}: the command of {surface} moves {ratio:.3g} times as much as in the other flights, "
                f"the rates {turned.max():.2g} times at most, allowed: one unit (57.3 is deg for rad, 100 "
                "percent: `unit`, `scale`)"
            )


class _InAll(NamedTuple):
    """Of all parts of a flight: at most, and at least, how much of the model's answer to each group's
    command, (G,), and at most to each column, by its name, there is; the least scale of the noise; and the
    log likelihood of a sample of each part, (4,), but for what all colours have alike."""

    gains: list[float]
    least: list[float]
    columns: dict[str, float]
    noise: float
    likely: Floats


def check_columns(samples: Samples, model: Model) -> None:
    """Raise BadInput where in every part of a flight the rates answer a command or another column as in no
    flight of the model, or do what no trim and no effectiveness explain: columns, signs or units are others,
    since no fault has always been there and changes what is not its own.

    What a law answers to gusts or to a gyro's noise looks like a command that works the other way round: an
    answer is refused only where it is wrong by each colour of the noise that is likelier, too."""
    tried = [(whitened(samples, one.average), model.alone_with(one)) for one in model.colours]
    read = [(one, found) for one in tried or [(samples, model)] if (found := _likely_in_parts(*one))]
    if not read:
        return
    flight, likeliest = max(read, key=lambda one: one[1][0].mean())[0]
    in_all = _in_all_parts(flight, likeliest)
    if in_all is None:
        return
    wrong = _wrong_answers(samples, model, in_all)
    for colour in NOISE_COLOURS if wrong else ():
        other = _in_all_parts(whitened(samples, colour), model)
        if other is not None and other.likely.mean() > in_all.likely.mean():
            still = _wrong_answers(samples, model, other)
            wrong = {what: says for what, says in wrong.items() if what in still}
    says = next(iter(wrong.values()), None) or _likelier(flight, likeliest)
    if says is not None:
        allowed = "allowed: columns, signs and units as in the flights of the model"
        raise BadInput(f"{samples.name}: {says}, {allowed}")


def _wrong_answers(samples: Samples, model: Model, found: _InAll) -> dict[str, str]:
    """What is wrong with the rates' answers to a flight's columns, by what and which, the surest first."""
    wrong = {}
    for group, most, least in zip(model.groups, found.gains, found.least, strict=True):
        name, moved = "+".join(group), _moved(samples, model, group)
        command, than = f"the command of {name}", f"moves {moved:.3g} times as much as in the flights of the"
        if most < REVERSED:
            says = f"the rates answer {command} the other way round in all of it (does `scale: -1` fit?)"
            wrong[f"sign {name}"] = says
        elif most < _LITTLE and moved > _ALIKE:
            does = f"does at most {most:.2g} of what it did"
            wrong[f"unit {name}"] = f"{command} {than} model, and {does}{_IN_UNITS}"
        elif least > 1.0 / _LITTLE and 0.0 < moved < 1.0 / _ALIKE:
            does = f"does at least {least:.3g} times what it did"
            wrong[f"unit {name}"] = f"{command} {than} model, and {does}{_IN_UNITS}"
    if odd := [name for name, share in found.columns.items() if share < _FAINT]:
        says = f"what the rates answer to {', '.join(odd)} is not what it is in the model, in all of it"
        wrong["columns"] = says
    return wrong


def _likelier(samples: Samples, model: Model) -> str | None:
    """The mistake in the columns without which a flight is likelier in every part of it, where there is one.

    By chance a wrong reading is K times as likely as the true one in at most one part of K (Markov's
    inequality for a likelihood ratio); all readings together have the chance `_MISREAD`. That is so of a
    model that is right: the flight must be likelier by as much more as flights were that the model was not
    fitted on, whose columns are right, and by as much again for another law (`Fitted.misread`).
    """
    more, count = mended_likelier(samples, model)
    if not more:
        return None
    says, most = max(more.items(), key=lambda one: one[1])
    usual = 2.0 * model.fitted.misread if model.fitted is not None else 0.0
    if most * count <= np.log(len(more) / _MISREAD) + usual * count:
        return None
    size = most * count / np.log(10.0)
    return f"each part of the flight is at least 10^{size:.0f} times as likely with {says}"


def mended_likelier(samples: Samples, model: Model) -> tuple[dict[str, float], float]:
    """By each mistake in the columns how much likelier a sample is without it, in natural logarithms, in the
    part of the flight where that is least; and as how many samples a part counts."""
    found, others = _likely_in_parts(samples, model), list(mended(samples, model.vehicle))
    if found is None:
        return {}, 0.0
    likely, counted = found
    more = {}
    for other in others:
        read = _likely_in_parts(other.samples, model)
        more[other.says] = -np.inf if read is None else float((read[0] + other.density - likely).min())
    return more, counted


def _likely_in_parts(samples: Samples, model: Model) -> tuple[Floats, float] | None:
    """As `_InAll`: the log likelihood of a sample of each part, and as how many white samples a part counts;
    of a long flight every k-th sample is taken. None where a part is too short."""
    whiten, power, size = _white_and_power(samples, model)
    ok, unexplained, answers = regression.in_white(samples, model)
    rows = np.flatnonzero(ok)
    if (parts := regression.quarters(rows[:: max(len(rows) // _ENOUGH, 1)])) is None:
        return None
    noises = [_noise(regression.coefficient_bounds(*_stacked(part, unexplained, answers, whiten), power)[1])
              for part in parts]  # fmt: skip
    return -size - 1.5 * np.log(noises), power * min(map(len, parts))


def _white_and_power(samples: Samples, model: Model) -> tuple[Floats, float, float]:
    """What whitens the residual of a flight of a colour, (3, 3), as how many white samples one counts, and
    the logarithm of the size of the noise of a sample that is not filtered."""
    wider = model.noise_factor(samples.colour)
    root = np.linalg.cholesky(model.with_noise_model(samples.colour).arrays()[3] / wider)
    size = float(np.log(np.diag(root)).sum() - 3.0 * np.log(sum(samples.colour or (1.0,))))
    return np.linalg.inv(root).T, model.settings.power / wider, size


def _stacked(
    part: NDArray[np.int64], unexplained: Floats, answers: Floats, whiten: Floats
) -> tuple[Floats, Floats]:
    """Regressors (3 n, 3 + K) of trim and answers (n, K, 3), and what they are to explain, (3 n,)."""
    trim = np.broadcast_to(np.eye(3), (len(part), 3, 3))
    x = np.concatenate([trim, answers[part]], axis=1) @ whiten
    return x.transpose(0, 2, 1).reshape(3 * len(part), -1), (unexplained[part] @ whiten).ravel()


def _noise(square: Floats) -> float:
    """The scale of the noise by the squares of what is left, (3 n,)."""
    return float(np.median(square.reshape(-1, 3).sum(axis=1)) / _MIDDLE)


def _in_all_parts(samples: Samples, model: Model) -> _InAll | None:
    """None where a part is too short."""
    ok, unexplained, answers = regression.in_white(samples, model)
    if (parts := regression.quarters(np.flatnonzero(ok))) is None:
        return None
    columns, names = _by_column(samples, model)
    columns = regression.less_predicted(columns, model.noise_predictor(samples.colour))
    (whiten, power, size), groups = _white_and_power(samples, model), len(model.groups)
    gains, least, shares = np.full(groups, -np.inf), np.full(groups, np.inf), np.full(len(names), -np.inf)
    noises, both = [], np.concatenate([answers, columns], axis=1)
    for part in parts:
        flat, y = _stacked(part, unexplained, both, whiten)
        gain, square = regression.coefficient_bounds(flat[:, : 3 + groups], y, power)
        less, _ = regression.coefficient_bounds(-flat[:, : 3 + groups], y, power)
        share, _ = regression.coefficient_bounds(flat, y, power)
        gains, least = np.maximum(gains, gain[3:]), np.minimum(least, -less[3:])
        shares = np.maximum(shares, 1.0 + share[3 + groups :])  # what the past does is taken off already
        noises.append(_noise(square))
    return _InAll(
        gains.tolist(),
        least.tolist(),
        dict(zip(names, shares.tolist(), strict=True)),
        min(noises),
        -size - 1.5 * np.log(noises),
    )


def _moved(samples: Samples, model: Model, group: list[str]) -> float:
    """How many times as far as in the flights of the model a group's command moves; 0 where these are not
    known."""
    if model.fitted is None or not model.fitted.commands:
        return 0.0
    more = _reach(span(samples.commands)) / np.maximum(_reach(model.fitted.commands), TINY)
    return max(float(more[list(model.vehicle.surfaces).index(name)]) for name in group)


def _by_column(samples: Samples, model: Model) -> tuple[Floats, list[str]]:
    """What of each sample the model makes of each column: rates of the other axes, and signals, (n, C, 3);
    and their names."""
    _, by_past, _, _ = model.arrays()
    own = [getattr(model.vehicle.rates, axis).column for axis in "pqr"]
    felt = model.vehicle.felt(model.history)
    names = own * model.history + model.vehicle.past_names * felt
    past, _, _ = regression.build(samples, [[0]], model.history, 1, False, felt)
    cross = by_past.copy()
    for k in range(3 * model.history):
        cross[k, k % 3] = 0.0
    called = list(dict.fromkeys(name.removesuffix(" by airspeed") for name in names))
    parts = [[name.removesuffix(" by airspeed") == one for name in names] for one in called]
    return np.stack([past[:, part] @ cross[part] for part in parts], axis=1), called


def _reach(span: Sequence[Sequence[float]]) -> Floats:
    return np.ptp(np.array(span, dtype=float).reshape(-1, 2), axis=1)


def outside(samples: Samples, model: Model) -> dict[str, Mask]:
    """Rows that are not credible, by reason."""
    found: dict[str, Mask] = {}
    for name, most in _most_still(samples, model).items():
        found[f"{name} stands still, for longer than {most:.3g} s"] = samples.still_s[name] > most
    if samples.clipped is not None:
        found[f"a rate was clipped in the last {_CLIPPED_S:g} s"] = _lately(samples.clipped, samples.dt_s)
    if model.fitted is None:
        return _any_of(found)
    return _any_of(found | _out_of_range(samples, model, model.fitted))


def _lately(rows: Mask, dt_s: float) -> Mask:
    """Whether a condition held in the last half minute."""
    order = np.arange(len(rows))
    since = order - np.maximum.accumulate(np.where(rows, order, -len(rows) - round(_CLIPPED_S / dt_s)))
    return np.asarray(since * dt_s <= _CLIPPED_S)


def _any_of(found: dict[str, Mask]) -> dict[str, Mask]:
    return {reason: rows for reason, rows in found.items() if rows.any()}


def _out_of_range(samples: Samples, model: Model, fitted: Fitted) -> dict[str, Mask]:
    names = [f"command of {surface}" for surface in model.vehicle.surfaces]
    columns = [
        *zip(names, samples.commands.T, fitted.commands, strict=False),
        *zip(_rates(model), samples.rates.T, fitted.rates, strict=False),
    ]
    found = {}
    for name, values, (low, high) in columns:
        more = _WIDER * (high - low) + TINY
        found[_says(name, low, high)] = _often(~_within(values, low - more, high + more), samples)
    if fitted.airspeed is not None and samples.airspeed is not None:
        low, high = fitted.airspeed
        apart = ~_within(samples.airspeed, (1.0 - _AIRSPEED) * low, (1.0 + _AIRSPEED) * high)
        found[_says("airspeed", low, high)] = _often(apart, samples)
    return found


def _says(name: str, low: float, high: float) -> str:
    return f"{name} is outside {low:.3g} to {high:.3g}, where the model was fitted"


def _within(values: Floats, low: float, high: float) -> Mask:
    return np.asarray(~np.isfinite(values) | ((values >= low) & (values <= high)))


def _often(rows: Mask, samples: Samples) -> Mask:
    """Where a condition held in half of the last seconds, or of what there is yet."""
    length = max(round(_WINDOW_S / samples.dt_s), 1)
    total, end = np.concatenate([[0], np.cumsum(rows)]), np.arange(1, len(rows) + 1)
    begin = np.maximum(end - length, 0)
    return np.asarray(total[1:] - total[begin] > _OUTSIDE * (end - begin))


def _rates(model: Model) -> list[str]:
    return [getattr(model.vehicle.rates, axis).column for axis in "pqr"]


def _most_still(samples: Samples, model: Model) -> dict[str, float]:
    """For how long each column may stand still, s: a measured rate hardly, another thrice as long as in the
    flights of the model; a rate of which these are known, from a third of STILL_S on."""
    known = model.fitted.still_s if model.fitted else {}
    usual = {name: 0.0 if name in _rates(model) else np.inf for name in samples.still_s} | known
    least = {name: STILL_S / 3.0 if name in known and name in _rates(model) else STILL_S for name in usual}
    return {name: max(least[name], _STILL_LONGER * usual[name]) for name in samples.still_s}


def dead(samples: Samples, model: Model) -> Mask:
    """Samples with a signal that does not live: what the filter is not to learn from."""
    found = np.zeros(len(samples.t_s), dtype=bool)
    for name, most in _most_still(samples, model).items():
        found |= samples.still_s[name] > most
    return found if samples.clipped is None else found | samples.clipped


def without_dead(samples: Samples, model: Model) -> Samples:
    """The flight with nothing known where a signal does not live."""
    lost = dead(samples, model)
    if not lost.any():
        return samples
    return replace(samples, rates=np.where(lost[:, None], np.nan, samples.rates))


def account(found: Mapping[str, Mask], credible: NDArray[np.int64]) -> Document:
    """Of verdict.json: the share of credible rows, and the reasons for the others with their shares."""
    shares = {reason: float(rows.mean()) for reason, rows in found.items()}
    ordered = sorted(shares, key=lambda reason: -shares[reason])
    return {
        "share": float(credible.mean()) if len(credible) else 0.0,
        "reasons": [{"says": reason, "share": shares[reason]} for reason in ordered],
    }
