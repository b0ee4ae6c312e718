"""The columns of a flight's log as arrays, (n, ...), SI and rad."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.design.fdc import SURFACES

Log = Mapping[str, np.ndarray]


def column_of(how: str, column: str) -> str:
    """The column of a signal as measured by a sensor (how: `measured`), or of a rate relative to the turning
    air (`air`): `alpha_measured_rad` of `alpha_rad`, `p_air_rad_s` of `p_rad_s`."""
    stem, _, unit = column.partition("_")
    return f"{stem}_{how}_{unit}".rstrip("_")


_X = tuple(f"{axis}_rad_s" for axis in AXES)
_Y = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")  # the design model's order
_X_MEASURED, _X_AIR = (tuple(column_of(how, column) for column in _X) for how in ("measured", "air"))
_Y_MEASURED = tuple(column_of("measured", column) for column in _Y)
_TRUE = dict(zip((*_X_MEASURED, *_X_AIR, *_Y_MEASURED), (*_X, *_X, *_Y), strict=True))
_ALONE = ("t_s", "north_m", "altitude_m")  # fields of `States` with one column
_TOGETHER = {  # fields with several columns
    "x": _X, "x_measured": _X_MEASURED, "x_air": _X_AIR, "y": _Y, "y_measured": _Y_MEASURED,
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
    """The n frames of a flight, SI and rad. f + G u: acceleration by the design model."""

    t_s: np.ndarray
    x: np.ndarray  # (n, 3) body rates p, q, r relative to the Earth
    x_measured: np.ndarray
    x_air: np.ndarray  # relative to the turning air
    y: np.ndarray  # (n, 5) alpha, beta, V, qdyn, dpt
    y_measured: np.ndarray
    u: np.ndarray  # (n, 4) commands in effect
    position: np.ndarray  # (n, 4) output of the actuators
    effective: np.ndarray  # (n, 4) what the aerodynamics see
    xdot: np.ndarray  # (n, 3) JSBSim's angular acceleration
    attitude: np.ndarray  # (n, 3) phi, theta, psi
    north_m: np.ndarray
    altitude_m: np.ndarray
    eta_bar: np.ndarray  # (n, 3) rad/s2: the bound over the frame that ends here
    design_mean: np.ndarray  # (n, 3) rad/s2: f + G u as the diagnosis averaged it over that frame


def states_of(log: Log) -> States:
    """The states from log columns (n,). A column that the log lacks, measured or relative to the air, is
    replaced by the true one. The log of a flight has of these only the measured rates: measured air data
    count as exact, and the air as not turning."""
    together = {
        name: np.column_stack([log[column if column in log else _TRUE[column]] for column in columns])
        for name, columns in _TOGETHER.items()
    }
    return States(**{name: log[name] for name in _ALONE}, **together)
