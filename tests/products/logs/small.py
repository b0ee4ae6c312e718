"""Small vehicles, models, flights and rows made by hand: small enough to be held whole."""

import numpy as np
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc_logs.groups import group_surfaces
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.model import Model
from beaver_ftc_logs.samples import Samples, mixer_matrix
from beaver_ftc_logs.vehicle import Vehicle


def run(*arguments):
    """What a command line does, with whatever ends it raised."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


RATES = {"p": "p_rad_s", "q": "q_rad_s", "r": "r_rad_s"}
WING = {
    "name": "wing", "rates": RATES, "commands": ["roll", "pitch"],
    "surfaces": {"right": {"roll": 0.5, "pitch": 0.5}, "left": {"roll": 0.5, "pitch": -0.5}},
    "labels": {"right": "right_effectiveness", "left": "left_effectiveness"},
}  # fmt: skip
TAIL = {
    "name": "tail", "rates": RATES, "commands": ["roll", "pitch"], "signals": ["airspeed_m_s"],
    "surfaces": {"left_aileron": {"roll": 1.0}, "elevator": {"pitch": 0.8}, "right_aileron": {"roll": 0.5}},
    "outputs": {"left_aileron": "left_output", "elevator": "elevator_output"}, "faults": ["loss", "stuck"],
}  # fmt: skip
RESPONSE = np.array(
    [
        [[0.05, -0.02, 0.01], [0.5, 0.25, 0.06], [0.2, 0.1, 0.02]],
        [[0.04, 0.03, -0.02], [0.45, -0.3, 0.05], [0.15, -0.12, 0.03]],
    ]
)


def vehicle(of=WING, **changes):
    return Vehicle.model_validate(of | changes)


def model(of=WING, settings=None, history=2, lags=3, **changes):
    """A model whose coefficients differ in everything. of: its vehicle file."""
    its = vehicle(of)
    groups = group_surfaces(its)
    names = list(its.surfaces)
    further = [(-1) ** j * 0.2 * np.eye(3) - 0.01 for j in range(1, history)]
    past = np.vstack([np.diag([0.5, 0.6, 0.7]) + 0.02, *further])
    signals = [[0.001, 0.002, -0.001]] * len(its.signals)
    response = np.resize(RESPONSE, (len(groups), lags, 3))
    given = {
        "vehicle": of, "rate_hz": 10.0, "groups": [[names[i] for i in group] for group in groups],
        "history": history, "lags": lags, "intercept": [-0.03, 0.04, 0.01],
        "past": [*past.tolist(), *signals], "response": response.tolist(),
        "response_sd": (0.1 * np.abs(response)).tolist(),
        "noise": [[0.0025, 0.0003, 0.0], [0.0003, 0.0016, 0.0001], [0.0, 0.0001, 0.0004]],
        "settings": settings or {},
    }  # fmt: skip
    return Model.model_validate(given | changes)


def flight(model, n=300, lost=(), seed=1, gap=None, name="small", **changes):
    """What a model makes of commands that wander. lost: (surface, from, to, left of it) by samples."""
    rng = np.random.default_rng(seed)
    its, step = model.vehicle, 1.0 / model.rate_hz
    commands = 0.3 * np.sin(np.outer(np.arange(n), [0.31, 0.47])) + 0.1 * rng.standard_normal((n, 2)) + 0.1
    surfaces = commands @ mixer_matrix(its).T
    signals = 20.0 + np.sin(0.1 * np.arange(n))[:, None] * np.ones(len(its.signals))
    labels = np.ones((n, len(its.surfaces)))
    for surface, begin, end, left in lost:
        labels[begin:end, surface] = left
    members = [[list(its.surfaces).index(one) for one in group] for group in model.groups]
    moved = np.column_stack([(labels * surfaces)[:, group].sum(axis=1) for group in members])
    white = rng.standard_normal((n, 3)) @ np.linalg.cholesky(np.array(model.noise)).T
    response, past = np.array(model.response), np.array(model.past)
    rates = np.zeros((n, 3))
    for k in range(max(model.history, model.lags), n):
        before = [*(rates[k - j] for j in range(1, model.history + 1)), signals[k - 1]]
        driven = sum(moved[k - j] @ response[:, j - 1] for j in range(1, model.lags + 1))
        rates[k] = np.array(model.intercept) + np.concatenate(before) @ past + driven + white[k]
    t_s, run = np.arange(n) * step, np.zeros(n, dtype=np.int64)
    if gap is not None:
        t_s[gap:] += 5.0
        run[gap:] = 1
    labels = labels if its.labels else np.full_like(labels, np.nan)
    given = {
        "name": name, "t_s": t_s, "rates": rates, "commands": surfaces, "signals": signals, "labels": labels,
        "stretch_number": run, "dt_s": step, "held_age_s": {}, "logged_failures": (),
        "log_stamps_s": t_s, "airspeed": np.full(n, np.nan), "is_rate_clipped": np.zeros(n, dtype=bool),
        "energy_height_rate_mps": np.full(n, np.nan),
    }  # fmt: skip
    return Samples(**(given | changes))


def rows(parts, surfaces=2, step_s=0.5):
    """Rows a step apart. parts: (count, named, estimate a surface); faulty where there is a name."""
    named = np.array([name for count, name, _ in parts for _ in range(count)], dtype=object)
    estimate = np.array([left for count, _, left in parts for _ in range(count)], dtype=float)
    faulty = np.array([int(bool(name)) for name in named], dtype=np.int64)
    t_s = 10.0 + step_s * np.arange(len(named))
    probability = np.where(faulty, 0.9, 0.1) + 0.001 * np.arange(len(named))
    return LogRows(t_s, faulty, named, estimate, 0.8 * estimate, 0.5 + 0.5 * estimate, probability, t_s)
