"""Engines as effectors: they take what surfaces no longer reach.

If the surfaces of an axis have lost their authority, or the one that leads it is at its stop, they do not
give a part of the demand, the shortfall e, rad/s2. The engines are asked for the integral w of the shortfall,
rad/s2. With the lag of the engines, s, the loop has a damping of 0.7:

    w' = e / T,   T = 2 lag,        w / demand = 1 / (T s (lag s + 1) + 1)

So the engines take the slow part. The engines would answer the fast part late, so it is left to the own
damping of the aircraft [Burcham1997]. The design model contains the moments of the engines (as signals), or
the law's observer finds them: e is then only the part that the engines do not give yet. Once the surface
reaches the demand again, w fades.

Constrained least squares (least_squares.py) distribute w to the engines. The unknowns are the accelerations
u_k of the aircraft, m/s2, by which engine k exceeds the common lever: thrust over mass. Column k of B is

    share mass (0, down / Iy, -right / Iz)        rad/s2 per m/s2, for a force along the body's x axis

and the coupling of yaw into roll by the inertia. share: part of engine k in the thrust; down, right, m: its
distances from the centre of gravity. The table of thrust gives the setting for u_k. Engines are not asked for
roll: the outer loops demand sideslip, which rolls the aircraft.
"""

import numpy as np

from beaver_ftc.aircraft import PITCH, YAW
from beaver_ftc.aircraft.schema import MAX_EFFECTORS
from beaver_ftc.compiled import apart, fill, kernel, record
from beaver_ftc.control import least_squares, row_of
from beaver_ftc.control.authority import remaining
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.control.power import WHOLE_RANGE_S
from beaver_ftc.control.thrust import ENGINE, gained, look_up, power_for, set_up_engine
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.scenario.declared import Declared

LEAST_LAG_S = 0.5  # The law assumes at least this lag, so that it integrates no faster.
RELEASE_S = 20.0  # time constant with which w fades

# n: number of engines that are effectors. low, high: range of the setting; step: its largest change in a
# frame. integral_gain: dt / T; release: dt / RELEASE_S. B (3, n): rad/s2 per m/s2.
ENGINES_CONFIG = record(
    n=int, low=float, high=float, step=float, integral_gain=float, release=float, B=(3, MAX_EFFECTORS)
)  # fmt: skip
# serving (3, n): B, with a row of zeros for an axis that needs no engine now; wanted (3,) rad/s2: w.
ENGINES_MEMORY = record(
    thrust=ENGINE, serving=(3, MAX_EFFECTORS), wanted=3, problem=problem_dtype(MAX_EFFECTORS),
)  # fmt: skip
# difference (n,): setting of each engine minus that of the common lever; authority (2, 3) rad/s2: the least
# and the greatest acceleration that all engines together can give about each axis.
ENGINES_OUTPUT = record(difference=MAX_EFFECTORS, authority=(2, 3))
ENGINES = record(config=ENGINES_CONFIG, memory=ENGINES_MEMORY, output=ENGINES_OUTPUT)


def configure_engines(engines: np.void, declared: Declared) -> None:
    """Fill the record (dtype ENGINES); it stays empty where no engine is an effector, none may be used, or
    the aircraft's file has no setting of power."""
    aircraft = declared.aircraft
    dt = 1.0 / declared.rate_hz
    config = engines["config"]
    name_and_setting = aircraft.file.power_setting
    thrust = aircraft.engine.thrust
    may_use = row_of(declared.control.law).uses_verdict and declared.control.power.enabled
    if not aircraft.effectors or not may_use or name_and_setting is None:
        return
    low, high = name_and_setting[1].range
    T = 2.0 * max(thrust.lag_s if thrust else 0.0, LEAST_LAG_S)
    fill(
        config, n=len(aircraft.effectors), low=low, high=high, step=(high - low) / WHOLE_RANGE_S * dt,
        integral_gain=dt / T, release=dt / RELEASE_S,
    )  # fmt: skip
    mass = declared.mass
    inertia = inertia_coefficients(declared.mass)
    set_up_engine(engines["memory"]["thrust"], thrust, mass.mass_kg)
    for k, engine in enumerate(aircraft.effectors.values()):
        force_n = engine.share * mass.mass_kg
        pitching = engine.down_m * force_n
        yawing = -engine.right_m * force_n
        config["B"][:, k] = inertia.Pn * yawing, inertia.Qm * pitching, inertia.Rn * yawing
        engines["memory"]["problem"]["weight"][k] = 1.0


