"""Servo lag and delay of the vehicle, fitted to free runs from the recorded rates.

A *free run* starts at a recorded rate and then predicts all rates of a window from the commands alone. The
*output error* is the difference between these and the recorded rates. W: number of windows; n: number of
samples in a window; G: number of groups of surfaces.
"""

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_logs import regression
from beaver_ftc_logs.fit_parts import Parts, usual_step_s
from beaver_ftc_logs.groups import Groups, group_commands
from beaver_ftc_logs.recording import Floats

_WINDOW_S = 2.0  # length of a free run
_MIN_WINDOWS = 20  # with fewer windows, lag and delay are not fitted
_MAX_WINDOWS = 400  # of W windows, every (W // 400)-th is used: less than 800, spread over the flights
_MAX_DELAY_S = 0.6  # limit of the search, as are the next two
_MIN_SERVO_LAG_S = 0.005
_MAX_SERVO_LAG_S = 1.0


def fit_output_error(parts: Parts, groups: Groups) -> Document:
    """Fit on every other window, test on the rest. Returns servo lag and delay in s, their standard errors,
    and the share of the rates' variance that is explained in windows not fitted, for each axis; only the
    number of windows and a text if they are too few or a rate does not move.

    th: parameters, as in `_simulate`; P = (J' J)^-1, with the Jacobian J of the weighted errors; the standard
    errors are sqrt(diag(P) mean of the squared errors).
    """
    from scipy.optimize import least_squares

    dt_s = usual_step_s(parts)
    u, y = _cut_windows(parts, groups, round(_WINDOW_S / dt_s), round(_MAX_DELAY_S / dt_s) + 1)
    if len(y) < _MIN_WINDOWS or not np.ptp(y, axis=(0, 1)).all():
        return {"windows": len(y), "says": "too few gap-free windows in which every rate moves"}
    fitted = slice(0, None, 2)
    held_out = slice(1, None, 2)
    sd = y.std(axis=(0, 1))
    # The initial values of lag, delay, A, B and c.
    guess = np.array([0.1, dt_s, *(0.7 * np.eye(3)).ravel(), *np.full(3 * len(groups), 0.01), *np.zeros(3)])
    free = np.full(len(guess) - 2, np.inf)
    lower = [_MIN_SERVO_LAG_S, 0.0, *-free]
    upper = [_MAX_SERVO_LAG_S, _MAX_DELAY_S, *free]

    def error(th: Floats, rows: slice) -> Floats:
        """Error of the free runs of some windows, in standard deviations of the rates."""
        return ((_simulate(th, u[rows], y[rows], dt_s) - y[rows]) / sd).ravel()

    optimum = least_squares(error, guess, bounds=(lower, upper), args=(fitted,), loss="soft_l1", max_nfev=40)
    P = np.linalg.pinv(optimum.jac.T @ optimum.jac)
    errors = np.sqrt(np.maximum(np.diag(P), 0.0) * float(optimum.fun @ optimum.fun) / len(optimum.fun))
    e = error(optimum.x, held_out).reshape(-1, 3) * sd
    explained = 1.0 - e.var(axis=0) / y[held_out].reshape(-1, 3).var(axis=0)
    return {
        "windows": len(y),
        "servo_lag_s": float(optimum.x[0]),
        "servo_lag_sd_s": float(errors[0]),
        "delay_s": float(optimum.x[1]),
        "delay_sd_s": float(errors[1]),
        "shorter_than_can_be_told": bool(optimum.x[0] < 2.0 * _MIN_SERVO_LAG_S),
        "explained_of_windows_not_fitted": regression.by_axis(explained),
    }


def _cut_windows(parts: Parts, groups: Groups, n: int, past: int) -> tuple[Floats, Floats]:
    """Commands u (W, past + n, G), from `past` samples before each window on, times the labelled
    effectiveness; and rates y (W, n, 3). Only windows of usable samples without a gap are used.

    cut (.., past + n, 4 + G): three rates, the number of the stretch, and the commands.
    """
    windows = []
    for part in parts:
        samples = part.samples
        commands = group_commands(samples, groups, labelled=True)
        rows = np.column_stack([samples.rates, samples.stretch_number, commands])[:-1]
        rows[~part.is_usable[:-1]] = np.nan
        begin = np.arange(0, len(rows) - past - n + 1, n)
        cut = rows[begin[:, None] + np.arange(past + n)]
        windows.append(cut[np.isfinite(cut).all(axis=(1, 2)) & (np.ptp(cut[:, :, 3], axis=1) == 0)])
    chosen = np.concatenate(windows)
    chosen = chosen[:: max(len(chosen) // _MAX_WINDOWS, 1)]
    return chosen[:, :, 4:], chosen[:, past:, :3]


def _simulate(th: Floats, u: Floats, y: Floats, dt_s: float) -> Floats:
    """Free runs X (W, n, 3) of all windows at once, rad/s, from the first of the rates y (W, n, 3):

        x[k+1] = A x[k] + B' s[k] + c,    s[k+1] = a s[k] + (1 - a) v[k],    a = exp(-dt / lag)

    s (W, G): positions of the servos; v (W, G): the commands u (W, past + n, G) a delay before, interpolated
    between two samples, whole + f samples before. The servos follow the commands from the past on; the rates
    run from the window on. th: lag and delay, both in s, A (3, 3), B (G, 3), c (3,), one after the other.
    """
    (lag_s, delay_s), A, B, c = np.split(th, [2, 11, len(th) - 3])
    A = A.reshape(3, 3)
    B = B.reshape(-1, 3)
    n = y.shape[1]
    past = u.shape[1] - n
    whole, f = divmod(delay_s / dt_s, 1.0)
    a = np.exp(-dt_s / lag_s)
    x = y[:, 0].copy()
    s = u[:, 0].copy()
    X = np.empty_like(y)
    for k in range(u.shape[1]):
        if k >= past:
            X[:, k - past] = x
            x = x @ A.T + s @ B + c
        v = (1.0 - f) * u[:, max(k - int(whole), 0)] + f * u[:, max(k - int(whole) - 1, 0)]
        s = a * s + (1.0 - a) * v
    return X
