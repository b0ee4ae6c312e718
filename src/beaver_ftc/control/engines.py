"""Engines as effectors: each turns the aircraft by its arms, and takes what surfaces no longer reach.

A surface about an axis that is given up or at its stop leaves a part of the demand, the shortfall e. What the
engines are to give is its integral,

    w' = e / T,   T = 2 lag            over the engines' own lag: w / demand = 1 / (T s (lag s + 1) + 1)

which is damped by 0.7: they take the slow part; the fast one, which they could only answer late, is left to
the aircraft's own damping [Burcham1997]. What they give is in the design model, by the moments of the engines
among its signals, or the law's observer finds it: e is then what is left. Once the surfaces reach, w fades.

Which engine gives what is constrained least squares (least_squares.py) over the accelerations u (m/s2 of the
whole aircraft's thrust over mass) that the power left above and below the common lever gives; B has

    share mass (0, down / Iy, -right / Iz)                       of a force along the body's x axis

with the inertia's coupling of yaw into roll. The lever that gives u is found in the table of thrust. Roll is
not asked of them: they roll by sideslip, which the outer loops ask for.
"""

import numpy as np

from beaver_ftc.aircraft.schema import MAX_EFFECTORS
from beaver_ftc.compiled import apart, kernel, record
from beaver_ftc.control import least_squares
from beaver_ftc.control.allocation import remaining
from beaver_ftc.control.laws import NOMINAL, law_of
from beaver_ftc.control.least_squares import problem_dtype
from beaver_ftc.control.outer.thrust import ENGINE, gained, power_for, set_up_engine
from beaver_ftc.control.outer.thrust import look_up as at_airspeed
from beaver_ftc.control.power import WHOLE_RANGE_S
from beaver_ftc.design.model import inertia_coefficients
from beaver_ftc.diagnosis.state import PITCH, YAW
from beaver_ftc.scenario.schema import Scenario

LEAST_LAG_S, RELEASE_S = 0.5, 20.0

# n: how many; low, high: of the setting, step: in a frame; part, release: shares a frame. B (3, n) rad/s2 per
# m/s2, rows of the axes they serve now in `serving`; wanted (3,) rad/s2: w; from_s: since when they turn.
ENGINES = record(
    n=int, low=float, high=float, step=float, part=float, release=float, thrust=ENGINE,
    B=(3, MAX_EFFECTORS), serving=(3, MAX_EFFECTORS), wanted=3, problem=problem_dtype(MAX_EFFECTORS),
    from_s=float,
)  # fmt: skip


def configure(engines: np.void, scenario: Scenario) -> None:
    """Fill the record (dtype ENGINES); it stays empty where no engine is an effector, or none may be used."""
    aircraft, dt = scenario.airframe, 1.0 / scenario.rate_hz
    named, thrust = aircraft.file.power_setting, aircraft.engine.thrust
    law, _ = law_of(scenario.control.law)
    if not aircraft.effectors or law == NOMINAL or not scenario.control.power.enabled or named is None:
        return
    engines["n"], engines["from_s"] = len(aircraft.effectors), -1.0
    engines["low"], engines["high"] = low, high = named[1].range
    engines["step"] = (high - low) / WHOLE_RANGE_S * dt
    engines["part"] = dt / (2.0 * max(thrust.lag_s if thrust else 0.0, LEAST_LAG_S))
    engines["release"] = dt / RELEASE_S
    mass, i = aircraft.mass, inertia_coefficients(aircraft.mass)
    set_up_engine(engines["thrust"], thrust, mass.mass_kg)
    for e, of in enumerate(aircraft.effectors.values()):
        force_n = of.share * mass.mass_kg
        pitching, yawing = of.down_m * force_n, -of.right_m * force_n
        engines["B"][:, e] = i.Pn * yawing, i.Qm * pitching, i.Rn * yawing
        engines["problem"]["willing"][e] = 1.0


@kernel
def reaches(layout, allocation, surfaces, i):
    """Whether the surface that leads axis i is neither given up nor at its stop."""
    given_up = remaining(layout, surfaces.effectiveness, i) < surfaces.least_effectiveness
    return not given_up and allocation.saturated[layout.main[i]] == 0


@kernel
def want(engines, axes, layout, allocation, surfaces):
    """Bring what they are to give to this frame."""
    for i in (PITCH, YAW):
        if reaches(layout, allocation, surfaces, i):
            engines.wanted[i] -= engines.release * engines.wanted[i]
        else:
            engines.wanted[i] += engines.part * axes.shortfall[i]
        for e in range(engines.n):
            engines.serving[i, e] = engines.B[i, e] if engines.wanted[i] != 0.0 else 0.0


@kernel
def limit(engines, layout, base):
    """How far each goes from the common lever `base`, and what all give about each axis at most: as far up as
    down, so that their sum, which holds the airspeed, stays."""
    problem, table = engines.problem, engines.thrust
    layout.beside[:] = 0.0
    most = min(gained(table, 0.0, base, engines.high), -gained(table, 0.0, base, engines.low))
    for e in range(engines.n):
        problem.low[e], problem.high[e] = -most, most
        for i in (PITCH, YAW):
            one, other = engines.B[i, e] * problem.low[e], engines.B[i, e] * problem.high[e]
            layout.beside[0, i] += min(one, other)
            layout.beside[1, i] += max(one, other)


@apart
def steer(engines, power, axes, layout, allocation, surfaces, airspeed, t):
    """Move the power of each engine by one frame, at t s; airspeed m/s."""
    at_airspeed(engines.thrust, airspeed)
    base = power.command[0]
    limit(engines, layout, base)
    want(engines, axes, layout, allocation, surfaces)
    least_squares.solve(engines.problem, engines.serving, engines.wanted)
    engines.wanted[:] = 0.0  # what cannot be given is not integrated
    for e in range(engines.n):
        u, before = engines.problem.u[e], power.command[1 + e]
        for i in (PITCH, YAW):
            engines.wanted[i] += engines.serving[i, e] * u
        difference = power_for(engines.thrust, 0.0, base, u) - base
        power.command[1 + e] = min(max(difference, before - engines.step), before + engines.step)
        power.in_use = power.in_use or power.command[1 + e] != 0.0
    if power.in_use and engines.from_s < 0.0 and power.command[1] != 0.0:
        engines.from_s = t
