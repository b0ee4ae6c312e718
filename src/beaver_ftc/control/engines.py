"""Engines as effectors: they take what surfaces no longer reach.

Each engine turns the aircraft by its arms. A surface about an axis that is given up or at its stop leaves a
part of the demand, the shortfall e. The engines are to give its integral w,

    w' = e / T,   T = 2 lag            over the engines' own lag: w / demand = 1 / (T s (lag s + 1) + 1)

which is damped by 0.7: they take the slow part; the fast one, which they could only answer late, is left to
the aircraft's own damping [Burcham1997]. Their moment is in the design model, by the moments of the engines
among its signals, or the law's observer finds it: e is then what is left. Once the surfaces reach, w fades.

Which engine gives what is constrained least squares (least_squares.py) over the accelerations u (m/s2 of the
whole aircraft's thrust over mass) that the power left above and below the common lever gives; B has

    share mass (0, down / Iy, -right / Iz)                       of a force along the body's x axis

with the inertia's coupling of yaw into roll. The lever that gives u is found in the table of thrust. Roll is
not asked of them: they roll by sideslip, which the outer loops ask for.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_EFFECTORS
from beaver_ftc.compiled import apart, fill, kernel, record
from beaver_ftc.control import least_squares, row_of
from beaver_ftc.control.allocation import remaining
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.control.power import WHOLE_RANGE_S
from beaver_ftc.control.thrust import ENGINE, gained, look_up, power_for, set_up_engine
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.diagnosis.state import PITCH, YAW
from beaver_ftc.scenario.declared import Declared

LEAST_LAG_S = 0.5  # of an engine that the file gives less lag: the law then integrates no faster
RELEASE_S = 20.0  # time constant with which w fades

# n: how many; low, high: of the setting, step: in a frame; integral_gain, release: shares a frame.
# B (3, n) rad/s2 per m/s2.
ENGINES_CONFIG = record(
    n=int, low=float, high=float, step=float, integral_gain=float, release=float, B=(3, MAX_EFFECTORS)
)  # fmt: skip
# serving: rows of B of the axes they serve now; wanted (3,) rad/s2: w.
ENGINES_MEMORY = record(
    thrust=ENGINE, serving=(3, MAX_EFFECTORS), wanted=3, problem=problem_dtype(MAX_EFFECTORS),
)  # fmt: skip
# difference: of each engine's setting from the common lever; authority (2, 3) rad/s2: the least and the
# greatest that all give about each axis.
ENGINES_OUTPUT = record(difference=MAX_EFFECTORS, authority=(2, 3))
ENGINES = record(config=ENGINES_CONFIG, memory=ENGINES_MEMORY, output=ENGINES_OUTPUT)


def configure_engines(engines: np.void, declared: Declared) -> None:
    """Fill the record (dtype ENGINES); it stays empty where no engine is an effector, or none may be used."""
    aircraft, dt, config = declared.aircraft, 1.0 / declared.rate_hz, engines["config"]
    named, thrust = aircraft.file.power_setting, aircraft.engine.thrust
    may_use = row_of(declared.control.law).uses_verdict and declared.control.power.enabled
    if not aircraft.effectors or not may_use or named is None:
        return
    low, high = named[1].range
    T = 2.0 * max(thrust.lag_s if thrust else 0.0, LEAST_LAG_S)
    fill(
        config, n=len(aircraft.effectors), low=low, high=high, step=(high - low) / WHOLE_RANGE_S * dt,
        integral_gain=dt / T, release=dt / RELEASE_S,
    )  # fmt: skip
    mass, i = declared.mass, inertia_coefficients(declared.mass)
    set_up_engine(engines["memory"]["thrust"], thrust, mass.mass_kg)
    for e, of in enumerate(aircraft.effectors.values()):
        force_n = of.share * mass.mass_kg
        pitching, yawing = of.down_m * force_n, -of.right_m * force_n
        config["B"][:, e] = i.Pn * yawing, i.Qm * pitching, i.Rn * yawing
        engines["memory"]["problem"]["weight"][e] = 1.0


def effects_of_engines(declared: Declared) -> np.ndarray:
    """B (3, engines): rad/s2 about each axis per m/s2 of each engine that is an effector; of none (3, 0)."""
    engines = np.zeros(1, ENGINES)[0]
    configure_engines(engines, declared)
    return np.array(engines["config"]["B"][:, : engines["config"]["n"]])


@kernel
def surface_reaches_demand(layout, saturated, surfaces, i):
    """Whether the surface that leads axis i is neither given up nor at its stop; saturated (n,): which
    are."""
    least = surfaces.config.least_effectiveness
    given_up = remaining(layout, surfaces.output.effectiveness, i) < least
    return not given_up and saturated[layout.main[i]] == 0


@kernel
def update_engine_demand(config, memory, axes, layout, saturated, surfaces):
    """Advance w (3,) rad/s2 by a frame: w <- w - release w where the surface reaches, else w + integral_gain
    e, e the shortfall. serving: rows of B of the axes whose w is not 0."""
    for i in (PITCH, YAW):
        if surface_reaches_demand(layout, saturated, surfaces, i):
            memory.wanted[i] -= config.release * memory.wanted[i]
        else:
            memory.wanted[i] += config.integral_gain * axes.shortfall[i]
        for e in range(config.n):
            memory.serving[i, e] = config.B[i, e] if memory.wanted[i] != 0.0 else 0.0


@kernel
def limit(config, memory, authority, base):
    """How far each goes from the common lever `base`, |u| <= most, m/s2, and what all give about each axis
    at most, `authority` (2, 3) = -+ sum |B_ie most|, rad/s2: as far up as down, so that their sum, which
    holds the airspeed, stays."""
    problem, table = memory.problem, memory.thrust
    authority[:] = 0.0
    most = min(gained(table, 0.0, base, config.high), -gained(table, 0.0, base, config.low))
    for e in range(config.n):
        problem.low[e], problem.high[e] = -most, most
        for i in (PITCH, YAW):
            reach = abs(config.B[i, e] * most)
            authority[0, i] -= reach
            authority[1, i] += reach


@apart
def steer_by_engines(engines, power, axes, layout, saturated, surfaces, airspeed):
    """Fill output.difference, the setting of each engine less that of the common lever: of the accelerations
    u (n,) m/s2 that give w best within the limits. airspeed m/s."""
    config, memory, output = engines.config, engines.memory, engines.output
    look_up(memory.thrust, airspeed)
    base = power.output.command[0]
    limit(config, memory, output.authority, base)
    update_engine_demand(config, memory, axes, layout, saturated, surfaces)
    least_squares.solve(memory.problem, memory.serving, memory.wanted)
    memory.wanted[:] = 0.0  # what cannot be given is not integrated
    for e in range(config.n):
        u = memory.problem.u[e]
        for i in (PITCH, YAW):
            memory.wanted[i] += memory.serving[i, e] * u
        output.difference[e] = power_for(memory.thrust, 0.0, base, u) - base


@kernel
def release_engines(engines):
    """Want nothing of the engines; `move_differences` brings them back to the common lever, step by step."""
    engines.memory.wanted[:] = 0.0
    engines.output.difference[:] = 0.0
    engines.output.authority[:] = 0.0
