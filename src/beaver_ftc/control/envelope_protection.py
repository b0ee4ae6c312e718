"""Envelope protection: the airspeeds that can be held with the remaining authority of the surfaces.

Level flight of the design model takes an elevator that depends on dynamic pressure and flap
(`elevator_needed`):

    qdyn S CX = m g sin alpha,   qdyn S CZ + m g cos alpha = 0,   Cm = 0

in angle of attack, slipstream and elevator: wings level, no rates, no sideslip, the engine free. S m2: wing
area; m kg: mass; g m/s2: gravity. What acts like the elevator now, rad, is estimated from the balance of the
pitch moments (`average_acting_elevator`),

    acting = offset + left u + d / G

offset rad, left: the elevator's offset and remaining effectiveness; u rad: its position; d rad/s2: what the
law's observer finds unexplained; G rad/s2 per rad: its effectiveness in pitch. So a jam is known where it
stands before its type is. The speeds at which the flap, less a reserve to fly with, makes up for the rest
are those that can be held; the commanded airspeed is brought among them. A speed for which the elevator, or
what is left of it, does not suffice cannot be held by any law.
"""

from functools import lru_cache
from math import radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2
from beaver_ftc.compiled import fill, kernel, record, row_of
from beaver_ftc.control.allocation import within_stops
from beaver_ftc.control.profile import SPEED, clamp
from beaver_ftc.control.thrust import between
from beaver_ftc.design.engine import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.design.table import AIRSPEED, QDYN
from beaver_ftc.diagnosis.state import PITCH, ROLL, YAW
from beaver_ftc.scenario.declared import Declared

ACTING_S = 4.0  # time constant of the mean balance: gusts pitch within a second
HOLD_SETTLED_S = 0.5  # time of averaging before which no airspeed is limited
NOTED_MPS, NOTED_RAD = 0.5, 0.02  # A limit that changes the command by so much is in force.
MOST_BANK_DEG = 30.0  # of a healthy aircraft
# Of 0, 0.7, 1.5 and 3 deg kept of the flap at the end of the airspeeds that can be held, the one with which
# most jams were kept; and how fast a limit moves the command: about as fast as drag slows the aircraft down.
FLAP_RESERVE_DEG, MAX_AIRSPEED_RATE_MPS2 = 0.7, 1.0
THRUST = "dpt"  # the signal that stands for the engine
STEP = 1e-30  # of a complex step
ITERATIONS, CLOSE = 12, 1e-9  # of Newton's method; imbalance of a coefficient that counts as none
STEEPEST_RAD, MOST_THRUST = 0.5, 3.0  # beyond, the polynomials have solutions that no aircraft flies
PER_FLAP, GUESS = -0.12, (0.1, 0.5, 0.0)  # alpha over flap, and alpha, slipstream, elevator without it

FASTEST, SLOWEST, BANK_LIMIT = range(3)  # the limits
N_QDYN, N_FLAP = 12, 5
HOLDING = record(
    has_table=int, limits_airspeed=int, n_averaged_frames=int, flap_reserve=float,
    max_airspeed_rate_mps2=float,
    # rad: the elevator that level flight takes, over dynamic pressure, Pa, and flap, rad
    qdyn=N_QDYN, flap=N_FLAP, elevator=(N_QDYN, N_FLAP),
    # rad: what acts like the elevator, and what of it is commanded, smoothed
    mean_acting_elevator=float, mean_commanded_elevator=float,
    fastest=float, slowest=float,  # m/s, between which level flight can be held
    bank=float,  # rad: the bank limit, smoothed
    # of each limit whether it is in force now, since when, s, and its last value, m/s or rad
    in_force=(int, 3), from_s=3, value=3,
)  # fmt: skip


@kernel
def limit_airspeed_to_fly(autopilot, layout, surfaces, u, unexplained, y, t):
    """Set autopilot.airspeed_to_fly of this frame: the commanded airspeed where it can be held.

    u (n,) rad: where the surfaces are. unexplained rad: the elevator that would give what the law's observer
    finds in pitch.
    """
    hold, e, f = autopilot.holding, layout.main[PITCH], layout.stand_in
    hold.fastest, hold.slowest = np.inf, 0.0
    effectiveness = surfaces.output.effectiveness
    left = effectiveness[e]
    whole = left >= 1.0 and (f < 0 or effectiveness[f] >= 1.0)
    if whole or not hold.has_table:
        hold.n_averaged_frames = 0
    else:
        average_acting_elevator(hold, autopilot.dt, surfaces.output.offset[e], left * u[e], unexplained)
        if hold.n_averaged_frames * autopilot.dt > HOLD_SETTLED_S:
            find_airspeeds_that_can_be_held(hold, layout, surfaces, y)
    approach_airspeed_to_fly(autopilot)
    record_limits_in_force(autopilot, layout.main, effectiveness, t)