def effects_of_engines(declared: Declared) -> np.ndarray:
    """B (3, n): rad/s2 about each axis per m/s2 of each engine that is an effector; (3, 0) without any."""
    engines = np.zeros(1, ENGINES)[0]
    configure_engines(engines, declared)
    return np.array(engines["config"]["B"][:, : engines["config"]["n"]])


@kernel
def surface_reaches_demand(layout, saturated, surfaces, i):
    """Whether the surface that leads axis i is not at its stop, and the surfaces of the axis keep
    `least_effectiveness` of its authority (`authority.remaining`); saturated (surfaces,): whether each is at
    its stop."""
    given_up = remaining(layout, surfaces.output.effectiveness, i) < surfaces.config.least_effectiveness
    return not given_up and saturated[layout.main[i]] == 0


@kernel
def update_engine_demand(config, memory, axes, layout, saturated, surfaces):
    """Bring w (3,) rad/s2 to this frame, in pitch and yaw; fill `serving`, the rows i of B with w_i not 0:

    w_i <- w_i - release w_i              if `surface_reaches_demand`
    w_i <- w_i + integral_gain e_i        otherwise        e (3,) rad/s2: axes.shortfall
    """
    w = memory.wanted
    for i in (PITCH, YAW):
        if surface_reaches_demand(layout, saturated, surfaces, i):
            w[i] -= config.release * w[i]
        else:
            w[i] += config.integral_gain * axes.shortfall[i]
        for k in range(config.n):
            memory.serving[i, k] = config.B[i, k] if w[i] != 0.0 else 0.0


@kernel
def limit(config, memory, authority, base):
    """Fill the limits of u_k, m/s2, around the setting `base` of the common lever, and `authority` (2, 3)
    rad/s2:

        |u_k| <= u_max = min(gain up to config.high, loss down to config.low)
        authority_i = -+ sum_k |B_ik| u_max

    The limits up and down are equal. To yaw, two engines on opposite sides then give opposite u, also at
    their limits, and the sum of the thrust, which holds the airspeed, stays.
    """
    problem = memory.problem
    table = memory.thrust
    authority[:] = 0.0
    # 0.0 is the push (thrust.py), which is not used: an aircraft with such engines has a table
    u_max = min(gained(table, 0.0, base, config.high), -gained(table, 0.0, base, config.low))
    for k in range(config.n):
        problem.low[k] = -u_max
        problem.high[k] = u_max
        for i in (PITCH, YAW):
            reach = abs(config.B[i, k] * u_max)
            authority[0, i] -= reach
            authority[1, i] += reach


@apart
def steer_by_engines(control, airspeed):
    """Fill `difference`, for the u (n,) m/s2 within the limits that give w best, at an airspeed m/s:

        u = argmin |B u - w|^2,    difference_k = setting for u_k - setting of the common lever
        w <- B u        (anti-windup: the integral keeps only what the engines give)

    B: the rows of the axes that need engines, `serving`.
    """
    config = control.engines.config
    memory = control.engines.memory
    output = control.engines.output
    w = memory.wanted
    table = memory.thrust
    base = control.power.output.command[0]
    saturated = control.allocation.output.saturated
    look_up(table, airspeed)
    limit(config, memory, output.authority, base)
    update_engine_demand(config, memory, control.axes, control.layout, saturated, control.surfaces)
    least_squares.solve(memory.problem, memory.serving, w)
    w[:] = 0.0
    for k in range(config.n):
        u = memory.problem.u[k]
        for i in (PITCH, YAW):
            w[i] += memory.serving[i, k] * u
        output.difference[k] = power_for(table, 0.0, base, u) - base  # push 0.0: see `limit`


@kernel
def release_engines(engines):
    """Ask the engines for nothing; `move_differences` (power.py) brings them back to the common lever."""
    engines.memory.wanted[:] = 0.0
    engines.output.difference[:] = 0.0
    engines.output.authority[:] = 0.0
