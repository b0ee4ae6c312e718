"""Envelope protection: the airspeeds that can be held with the remaining authority of the surfaces.

Level flight takes an elevator that depends on dynamic pressure and flap (level_flight.py).

The *acting elevator*, rad, is the deflection of a healthy elevator that would give the pitch moments that
there are (`average_acting_elevator`):

    acting = offset + E u + d / G

    offset, E   rad, 1          offset and remaining effectiveness of the elevator, by the diagnosis
    u           rad             its position
    d           rad/s2          pitch acceleration that the law's observer finds unexplained
    G           rad/s2 per rad  effectiveness of a healthy elevator in pitch

So the position of a jam is known before its type is. An airspeed can be held if the flap, less a reserve to
fly with, makes up for the rest (`find_airspeeds_that_can_be_held`). The airspeed to fly is the nearest of
these to the commanded one. No law can hold an airspeed for which elevator and flap do not suffice.
"""

from math import radians

import numpy as np

from beaver_ftc.aircraft import PITCH, ROLL, YAW
from beaver_ftc.compiled import fill, kernel, record
from beaver_ftc.control.allocation import within_stops
from beaver_ftc.control.level_flight import THRUST, elevator_needed
from beaver_ftc.control.profile import SPEED, clamp
from beaver_ftc.control.thrust import between
from beaver_ftc.design.engine import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.design.table import AIRSPEED, QDYN
from beaver_ftc.scenario.declared import Declared

ACTING_S = 4.0  # time constant of the mean acting elevator, because gusts pitch within a second
HOLD_SETTLED_S = 0.5  # time of averaging before which no airspeed is limited
NOTED_MPS, NOTED_RAD = 0.5, 0.02  # A limit that changes the command by this much is in force.
MOST_BANK_DEG = 30.0  # largest bank of a healthy aircraft
# Part of the flap's travel that is kept at the ends of the airspeeds that can be held. Of 0, 0.7, 1.5 and 3
# deg, it is the one with which most flights with a jam were kept.
FLAP_RESERVE_DEG = 0.7
# Largest rate at which a limit moves the airspeed to fly: about as fast as drag slows the aircraft.
MAX_AIRSPEED_RATE_MPS2 = 1.0

FASTEST, SLOWEST, BANK_LIMIT = range(3)  # the limits, as indices of in_force, from_s and value
N_QDYN, N_FLAP = 12, 5
HOLDING = record(
    has_table=int,  # whether the table of level flight is filled
    limits_airspeed=int,  # whether the airspeed to fly differs from the command
    n_averaged_frames=int,  # frames in the means below
    flap_reserve=float,  # rad
    max_airspeed_rate_mps2=float,
    # table: the elevator that level flight takes, rad, over dynamic pressure, Pa, and flap, rad
    qdyn=N_QDYN, flap=N_FLAP, elevator=(N_QDYN, N_FLAP),
    # means over ACTING_S, rad: of the acting elevator, and of its commanded part E u
    mean_acting_elevator=float, mean_commanded_elevator=float,
    fastest=float, slowest=float,  # m/s, between which level flight can be held
    bank=float,  # rad, the bank limit, smoothed
    # of each limit: whether it is in force now; since when, s, -1 for never; its last value, m/s or rad
    in_force=(int, 3), from_s=3, value=3,
)  # fmt: skip


@kernel
def limit_airspeed_to_fly(ap, layout, surfaces, u, unexplained, y, t):
    """Set ap.airspeed_to_fly of this frame, at t s: the nearest to the commanded airspeed that can be
    held. Any airspeed counts as one that can, without a table, while elevator and flap have their whole
    effectiveness, and in the first HOLD_SETTLED_S after that.

    u (n,) rad: where the surfaces are. unexplained: d / G, rad.
    """
    holding = ap.holding
    e = layout.main[PITCH]
    f = layout.stand_in
    holding.fastest = np.inf
    holding.slowest = 0.0
    effectiveness = surfaces.output.effectiveness
    E = effectiveness[e]
    healthy = E >= 1.0 and (f < 0 or effectiveness[f] >= 1.0)
    if healthy or not holding.has_table:
        holding.n_averaged_frames = 0
    else:
        average_acting_elevator(holding, ap.dt, surfaces.output.offset[e], E * u[e], unexplained)
        if holding.n_averaged_frames * ap.dt > HOLD_SETTLED_S:
            find_airspeeds_that_can_be_held(holding, layout, surfaces, y)
    approach_airspeed_to_fly(ap)
    record_limits_in_force(ap, layout.main, effectiveness, t)


@kernel
def average_acting_elevator(holding, dt, offset, commanded, unexplained):
    """Average the acting elevator and its commanded part E u, rad, over ACTING_S:

        acting = offset + commanded + unexplained
        mean <- mean + weight (value - mean),    weight = max(dt / ACTING_S, 1 / n)

    n: averaged frames, so that at first all frames count alike. All in rad.
    """
    acting = offset + commanded + unexplained
    holding.n_averaged_frames += 1
    weight = max(dt / ACTING_S, 1.0 / holding.n_averaged_frames)
    holding.mean_acting_elevator += weight * (acting - holding.mean_acting_elevator)
    holding.mean_commanded_elevator += weight * (commanded - holding.mean_commanded_elevator)