@kernel
def average_acting_elevator(hold, dt, offset, commanded, unexplained):
    """Average the elevator that would account for the pitch moments there are, acting = offset + commanded +
    unexplained, rad, over ACTING_S, at first over all frames alike: `offset` is how far it is off,
    `commanded` what its remaining effectiveness gives."""
    acting = offset + commanded + unexplained
    hold.n_averaged_frames += 1
    weight = max(dt / ACTING_S, 1.0 / hold.n_averaged_frames)
    hold.mean_acting_elevator += weight * (acting - hold.mean_acting_elevator)
    hold.mean_commanded_elevator += weight * (commanded - hold.mean_commanded_elevator)


@kernel
def find_airspeeds_that_can_be_held(hold, layout, surfaces, y):
    """Fill the fastest and the slowest airspeed that can be held, m/s.

    The flap may stand at one end of its travel, less the reserve. What acts like the elevator may then be

        fixed + left u,    u in its travel        fixed, rad: acts without a command; left: its effectiveness

    and the limits are V = sqrt(2 qdyn / rho), rho kg/m3: of the air, by readings. The flap up and the
    elevator's greatest give the fastest, the flap down and its least the slowest. A flap that is
    given up stands at its offset.
    """
    e, f = layout.main[PITCH], layout.stand_in
    elevator_left, flap_left = surfaces.output.effectiveness[e], surfaces.output.effectiveness[f]
    fixed = hold.mean_acting_elevator - hold.mean_commanded_elevator
    least, greatest = fixed + elevator_left * layout.low[e], fixed + elevator_left * layout.high[e]
    up, down = layout.low[f] + hold.flap_reserve, layout.high[f] - hold.flap_reserve
    if flap_left < surfaces.config.least_effectiveness:
        up = down = within_stops(layout, f, surfaces.output.offset[f])
    per_pa = 2.0 * y[QDYN] / y[AIRSPEED] ** 2
    hold.fastest = np.sqrt(2.0 * dynamic_pressure_limit(hold, up, greatest, FASTEST) / per_pa)
    hold.slowest = np.sqrt(2.0 * dynamic_pressure_limit(hold, down, least, SLOWEST) / per_pa)


@kernel
def dynamic_pressure_limit(hold, flap, elevator, limit):
    """The highest (limit FASTEST) or lowest (SLOWEST) dynamic pressure, Pa, of level flight with this flap
    and elevator, rad, by the table. Infinite or 0 if the table does not bound it."""
    before = between(flap, N_FLAP, hold.flap, row_of(hold.elevator, 0))
    if before > elevator:
        return hold.qdyn[0] if limit == FASTEST else 0.0
    for j in range(1, N_QDYN):
        after = between(flap, N_FLAP, hold.flap, row_of(hold.elevator, j))
        if after > elevator:
            part = (elevator - before) / (after - before)
            return hold.qdyn[j - 1] + part * (hold.qdyn[j] - hold.qdyn[j - 1])
        before = after
    return np.inf if limit == FASTEST else hold.qdyn[N_QDYN - 1]


