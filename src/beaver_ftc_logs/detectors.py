"""Who may diagnose a recorded flight: our bank of filters, plain estimators, and the loop's detectors.

Plain estimators get the same model; the freeze rule needs none.

sliding-least-squares   the last 20 s, every sample alike
forgetting-least-squares  all the past, forgotten exponentially with 20 s [Ljung1999]
freeze                  a servo output that has not moved for 6 s: sees the logged output itself stand still

A detector of the loop is told the rates, what the design model makes of the frame before, and how much of
that each surface did (diagnosis/base.py). All three follow from the identified model:

    acceleration = (c + A past + sum_g F_g - rates before) / dt,      contribution_g = F_g / dt

so the innovation a detector forms is the model's one-step residual. Its declared error is the residual's
standard deviation. Detectors of the loop know the surfaces aileron, elevator and rudder: the vehicle's groups
take these places in their order.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from beaver_ftc.design import N_Y, Context, Declared
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, is_compiled, made, registered
from beaver_ftc_logs.bank import bank_of
from beaver_ftc_logs.diagnose import (
    UNKNOWN,
    Rows,
    check_rate,
    diagnose,
    healthy_residual,
    joined,
    silenced,
)
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats, Recording
from beaver_ftc_logs.regression import by_surface, group_indices, predicted
from beaver_ftc_logs.samples import Samples
from beaver_ftc_logs.trust import without_dead

MEMORY_S = 20.0
STILL_S = 6.0
_SURE_SD = 5.0
_NINETY = 1.645
PLACES = ("aileron", "elevator", "rudder")
_SURFACES = 4
_GYRO_RAD_S = 1e-4
BANK = "bank-of-filters"


def _least_squares(samples: Samples, model: Model, forget: bool) -> Rows:
    """Effectiveness of the groups and the trim, from y = c + sum e_g F_g, whitened."""
    x, y = _whitened(samples, model)
    information = _remembered(np.einsum("nai,naj->nij", x, x), samples.dt_s, forget)
    score = _remembered(np.einsum("nai,na->ni", x, y), samples.dt_s, forget)
    prior = np.diag([*np.full(3, 1.0 / model.settings.trim_sd**2), *np.full(x.shape[2] - 3, 4.0)])
    covariance = np.linalg.inv(information + prior)
    found = np.einsum("nij,nj->ni", covariance, score)
    sd = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2)[:, 3:], 0.0))
    return _rows(samples, model, 1.0 + found[:, 3:], sd)


def _whitened(samples: Samples, model: Model) -> tuple[Floats, Floats]:
    """Regressors (n, 3, 3 + G) of trim and lost effectiveness, and what a healthy vehicle leaves, (n, 3)."""
    ok, unexplained, answers = predicted(samples, model)
    noise = model.arrays()[3]
    whiten = np.linalg.inv(np.linalg.cholesky(noise))
    sizes = np.broadcast_to(np.diag(np.sqrt(np.diag(noise))), (len(ok), 3, 3))
    x = np.where(ok[:, None, None], np.concatenate([sizes, answers.transpose(0, 2, 1)], axis=2), 0.0)
    return np.einsum("ab,nbi->nai", whiten, x), healthy_residual(model, ok, unexplained, answers)


def _remembered(values: Floats, dt_s: float, forget: bool) -> Floats:
    """Sums over the memory that ends at each sample."""
    if forget:
        from scipy.signal import lfilter

        return np.asarray(lfilter([1.0], [1.0, -np.exp(-dt_s / MEMORY_S)], values, axis=0))
    total = np.cumsum(values, axis=0)
    length = round(MEMORY_S / dt_s)
    total[length:] = total[length:] - total[:-length].copy()
    return total


def _rows(samples: Samples, model: Model, effectiveness: Floats, sd: Floats) -> Rows:
    """Rows of a least-squares estimate. With labelled levels, the effectiveness is the nearest of them, and
    below 1 it is a fault; without, it is a fault where it is below 1 by more than _SURE_SD standard
    deviations."""
    bank = bank_of(model)
    low, high = (np.clip(effectiveness + side * _NINETY * sd, 0.0, 1.0) for side in (-1.0, 1.0))
    value, lost = np.clip(effectiveness, 0.0, 1.0), effectiveness + _SURE_SD * sd < 1.0
    if model.settings.levels:
        for g, group in enumerate(model.groups):
            seen = model.settings.levels.get("+".join(group))
            levels = np.array([*seen, 1.0]) if seen else np.unique(bank.effectiveness[:, g])
            value[:, g] = levels[np.abs(value[:, g, None] - levels).argmin(axis=1)]
        lost = value < 1.0
    edges = {"low": np.minimum(low, value), "high": np.maximum(high, value)}
    bounds = {name: by_surface(edge, model) for name, edge in edges.items()}
    named = joined(lost, ["+".join(group) for group in model.groups])
    return _told(samples, named, by_surface(value, model), **bounds)


def _told(samples: Samples, named: np.ndarray, estimate: Floats, **known: Floats) -> Rows:
    """Rows of a detector without bounds or probability: faulty where it names a surface; the bounds are then
    the estimate, the probability is 0 or 1."""
    faulty = np.array([bool(name) for name in named], dtype=np.int64)
    found = {"low": estimate, "high": estimate, "probability": faulty.astype(float), **known}
    low, high, probability = found["low"], found["high"], found["probability"]
    return Rows(samples.t_s, faulty, named, estimate, low, high, probability)


def freeze(recording: Recording, samples: Samples, model: Model) -> Rows | None:
    """The freeze rule on the logged servo outputs; None where the vehicle file names none."""
    names = list(model.vehicle.surfaces)
    outputs = model.vehicle.outputs
    logged = {name: one.column for name, one in outputs.items() if one.column in recording.columns}
    if not logged:
        return None
    still = np.zeros((len(samples.t_s), len(names)), dtype=bool)
    for name in logged:
        column = recording.columns[logged[name]]
        last = np.searchsorted(column.t_s, samples.t_s, side="right") - 1
        moved = np.concatenate([[True], np.diff(column.values) != 0.0])
        since = column.t_s[np.maximum.accumulate(np.where(moved, np.arange(len(moved)), 0))]
        still[:, names.index(name)] = (samples.t_s - since[np.maximum(last, 0)] > STILL_S) & (last >= 0)
    return _told(samples, joined(still, names), 1.0 - still)


class Linear:
    """The identified model as a detector's design model: only how the rates answer themselves, x (..., 3)."""

    def __init__(self, past: Floats, dt_s: float) -> None:
        self._jacobian = (past[:3] - np.eye(3)) / dt_s

    def f(self, x: Floats, y: Floats) -> Floats:
        """Angular acceleration rad/s2 by the rates alone."""
        return np.asarray(x @ self._jacobian)

    def G(self, y: Floats) -> Floats:
        """Nothing: what surfaces do is in `contribution`, with its lags."""
        return np.zeros((3, _SURFACES))


