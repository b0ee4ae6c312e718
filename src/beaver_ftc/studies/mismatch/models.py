"""The log as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.fdc import SURFACES

Log = Mapping[str, np.ndarray]


def measured_name(column: str) -> str:
    """The log column that holds what a sensor made of a true one: `alpha_rad` is `alpha_measured_rad`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_measured_{unit}" if unit else f"{stem}_measured"


def air_name(column: str) -> str:
    """The log column of a rate relative to the turning air: `p_rad_s` is `p_air_rad_s`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_air_{unit}"


_X = tuple(f"{axis}_rad_s" for axis in AXES)
_Y = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")  # the design model's order
_TRUE = {measured_name(column): column for column in (*_X, *_Y)} | {air_name(column): column for column in _X}
_ALONE = ("t_s", "north_m", "altitude_m")
_TOGETHER = {
    "x": _X, "x_measured": tuple(map(measured_name, _X)), "x_air": tuple(map(air_name, _X)),
    "y": _Y, "y_measured": tuple(map(measured_name, _Y)),
    "u": tuple(f"{surface}_cmd_rad" for surface in SURFACES),
    "position": tuple(f"{surface}_pos_rad" for surface in SURFACES),
    "effective": tuple(f"{surface}_effective_rad" for surface in SURFACES),
    "xdot": tuple(f"{axis}dot_rad_s2" for axis in AXES),
    "attitude": ("phi_rad", "theta_rad", "psi_rad"),
    "eta_bar": tuple(f"{axis}_eta_bar_rad_s2" for axis in AXES),
    "design_mean": tuple(f"{axis}_design_rad_s2" for axis in AXES),
}  # fmt: skip


LOGGED = frozenset((*_ALONE, *(column for columns in _TOGETHER.values() for column in columns)))


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


def states_of(log: Log) -> States:
    """The states in log columns (name -> (n,)). A log without a measured column measured the truth."""
    together = {
        name: np.column_stack([log[column if column in log else _TRUE[column]] for column in columns])
        for name, columns in _TOGETHER.items()
    }
    return States(**{name: log[name] for name in _ALONE}, **together)
