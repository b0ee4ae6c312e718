"""A stretch of the log as arrays: what was true, measured and commanded, and what became of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.design.coefficients import SURFACES

AXES = ("p", "q", "r")
Columns = Mapping[str, np.ndarray]

_Y = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")  # the design model's order
_SURFACE_COLUMNS = tuple(f"{s}_{what}_rad" for s in SURFACES for what in ("cmd", "pos", "effective"))
_RATES = tuple(f"{axis}_rad_s" for axis in AXES)
_ATTITUDE = ("phi_rad", "theta_rad", "psi_rad")
REQUIRED = (
    "t_s", *_RATES, *_Y, *_ATTITUDE, "north_m", "altitude_m",
    *(f"{axis}dot_rad_s2" for axis in AXES), *(f"{axis}_eta_bar_rad_s2" for axis in AXES),
    *(f"{axis}_design_rad_s2" for axis in AXES), *_SURFACE_COLUMNS,
)  # fmt: skip


def measured_name(column: str) -> str:
    """The log column that holds what a sensor made of a true one: `alpha_rad` is `alpha_measured_rad`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_measured_{unit}" if unit else f"{stem}_measured"


def air_name(column: str) -> str:
    """The log column of a rate relative to the turning air: `p_rad_s` is `p_air_rad_s`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_air_{unit}"


OPTIONAL = tuple(measured_name(column) for column in (*_RATES, *_Y)) + tuple(map(air_name, _RATES))


@dataclass(frozen=True)
class States:
    """Frames of a flight; n of them. SI and rad.

    x, x_measured, x_air (n, 3) body rates relative to the Earth, as measured, and relative to the turning
    air; y, y_measured (n, 5) alpha, beta, V, qdyn, dpt; u, position, effective (n, 4): the command in
    effect, the actuators' output and what the aerodynamics see; xdot (n, 3) JSBSim's angular
    acceleration; attitude (n, 3) phi, theta, psi; north_m, altitude_m (n,); eta_bar, design_mean (n, 3)
    rad/s2: the bound, and f + G u as the diagnosis averaged it, over the frame that ends here.
    """

    t_s: np.ndarray
    x: np.ndarray
    x_measured: np.ndarray
    x_air: np.ndarray
    y: np.ndarray
    y_measured: np.ndarray
    u: np.ndarray
    position: np.ndarray
    effective: np.ndarray
    xdot: np.ndarray
    attitude: np.ndarray
    north_m: np.ndarray
    altitude_m: np.ndarray
    eta_bar: np.ndarray
    design_mean: np.ndarray

    def __len__(self) -> int:
        return self.t_s.size

    def __getitem__(self, rows: slice) -> "States":
        return States(**{name: values[rows] for name, values in vars(self).items()})


def states_of(log: Columns) -> States:
    """The states in log columns (name -> (n,)). A log without a measured column measured the truth."""
    surfaces = {what: [f"{s}_{what}_rad" for s in SURFACES] for what in ("cmd", "pos", "effective")}
    return States(
        t_s=log["t_s"],
        x=_stack(log, _RATES),
        x_measured=_stack(log, _present(log, _RATES, measured_name)),
        x_air=_stack(log, _present(log, _RATES, air_name)),
        y=_stack(log, _Y),
        y_measured=_stack(log, _present(log, _Y, measured_name)),
        u=_stack(log, surfaces["cmd"]),
        position=_stack(log, surfaces["pos"]),
        effective=_stack(log, surfaces["effective"]),
        xdot=_stack(log, [f"{axis}dot_rad_s2" for axis in AXES]),
        attitude=_stack(log, _ATTITUDE),
        north_m=log["north_m"],
        altitude_m=log["altitude_m"],
        eta_bar=_stack(log, [f"{axis}_eta_bar_rad_s2" for axis in AXES]),
        design_mean=_stack(log, [f"{axis}_design_rad_s2" for axis in AXES]),
    )


def _stack(log: Columns, names: Iterable[str]) -> np.ndarray:
    return np.column_stack([log[name] for name in names])


def _present(log: Columns, names: Iterable[str], other) -> list[str]:
    return [other(name) if other(name) in log else name for name in names]


def joined(held: Columns | None, chunk: Columns) -> Columns:
    """Columns one after the other; `held` None is nothing."""
    return chunk if held is None else {name: np.concatenate([held[name], chunk[name]]) for name in chunk}


def last_row(log: Columns) -> Columns:
    """The last row, as columns of one; a copy, so that the rest can go."""
    return {name: values[-1:].copy() for name, values in log.items()}
