"""The loop's plugged detectors on a recorded flight: the identified model in the words of their contract.

A detector of the loop is told the rates, what the design model makes of the frame before, and how much of
that each surface did (diagnosis/base.py). All three follow from the identified model:

    acceleration = (c + A past + sum_g F_g - rates before) / dt,      contribution_g = F_g / dt

so the innovation a detector forms is the model's one-step residual. Its declared error is the residual's
standard deviation. Detectors of the loop know the surfaces aileron, elevator and rudder: the vehicle's groups
take these places in their order.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.design.context import Context, Declared
from beaver_ftc.design.model import N_Y
from beaver_ftc.diagnosis.base import Detector, Measured, Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats
from beaver_ftc.flights.regressors import build, group_indices, predict
from beaver_ftc.flights.samples import Samples

PLACES = ("aileron", "elevator", "rudder")
_SURFACES = 4
_GYRO_RAD_S = 1e-4
_UNKNOWN = "unknown"


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


@dataclass(frozen=True)
class Stream:
    """A flight as the detectors' contract has it. x (n, 3) rad/s; acceleration (n, 3) and contribution
    (n, 3, 4) rad/s2; command (n, 4) as shares of travel; error (3,) rad/s2."""

    t_s: Floats
    x: Floats
    acceleration: Floats
    contribution: Floats
    command: Floats
    error: Floats

    def __len__(self) -> int:
        return len(self.t_s)

    def sample(self, k: int) -> tuple[Measured, Floats]:
        """What a detector is given at row k."""
        measured = Measured(
            float(self.t_s[k]), self.x[k].copy(), np.zeros(N_Y), self.acceleration[k].copy(),
            self.contribution[k].copy(), self.error.copy(),
        )  # fmt: skip
        return measured, self.command[k].copy()


def stream_of(samples: Samples, model: Model) -> Stream:
    """The stream of a flight. Where the model can say nothing (a gap, a lost sample) the innovation is 0."""
    groups = group_indices(model)
    if len(groups) > len(PLACES):
        raise BadInput(
            f"{model.vehicle.name}: {len(groups)} groups of surfaces, allowed for a detector of the loop: "
            f"at most {len(PLACES)}"
        )
    regressors = build(samples, groups, model.history, model.lags, scaled=False)
    intercept, past, response, noise = model.arrays()
    dt_s, ok = 1.0 / model.rate_hz, regressors.ok
    unexplained, answers = predict(samples.rates, regressors, past, response)
    x = np.nan_to_num(samples.rates)
    before = np.vstack([x[:1], x[:-1]])
    predicted = x - np.where(ok[:, None], unexplained - intercept - answers.sum(axis=1), 0.0)
    contribution, command = np.zeros((len(x), 3, _SURFACES)), np.zeros((len(x), _SURFACES))
    known = np.where(ok[:, None, None], answers, 0.0)
    for place, members in enumerate(groups):
        contribution[:, :, place] = known[:, place] / dt_s
        command[:, place] = np.nan_to_num(samples.commands[:, members].sum(axis=1))
    error = np.sqrt(np.diag(noise)) / dt_s
    return Stream(samples.t_s, x, (predicted - before) / dt_s, contribution, command, error)


def context_of(model: Model, error: Floats) -> Context:
    """What a detector is told before the flight."""
    dt_s = 1.0 / model.rate_hz
    noise = np.zeros(7)
    noise[:3] = _GYRO_RAD_S
    design: Any = Linear(model.arrays()[1], dt_s)
    return Context(
        dt_s=dt_s, substeps=1, model=design, trim_x=np.zeros(3), trim_y=np.zeros(N_Y),
        trim_rad=np.zeros(_SURFACES), travel_rad=np.outer((-1.0, 1.0), np.ones(_SURFACES)),
        constant_rad_s2=np.zeros(3), inertia_coupling=np.zeros(3), surfaces=(*PLACES, "flap"),
        declared=Declared(noise=noise, model_rad_s2=error),
    )  # fmt: skip


def run_detector(detector: Detector, samples: Samples, model: Model) -> Rows:
    """Step a detector of the loop through a flight. An alarm stands while its statistic says so."""
    stream = stream_of(samples, model)
    detector.reset(context_of(model, stream.error))
    return rows_of([detector.step(*stream.sample(k)) for k in range(len(stream))], samples, model)


def rows_of(verdicts: list[Verdict], samples: Samples, model: Model) -> Rows:
    """Verdicts as rows. A detector that gives no bounds says 0 to 1 of what it suspects."""
    n, groups = len(verdicts), group_indices(model)
    faulty = np.array([_alarm(verdict) for verdict in verdicts], dtype=np.int64)
    estimate, low = np.ones((n, len(model.vehicle.surfaces))), np.ones((n, len(model.vehicle.surfaces)))
    named = np.full(n, "", dtype=object)
    for k in np.flatnonzero(faulty):
        place = _place(verdicts[k], len(groups))
        named[k] = _UNKNOWN if place is None else "+".join(model.groups[place])
        suspected = range(len(model.vehicle.surfaces)) if place is None else groups[place]
        low[k, list(suspected)] = 0.0
        if place is not None:
            estimate[k, groups[place]] = _left(verdicts[k], place)
    probability = np.array([min(max(verdict.statistic, 0.0), 1.0) for verdict in verdicts])
    probability = np.where(np.isfinite(probability), probability, faulty)
    healthy, ones = np.ones((n, len(groups))), np.ones(n)
    return Rows(
        samples.t_s, faulty, named, estimate, low, np.ones_like(low), probability, healthy, ones, ones
    )


def _alarm(verdict: Verdict) -> bool:
    """By the statistic of this sample where there is one; the loop's own latch serves one fault a flight."""
    return verdict.statistic > 1.0 if np.isfinite(verdict.statistic) else verdict.detected


def _place(verdict: Verdict, groups: int) -> int | None:
    place = PLACES.index(verdict.isolated) if verdict.isolated in PLACES else None
    return place if place is not None and place < groups else None


def _left(verdict: Verdict, place: int) -> float:
    if verdict.effectiveness is not None:
        return float(np.clip(verdict.effectiveness[place], 0.0, 1.0))
    return float(np.clip(1.0 + verdict.estimate, 0.0, 1.0)) if verdict.estimate is not None else 1.0
