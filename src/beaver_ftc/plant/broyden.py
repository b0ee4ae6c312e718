"""Near enough to trim, cheaply: Broyden's method on an aircraft without engines.

A start of the truth costs nine JSBSim frames, Newton's method two dozen starts. Here the Jacobian is found
once, by differences, and then corrected by each step [Broyden1965, the first method]; and of a start only
what changes is done again. The side force of betadot lags one look behind: the steps end at zero, and so
does what it lags by. The full start has the last word, in trim.py.
"""

from collections.abc import Callable
from math import cos, isfinite, sin

import numpy as np

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plant.adapter import FT_PER_M, Plant
from beaver_ftc.plant.state import FlightState

ACCELERATIONS = (
    ("accelerations/udot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/vdot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/wdot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/pdot-rad_sec2", 1.0),
    ("accelerations/qdot-rad_sec2", 1.0),
    ("accelerations/rdot-rad_sec2", 1.0),
)
STEP_RAD = 1e-5  # for differences
MAX_CHANGE_RAD = 0.2  # a longer step leaves the region its Jacobian describes
_GOAL = 1e-11  # m/s2 and rad/s2: rounding leaves a tenth of it
_MAX_STEPS = 15
_RATES_AND_FLOW = ("ic/u-fps", "ic/v-fps", "ic/w-fps")

Vector = np.ndarray
Look = Callable[[Vector], Vector]


def approach(truth: Plant, state: FlightState, names: tuple[str, ...]) -> Vector:
    """Values of the unknowns `names` of a state at which its accelerations nearly vanish, (unknowns,) rad.

    names: alpha, beta, theta, then `<surface>_rad`. The truth has been started at the state. What comes out
    is not finite, or not near, where there is no such flight.
    """
    look = _looking(truth, state, names)
    x = np.array([getattr(state, name) for name in names])
    here = look(x)
    J = np.column_stack([(look(x + step) - here) / STEP_RAD for step in STEP_RAD * np.eye(x.size)])
    for _ in range(_MAX_STEPS):
        if not np.abs(here).max() > _GOAL:
            break
        step = shortened(newton_step(J, here))
        x = x + step
        there = look(x)
        J += np.outer(there - here - J @ step, step) / (step @ step)
        here = there
    return x


def newton_step(J: Vector, here: Vector) -> Vector:
    """The step that takes `here` (6,) to zero in the least-squares sense; zero where that is not finite."""
    if not isfinite(J.sum() + here.sum()):
        return np.full(J.shape[1], np.nan)
    try:
        return np.linalg.solve(J, -here)
    except np.linalg.LinAlgError:  # singular, or other than six unknowns
        return np.linalg.lstsq(J, -here, rcond=None)[0]


def shortened(step: Vector) -> Vector:
    """At most MAX_CHANGE_RAD in each unknown."""
    return step * min(1.0, MAX_CHANGE_RAD / max(np.abs(step).max(), STEP_RAD))


def _looking(truth: Plant, state: FlightState, names: tuple[str, ...]) -> Look:
    """The six accelerations, m/s2 and rad/s2, as a function of the unknowns."""
    fdm, speed_fps = truth.fdm, state.airspeed_mps * FT_PER_M
    theta_place, *flow = (truth.input(name) for name in ("ic/theta-rad", *_RATES_AND_FLOW))
    surfaces = [truth.input(truth.aircraft.surface[name.removesuffix("_rad")].command) for name in names[3:]]
    puts = [node.set_double_value for node in (theta_place, *flow, *surfaces)]
    gets = [truth.node(name).get_double_value for name, _ in ACCELERATIONS]
    factors = np.array([factor for _, factor in ACCELERATIONS])

    def look(x: Vector) -> Vector:
        alpha, beta, theta, *deflections = x.tolist()
        along = speed_fps * cos(beta)
        flow_fps = along * cos(alpha), speed_fps * sin(beta), along * sin(alpha)
        for put, value in zip(puts, (theta, *flow_fps, *deflections), strict=True):
            put(value)
        if not fdm.run_ic():
            raise SimulationFailed("JSBSim cannot initialise the flight")
        return np.array([get() for get in gets]) * factors

    return look
