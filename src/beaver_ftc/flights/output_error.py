"""Output error: the same dynamics as a physical model that runs freely, with the servo's lag and the delay.

    x[k+1] = A x[k] + sum_g B_g d_g[k] + c,      tau d' = u(t - delay) - d

x the rates, started from the measured ones at the beginning of each window. Where the equation error asks how
well the next sample is predicted, this asks how well two seconds are, and what lies between a command and
its answer.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.flights.identify import Stretch
from beaver_ftc.flights.recording import Floats

WINDOW_S = 2.0
_MOST_WINDOWS = 400
_MOST_DELAY_S, _LEAST_LAG_S, _MOST_LAG_S = 0.6, 0.005, 1.0


def output_error(stretches: Sequence[Stretch], groups: list[list[int]]) -> dict[str, Any]:
    """Fit on every other window, test on the rest. Returns servo lag and delay in s, their standard errors,
    and the share of the rates' variance explained over free-running windows not fitted, an axis."""
    from scipy.optimize import least_squares

    dt_s = float(np.median([stretch.samples.dt_s for stretch in stretches]))
    commands, rates = _windows(stretches, groups, round(WINDOW_S / dt_s), round(_MOST_DELAY_S / dt_s) + 1)
    if len(rates) < 20:
        return {"windows": len(rates), "says": "too few gap-free windows for an output-error fit"}
    fitted, kept = slice(0, None, 2), slice(1, None, 2)
    spread = rates.std(axis=(0, 1)) + 1e-9
    start, low, high = _start(len(groups), dt_s)

    def residual(parameters: Floats, part: slice) -> Floats:
        run = _run(parameters, commands[part], rates[part], dt_s)
        return ((run - rates[part]) / spread).ravel()

    found = least_squares(residual, start, bounds=(low, high), args=(fitted,), loss="soft_l1", max_nfev=40)
    errors = _standard_errors(found.jac, found.fun)
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
    stretches: Sequence[Stretch], groups: list[list[int]], length: int, before: int
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
    empty = np.empty((0, before + length, len(groups))), np.empty((0, length, 3))
    return (np.array(commands[::step]), np.array(rates[::step])) if rates else empty


def _start(groups: int, dt_s: float) -> tuple[Floats, Floats, Floats]:
    """First guess and bounds of lag, delay, A, B and c."""
    values = [0.1, dt_s, *(0.7 * np.eye(3)).ravel(), *np.full(3 * groups, 0.01), *np.zeros(3)]
    low = np.full(len(values), -np.inf)
    high = np.full(len(values), np.inf)
    low[:2], high[:2] = (_LEAST_LAG_S, 0.0), (_MOST_LAG_S, _MOST_DELAY_S)
    return np.array(values), low, high


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


def _standard_errors(jacobian: Floats, residual: Floats) -> Floats:
    covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0) * float(residual @ residual) / len(residual))