@kernel
def approach_airspeed_to_fly(autopilot):
    """Bring the airspeed to fly towards the nearest to the commanded one that can be held, without a bump."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    wanted = min(max(command, hold.slowest), hold.fastest)
    if wanted == command and not hold.limits_airspeed:
        autopilot.airspeed_to_fly, autopilot.airspeed_to_fly_rate = command, autopilot.command_rate[SPEED]
        return
    step = clamp(wanted - autopilot.airspeed_to_fly, hold.max_airspeed_rate_mps2 * autopilot.dt)
    autopilot.airspeed_to_fly += step
    autopilot.airspeed_to_fly_rate = step / autopilot.dt
    hold.limits_airspeed = autopilot.airspeed_to_fly != command


@kernel
def record_limits_in_force(autopilot, main, effectiveness, t):
    """Note since when a limit is in force, and what it is at last; main (3,): who leads each axis."""
    hold, command = autopilot.holding, autopilot.command[SPEED]
    if autopilot.is_commanded[SPEED]:
        record_limit(hold, FASTEST, hold.fastest, hold.fastest < command - NOTED_MPS, t)
        record_limit(hold, SLOWEST, hold.slowest, hold.slowest > command + NOTED_MPS, t)
    if effectiveness[main[ROLL]] < 1.0 or effectiveness[main[YAW]] < 1.0:
        hold.bank += autopilot.dt / ACTING_S * (autopilot.bank_limit - hold.bank)
        record_limit(hold, BANK_LIMIT, hold.bank, hold.bank < autopilot.max_healthy_bank - NOTED_RAD, t)


@kernel
def record_limit(hold, kind, value, in_force, t):
    """Keep a limit that is in force now."""
    hold.in_force[kind] = in_force
    if in_force:
        if hold.from_s[kind] < 0.0:
            hold.from_s[kind] = t
        hold.value[kind] = value


def set_up_level_flight_table(holding: np.void, layout: np.void, declared: Declared) -> None:
    """The table of level flight, where the aircraft's file has forces and a flap for the elevator."""
    aircraft, flap = declared.aircraft, int(layout["stand_in"])
    fill(holding, from_s=-1.0, bank=radians(MOST_BANK_DEG), fastest=np.inf)
    if flap < 0 or not aircraft.forces or THRUST not in aircraft.signals:
        return
    speeds_mps = np.linspace(*aircraft.envelope.airspeed_mps, N_QDYN)
    qdyn_pa = 0.5 * SEA_LEVEL_DENSITY_KG_M3 * speeds_mps**2
    flap_rad = np.linspace(layout["low"][flap], layout["high"][flap], N_FLAP)
    surfaces = aircraft.surfaces[layout["main"][PITCH]], aircraft.surfaces[flap]
    mass_kg, scale = declared.mass.mass_kg, tuple(declared.scale.items())
    needed = elevator_needed(aircraft, surfaces, mass_kg, scale, tuple(qdyn_pa), tuple(flap_rad))
    fill(
        holding, qdyn=qdyn_pa, flap=flap_rad, has_table=np.isfinite(needed).all(), elevator=needed,
        max_airspeed_rate_mps2=MAX_AIRSPEED_RATE_MPS2, flap_reserve=radians(FLAP_RESERVE_DEG),
    )  # fmt: skip


@lru_cache(maxsize=32)
def elevator_needed(
    aircraft: Aircraft,
    surfaces: tuple[str, str],
    mass_kg: float,
    scale: tuple[tuple[str, float], ...],
    qdyn_pa: tuple[float, ...],
    flap_rad: tuple[float, ...],
) -> np.ndarray:
    """Deflection (n, m) rad for level flight at qdyn (n,) Pa and flap (m,) rad; not a number where there is
    none.

    Newton's method, z <- z - J^-1 F, for all n m points at once: z (n m, 3) = (alpha, slipstream, elevator),
    F = (CX - load sin alpha, CZ + load cos alpha, Cm), load = m g / (qdyn S), J = dF/dz by complex steps.

    surfaces: elevator and flap of this aircraft. scale: what the designer multiplies single terms by.
    """
    q, flap = (values.ravel() for values in np.meshgrid(qdyn_pa, flap_rad, indexing="ij"))
    load = mass_kg * GRAVITY_MPS2 / (q * aircraft.geometry.wing_area_m2)
    neutral = {factor: 0.0 for term in aircraft.terms.values() for factor in term.factors}
    ratio = dict(scale)

    def imbalance(unknown: np.ndarray) -> np.ndarray:
        """F (n m, 3) at z (n m, 3)."""
        alpha, thrust, elevator = unknown.T
        of = neutral | {"alpha": alpha, THRUST: thrust, surfaces[0]: elevator, surfaces[1]: flap}
        CX, CZ, Cm = (aircraft.coefficient(name, of, ratio) for name in ("CX", "CZ", "Cm"))
        return np.stack([CX - load * np.sin(alpha), CZ + load * np.cos(alpha), Cm], -1)

    unknown = np.tile(GUESS, (q.size, 1))
    unknown[:, 0] += PER_FLAP * flap
    for _ in range(ITERATIONS):
        slopes = [imbalance(unknown + 1j * STEP * e).imag / STEP for e in np.eye(3)]
        unknown = unknown - np.linalg.solve(np.stack(slopes, -1), imbalance(unknown)[..., None])[..., 0]
    solved = np.abs(imbalance(unknown)).max(axis=1) < CLOSE
    flyable = (np.abs(unknown[:, 0]) < STEEPEST_RAD) & (np.abs(unknown[:, 1]) < MOST_THRUST)
    return np.where(solved & flyable, unknown[:, 2], np.nan).reshape(len(qdyn_pa), len(flap_rad))