def stream_of(samples: Samples, model: Model) -> list[tuple[Measured, Floats]]:
    """What a detector is given at each row: what is measured, and the command (4,) as shares of travel.

    Where the model can say nothing (a gap, a lost sample) the innovation is 0.
    """
    groups = group_indices(model)
    if len(groups) > len(PLACES):
        raise BadInput(
            f"{model.vehicle.name}: {len(groups)} groups of surfaces, allowed for a detector of the loop: "
            f"at most {len(PLACES)}"
        )
    ok, unexplained, answers = predicted(samples, model)
    intercept, dt_s = model.arrays()[0], 1.0 / model.rate_hz
    x = np.nan_to_num(samples.rates)
    before = np.vstack([x[:1], x[:-1]])
    expected = x - np.where(ok[:, None], unexplained - intercept - answers.sum(axis=1), 0.0)
    acceleration = (expected - before) / dt_s
    contribution, command = np.zeros((len(x), 3, _SURFACES)), np.zeros((len(x), _SURFACES))
    known = np.where(ok[:, None, None], answers, 0.0)
    for place, members in enumerate(groups):
        contribution[:, :, place] = known[:, place] / dt_s
        command[:, place] = np.nan_to_num(samples.commands[:, members].sum(axis=1))
    parts = zip(samples.t_s.tolist(), x, acceleration, contribution, command, strict=True)
    error = _error(model)
    return [
        (Measured(t_s, rates, np.zeros(N_Y), expected_rad_s2, by_surfaces, error.copy()), commanded)
        for t_s, rates, expected_rad_s2, by_surfaces, commanded in parts
    ]