@kernel
def find_airspeeds_that_can_be_held(holding, layout, surfaces, y):
    """Fill the fastest and the slowest airspeed that can be held, m/s.

    The flap may stand at either end of its travel, less the reserve, and the acting elevator at

        fixed + E u,    u in its travel        fixed, rad: the part that acts without a command

    The flap up and the greatest acting elevator give the fastest airspeed V, the flap down and the least one
    the slowest: V = sqrt(2 qdyn / rho), qdyn by the table, rho kg/m3 of the air by the readings. A flap that
    is given up stands at its offset.
    """
    e = layout.main[PITCH]
    f = layout.stand_in
    E = surfaces.output.effectiveness[e]
    E_flap = surfaces.output.effectiveness[f]
    fixed = holding.mean_acting_elevator - holding.mean_commanded_elevator
    least, greatest = fixed + E * layout.low[e], fixed + E * layout.high[e]
    up, down = layout.low[f] + holding.flap_reserve, layout.high[f] - holding.flap_reserve
    if E_flap < surfaces.config.least_effectiveness:
        up = down = within_stops(layout, f, surfaces.output.offset[f])
    rho = 2.0 * y[QDYN] / y[AIRSPEED] ** 2
    holding.fastest = np.sqrt(2.0 * dynamic_pressure_limit(holding, up, greatest, FASTEST) / rho)
    holding.slowest = np.sqrt(2.0 * dynamic_pressure_limit(holding, down, least, SLOWEST) / rho)


@kernel
def dynamic_pressure_limit(holding, flap, elevator, limit):
    """The dynamic pressure, Pa, at which level flight with this flap takes this elevator, rad: linear between
    the points of the table, whose elevator is taken to rise with dynamic pressure.

        the table's elevator exceeds this one    limit FASTEST              limit SLOWEST
        from the first point on                  the first point            0
        from a later point on                    between two points         the same
        nowhere                                  infinite                   the last point
    """
    before = between(flap, N_FLAP, holding.flap, holding.elevator[0])
    if before > elevator:
        return holding.qdyn[0] if limit == FASTEST else 0.0
    for j in range(1, N_QDYN):
        after = between(flap, N_FLAP, holding.flap, holding.elevator[j])
        if after > elevator:
            part = (elevator - before) / (after - before)
            return holding.qdyn[j - 1] + part * (holding.qdyn[j] - holding.qdyn[j - 1])
        before = after
    return np.inf if limit == FASTEST else holding.qdyn[N_QDYN - 1]


@kernel
def approach_airspeed_to_fly(ap):
    """Move the airspeed to fly towards the nearest to the command that can be held, at most at
    max_airspeed_rate_mps2, so without a bump. Without a limit, it is the command."""
    holding = ap.holding
    command = ap.command[SPEED]
    target = min(max(command, holding.slowest), holding.fastest)
    if target == command and not holding.limits_airspeed:
        ap.airspeed_to_fly = command
        ap.to_fly_rate = ap.command_rate[SPEED]
        return
    step = clamp(target - ap.airspeed_to_fly, holding.max_airspeed_rate_mps2 * ap.dt)
    ap.airspeed_to_fly += step
    ap.to_fly_rate = step / ap.dt
    holding.limits_airspeed = ap.airspeed_to_fly != command


@kernel
def record_limits_in_force(ap, main, effectiveness, t):
    """Record which limits are in force at t s; main (3,): the surface that leads each axis.

    airspeed    if an airspeed is commanded: while the limit changes it by more than NOTED_MPS
    bank        while ailerons or rudder have lost effectiveness, and the limit, smoothed over ACTING_S of
                this time, is more than NOTED_RAD below that in health
    """
    holding = ap.holding
    command = ap.command[SPEED]
    if ap.is_commanded[SPEED]:
        record_limit(holding, FASTEST, holding.fastest, holding.fastest < command - NOTED_MPS, t)
        record_limit(holding, SLOWEST, holding.slowest, holding.slowest > command + NOTED_MPS, t)
    lost = effectiveness[main[ROLL]] < 1.0 or effectiveness[main[YAW]] < 1.0
    if lost:
        holding.bank += ap.dt / ACTING_S * (ap.bank_limit - holding.bank)
    limited = lost and holding.bank < ap.max_healthy_bank - NOTED_RAD
    record_limit(holding, BANK_LIMIT, holding.bank, limited, t)


@kernel
def record_limit(holding, kind, value, in_force, t):
    """Record whether a limit is in force at t s and, if so, its value, and t if it is the first time."""
    holding.in_force[kind] = in_force
    if in_force:
        if holding.from_s[kind] < 0.0:
            holding.from_s[kind] = t
        holding.value[kind] = value


def set_up_level_flight_table(holding: np.void, layout: np.void, declared: Declared) -> None:
    """Fill the table of level flight, if the aircraft's file has forces, the signal THRUST, and a stand-in
    for the elevator; has_table, only if there is level flight at each point. The dynamic pressures are those
    of the envelope's airspeeds at sea level."""
    aircraft = declared.aircraft
    flap = int(layout["stand_in"])
    fill(holding, from_s=-1.0, bank=radians(MOST_BANK_DEG), fastest=np.inf)
    if flap < 0 or not aircraft.forces or THRUST not in aircraft.signals:
        return
    speeds_mps = np.linspace(*aircraft.envelope.airspeed_mps, N_QDYN)
    qdyn_pa = 0.5 * SEA_LEVEL_DENSITY_KG_M3 * speeds_mps**2
    flap_rad = np.linspace(layout["low"][flap], layout["high"][flap], N_FLAP)
    surfaces = aircraft.surfaces[layout["main"][PITCH]], aircraft.surfaces[flap]
    mass_kg = declared.mass.mass_kg
    scale = tuple(declared.scale.items())
    elevator = elevator_needed(aircraft, surfaces, mass_kg, scale, tuple(qdyn_pa), tuple(flap_rad))
    fill(
        holding, qdyn=qdyn_pa, flap=flap_rad, has_table=np.isfinite(elevator).all(), elevator=elevator,
        max_airspeed_rate_mps2=MAX_AIRSPEED_RATE_MPS2, flap_reserve=radians(FLAP_RESERVE_DEG),
    )  # fmt: skip
