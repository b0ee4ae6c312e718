"""The states of a flight, arrays (n, ...), SI and rad: from its log, and from signals that the log lacks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import N_PER_LBF
from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.plugin_context import measured_of

Log = Mapping[str, np.ndarray]


_ALONE = ("t_s", "north_m", "altitude_m")  # fields of `States` with one column
_TOGETHER = {  # fields with several columns
    "x": tuple(f"{axis}_rad_s" for axis in AXES),
    "x_measured": tuple(f"{axis}_measured_rad_s" for axis in AXES),
    "y": ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt"),  # the design model's order
    "u": tuple(f"{surface}_cmd_rad" for surface in SURFACES),
    "position": tuple(f"{surface}_pos_rad" for surface in SURFACES),
    "effective": tuple(f"{surface}_effective_rad" for surface in SURFACES),
    "xdot": tuple(f"{axis}dot_rad_s2" for axis in AXES),
    "attitude": ("phi_rad", "theta_rad", "psi_rad"),
    "eta_bar": tuple(f"{axis}_eta_bar_rad_s2" for axis in AXES),
    "design_mean": tuple(f"{axis}_design_rad_s2" for axis in AXES),
}  # fmt: skip
LOGGED = (*_ALONE, *(column for columns in _TOGETHER.values() for column in columns))
_NOT_LOGGED = (  # properties of JSBSim
    *(f"velocities/{axis}-aero-rad_sec" for axis in AXES), *(f"forces/fb{axis}-aero-lbs" for axis in "xyz"),
)  # fmt: skip


@dataclass(frozen=True)
class States:
    """The n frames of a flight, SI and rad. f + G u: acceleration by the design model."""

    t_s: np.ndarray
    x: np.ndarray  # (n, 3) body rates p, q, r relative to the Earth
    x_measured: np.ndarray
    x_air: np.ndarray  # relative to the turning air
    y: np.ndarray  # (n, 5) alpha, beta, V, qdyn, dpt
    y_measured: np.ndarray
    force: np.ndarray  # (n, 3) N: aerodynamic force along the body axes X, Y, Z
    u: np.ndarray  # (n, 4) commands in effect
    position: np.ndarray  # (n, 4) output of the actuators
    effective: np.ndarray  # (n, 4) what the aerodynamics see
    xdot: np.ndarray  # (n, 3) JSBSim's angular acceleration
    attitude: np.ndarray  # (n, 3) phi, theta, psi
    north_m: np.ndarray
    altitude_m: np.ndarray
    eta_bar: np.ndarray  # (n, 3) rad/s2: the bound over the frame that ends here
    design_mean: np.ndarray  # (n, 3) rad/s2: f + G u as the diagnosis averaged it over that frame


class Unlogged(dict[str, np.ndarray]):
    """The signals of a flight that its log lacks, by their names in `States`: x_air, y_measured, force."""

    def watch(self, loop: Loop) -> Callable[[], None]:
        """Record them in each frame of a flight, as an argument of `fly`. The returned function fills the
        dictionary at the end of the flight."""
        rows = list[np.ndarray]()

        def after_frame() -> None:
            rows.append(np.array([*loop.plant.read_all(_NOT_LOGGED), *measured_of(loop.frames[0]).y]))

        def over() -> None:
            x_air, force_lbf, y_measured = np.split(np.array(rows), (3, 6), axis=1)
            self.update(x_air=x_air, y_measured=y_measured, force=N_PER_LBF * force_lbf)

        loop.after_frame = after_frame
        return over


def states_of(log: Log, unlogged: Unlogged) -> States:
    """The states of a flight. log: columns (n,)."""
    together = {
        name: np.column_stack([log[column] for column in columns]) for name, columns in _TOGETHER.items()
    }
    return States(**{name: log[name] for name in _ALONE}, **together, **unlogged)