def _error(model: Model) -> Floats:
    """The residual's standard deviation as an error of the model, (3,) rad/s2."""
    return np.asarray(np.sqrt(np.diag(model.arrays()[3])) / (1.0 / model.rate_hz))


def context_of(model: Model) -> Context:
    """What a detector is told before the flight."""
    dt_s = 1.0 / model.rate_hz
    noise = np.zeros(7)
    noise[:3] = _GYRO_RAD_S
    design: Any = Linear(model.arrays()[1], dt_s)
    return Context(
        dt_s=dt_s, substeps=1, model=design, trim_x=np.zeros(3), trim_y=np.zeros(N_Y),
        trim_rad=np.zeros(_SURFACES), travel_rad=np.outer((-1.0, 1.0), np.ones(_SURFACES)),
        constant_rad_s2=np.zeros(3), inertia_coupling=np.zeros(3), surfaces=(*PLACES, "flap"),
        declared=Declared(noise=noise, model_rad_s2=_error(model)),
    )  # fmt: skip


def run_detector(detector: Detector, samples: Samples, model: Model) -> Rows:
    """Step a detector of the loop through a flight. An alarm stands while its statistic says so."""
    stream = stream_of(samples, model)
    detector.reset(context_of(model))
    return rows_of([detector.step(*given) for given in stream], samples, model)


def rows_of(verdicts: list[Verdict], samples: Samples, model: Model) -> Rows:
    """Verdicts as rows. A detector that gives no bounds says 0 to 1 of what it suspects."""
    n, groups = len(verdicts), group_indices(model)
    faulty = np.array([_alarm(verdict) for verdict in verdicts], dtype=np.int64)
    estimate, low = np.ones((2, n, len(model.vehicle.surfaces)))
    named = np.full(n, "", dtype=object)
    for k in np.flatnonzero(faulty):
        if verdicts[k].isolated not in PLACES[: len(groups)]:
            named[k], low[k] = UNKNOWN, 0.0
            continue
        place = PLACES.index(str(verdicts[k].isolated))
        named[k], low[k, groups[place]] = "+".join(model.groups[place]), 0.0
        estimate[k, groups[place]] = _remaining(verdicts[k], place)
    probability = np.array([min(max(verdict.statistic, 0.0), 1.0) for verdict in verdicts])
    probability = np.where(np.isfinite(probability), probability, faulty)
    return _told(samples, named, estimate, low=low, high=np.ones_like(low), probability=probability)


def _alarm(verdict: Verdict) -> bool:
    """By the statistic of this sample where there is one; the loop's own latch serves one fault a flight."""
    return verdict.statistic > 1.0 if np.isfinite(verdict.statistic) else verdict.detected


def _remaining(verdict: Verdict, place: int) -> float:
    if verdict.effectiveness is not None:
        return float(np.clip(verdict.effectiveness[place], 0.0, 1.0))
    return float(np.clip(1.0 + verdict.estimate, 0.0, 1.0)) if verdict.estimate is not None else 1.0


_OF_FLIGHTS: dict[str, Callable[[Samples, Model], Rows]] = {
    BANK: diagnose,
    "sliding-least-squares": partial(_least_squares, forget=False),
    "forgetting-least-squares": partial(_least_squares, forget=True),
}


def detector_names() -> list[str]:
    """Every detector a recorded flight can be given to, ours first."""
    return [*_OF_FLIGHTS, *(name for name in registered(DETECTORS) if not is_compiled(DETECTORS, name))]


def check_detector(name: str) -> None:
    """Raise BadInput for a detector that recorded flights do not know."""
    known = detector_names()
    if name not in known:
        raise BadInput(f"--detector {name}: is not known{suggestion(name, known)}")


def diagnose_with(name: str, samples: Samples, model: Model) -> Rows:
    """The rows of one detector. Raises BadInput for an unknown name, or a log at another rate."""
    check_detector(name)
    check_rate(samples, model)
    if name == BANK:
        return diagnose(samples, model)
    lived = without_dead(samples, model)
    if name in _OF_FLIGHTS:
        return silenced(samples, model, _OF_FLIGHTS[name](lived, model))
    detector: Detector = made(DETECTORS, name)
    return silenced(samples, model, run_detector(detector, lived, model))
