"""The diagnosis of a whole flight, from readings and commands to names.

readings, commands -> prediction -> innovation and bound -> bank -> alarm -> isolation -> verdict
"""

from typing import Any, NamedTuple

import numpy as np

from reference.bounds import Bounds, gyro_error
from reference.declaration import AXES, Declaration
from reference.detection import Bank
from reference.isolation import Frame, Isolation
from reference.prediction import DesignModel, frames_of, mean_of_frames, servo_positions


class Readings(NamedTuple):
    """What the diagnosis reads, a row for each instant: JSBSim steps from the first frame on, n_s a frame.

    x (instants, 3) rad/s; y (instants, 4 + signals): alpha, beta, V, qdyn, signals; command (instants,
    surfaces) rad: the one that acts at the end of each step. After the alarm also, a row for each frame, what
    the law takes for known: network (frames, 3) rad/s2 and effectiveness (frames, surfaces).
    trim: x, y, u at the start of the flight; None if the first row has it.
    """

    x: np.ndarray
    y: np.ndarray
    command: np.ndarray
    network: np.ndarray
    effectiveness: np.ndarray
    trim: tuple[np.ndarray, np.ndarray, np.ndarray] | None


class Result(NamedTuple):
    """columns: arrays by the names of log.parquet, a row for each frame. alarm: (frame, axis) or None; names:
    (frame, name) of each change of the name, None for none."""

    columns: dict[str, np.ndarray]
    alarm: tuple[int, str] | None
    names: list[tuple[int, str | None]]
    candidates: list[str]


def diagnose(declaration: Declaration, readings: Readings) -> Result:
    """The default scheme, worst case."""
    n = declaration.n
    model = DesignModel(declaration)
    u = servo_positions(declaration, readings.command, readings.command[0])
    if model.linearised or model.frozen_alpha:
        model.anchor(*(readings.trim or (readings.x[0], readings.y[0], u[0])))
    f, G = model.f(readings.x, readings.y), model.G(readings.y)
    frames = frames_of(declaration, f, G, u)
    bounds = Bounds(declaration, model, readings.x, readings.y, u)
    x = readings.x[::n]
    eta_bar, changing = mean_of_frames(n, bounds.now), gyro_error(declaration, x)
    nu = np.concatenate([np.full((1, 3), np.nan), np.diff(x, axis=0) / declaration.dt - frames.F[1:]])
    bank = Bank(declaration, nu, eta_bar, changing)
    columns = {}
    residual, threshold = bank.nearest_to_alarm()
    for i, axis in enumerate(AXES):
        columns[f"{axis}_design_rad_s2"] = frames.F[:, i]
        columns[f"{axis}_eta_bar_rad_s2"] = eta_bar[:, i]
        columns[f"{axis}_threshold_rad_s"] = bank.T[:, 0, i]
        columns[f"{axis}_residual_rad_s"] = bank.E[:, 0, i]
        columns[f"{axis}_alarm_residual_rad_s"], columns[f"{axis}_alarm_threshold_rad_s"] = (
            residual[:, i],
            threshold[:, i],
        )
    isolation = Isolation(declaration, bank, frames, bounds, G[0])
    if declaration.to_the_letter:
        bank.E[:, 0] = approximation_residual(declaration, bank, 0, nu, frames.Gu, readings)
    result = _isolate(declaration, bank, isolation, x, nu, eta_bar, changing, columns)
    if result.alarm:
        residual = approximation_residual(declaration, bank, result.alarm[0], nu, frames.Gu, readings)
        for i, axis in enumerate(AXES):
            columns[f"{axis}_residual_rad_s"] = residual[:, i]
    return result


def approximation_residual(
    declaration: Declaration, bank: Bank, alarm: int, nu: np.ndarray, Gu: np.ndarray, readings: Readings
) -> np.ndarray:
    """SPEC section 5, FDAE: eps <- a eps + dt (nu - fhat - phi_known); until the alarm it is E of the first
    filter. fhat: output of the network in the frame before. phi_known = -sum (1 - effectiveness) G_s u_s:
    what the law already takes into account."""
    eps, a = bank.E[:, 0].copy(), bank.a[0]
    for k in range(alarm + 1, len(nu)):
        expected = 1.0 if declaration.to_the_letter else readings.effectiveness[k - 1]
        known = -(Gu[k] * (1.0 - expected)).sum(axis=1)
        eps[k] = a * eps[k - 1] + declaration.dt * (nu[k] - readings.network[k - 1] - known)
    return eps


def _isolate(
    declaration: Declaration, bank: Bank, isolation: Isolation, x: np.ndarray, nu: np.ndarray,
    eta_bar: np.ndarray, changing: np.ndarray, columns: dict[str, Any],
) -> Result:  # fmt: skip
    alarm, names, dt = None, [], declaration.dt
    shape = len(x), len(isolation.of), 3
    residual, lower, upper = (np.full(shape, np.nan) for _ in range(3))
    excluded, effectiveness = (
        np.tile(1.0 * isolation.excluded, (len(x), 1)),
        np.ones((len(x), len(declaration.aircraft.surfaces))),
    )
    for k in range(1, len(x)):
        bound = eta_bar[k] + (changing[k] + changing[k - 1]) / dt
        frame = Frame(
            k,
            k * dt,
            x[k - 1],
            x[k],
            isolation.frames.F[k],
            nu[k],
            eta_bar[k],
            bound,
            *changing[k - 1 : k + 1],
        )
        of = isolation.effect(frame)
        if isolation.remembers:
            isolation.remember(of)
        started = alarm is not None
        if started:
            isolation.advance(of, frame)
        elif (axis := bank.alarm_axis(k)) is not None:
            alarm = k, AXES[axis]
            isolation.start(frame)
        if alarm:
            isolation.exclude(of, frame, started)
            residual[k], lower[k], upper[k] = isolation.eps, isolation.lower, isolation.upper
            excluded[k] = isolation.excluded
            name = isolation.decide()
            if name != (names[-1][1] if names else None):
                names.append((k, name))
            left = np.flatnonzero(~isolation.excluded)
            if left.size == 1:
                s = isolation.surface[left[0]]
                effectiveness[k, s] = 1.0 + isolation.theta[left[0], declaration.aircraft.main_axis[s]]
    for row, one in enumerate(isolation.of):
        for i, axis in enumerate(AXES):
            stem = f"fie_{one.name}_{axis}"
            columns[f"{stem}_residual_rad_s"] = residual[:, row, i]
            columns[f"{stem}_lower_rad_s"] = lower[:, row, i]
            columns[f"{stem}_upper_rad_s"] = upper[:, row, i]
        columns[f"fie_{one.name}_excluded"] = excluded[:, row]
    for s, name in enumerate(declaration.aircraft.surfaces):
        columns[f"{name}_effectiveness_estimate"] = effectiveness[:, s]
    left = [one.name for one, out in zip(isolation.of, isolation.excluded, strict=True) if not out]
    return Result(columns, alarm, names, left if alarm else [])
