"""From a scenario's `autopilot` to the record its kernel flies by; and level flight of the design model, the
elevator it takes over dynamic pressure and flap.

    qdyn S CX = m g sin alpha,   qdyn S CZ + m g cos alpha = 0,   Cm = 0

in angle of attack, slipstream and elevator: wings level, no rates, no sideslip, the engine free. What the
elevator, or what is left of it, cannot give at a speed cannot be held there, whatever the law.
"""

from functools import lru_cache
from math import inf, nan, radians

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import GRAVITY_MPS2, THRUST_TERM
from beaver_ftc.control.autopilot import CHANNELS, GAINS, N_FLAP, N_QDYN, NOT_JUDGED
from beaver_ftc.control.engines import set_up_engine
from beaver_ftc.design.model import SEA_LEVEL_DENSITY_KG_M3
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.scenario.schema import Scenario

THRUST = "dpt"  # the signal that stands for the engine
STEP = 1e-30  # of a complex step
ITERATIONS, CLOSE = 12, 1e-9
STEEPEST_RAD, MOST_THRUST = 0.5, 3.0  # beyond, the polynomials have solutions that no aircraft flies
PER_FLAP, GUESS = -0.12, (0.1, 0.5, 0.0)  # alpha over flap, and alpha, slipstream, elevator without it
MOST_DEG_S = (12.0, 6.0, 10.0)  # asked of a healthy aircraft: a transport's manoeuvres
MOST_BANK_DEG = 30.0
STEEPEST_ALPHA_DEG = 15.0
SPARE_ALPHA_DEG = 1.0, 2.0  # at least and at most, below the highest at which the model is valid
SPARE_MPS, SPARE_SHARE = 2.0, 0.2  # above the validated airspeeds' end; at most this share of them
POWER_SIDESLIP_RAD = 0.2  # that full power may lead to with a rudder that is lost; 0.6 is a departure
# Of 0, 0.7, 1.5 and 3 deg kept of the flap at the end of the airspeeds that can be held, the one with which
# most jams were kept; and how fast a limit moves the command: about as fast as drag slows the aircraft down.
FLAP_RESERVE_DEG, PACE_MPS2 = 0.7, 1.0
LEAST_DIHEDRAL = 0.01  # of an aircraft that hardly rolls by sideslip: it is then not flown by it
_UNIT = dict(zip(CHANNELS, (1.0, 1.0, radians(1.0), radians(1.0)), strict=True))


def set_up_autopilot(autopilot: np.void, control: np.void, scenario: Scenario) -> None:
    """Fill the record (dtype AUTOPILOT); control: the law's, already assembled."""
    profile = scenario.autopilot
    if profile is None or not profile.channels:
        return
    autopilot["enabled"], autopilot["dt"] = 1, 1.0 / scenario.rate_hz
    set_up_profile(autopilot, scenario)
    autopilot["changed_at_s"], autopilot["worst"] = -inf, NOT_JUDGED
    autopilot["gain"] = tuple(_gains(scenario.airframe).values())
    autopilot["gravity"] = GRAVITY_MPS2
    _know(autopilot, scenario)
    less, more = (scenario.airframe.envelope.alpha_deg[1] - spare for spare in SPARE_ALPHA_DEG)
    autopilot["steepest_alpha"] = radians(min(less, max(STEEPEST_ALPHA_DEG, more)))
    autopilot["most"], autopilot["most_bank"] = np.radians(MOST_DEG_S), radians(MOST_BANK_DEG)
    for name in ("trim", "low", "high"):
        autopilot[f"{name}_power"] = control["power"]["config"][name]
    autopilot["allowed_power"] = control["power"]["config"]["high"]
    control["reference"]["config"]["steered"] = 1
    _know_what_holds(autopilot["holding"], control["layout"], scenario)


def _gains(aircraft: Aircraft) -> dict[str, float]:
    """The gains; those of the airspeed slower by what the engine lags, which its loop has beside its own."""
    thrust = aircraft.engine.thrust
    slower = 1.0 + (thrust.lag_s if thrust and aircraft.airspeed_by == "power" else 0.0) / GAINS["airspeed_s"]
    return GAINS | {"speed": GAINS["speed"] / slower, "speed_i": GAINS["speed_i"] / slower**2}


def set_up_profile(autopilot: np.void, scenario: Scenario) -> None:
    """Fill in the legs; in flight too, where those that have been begun are the same as before."""
    for c, (name, unit) in enumerate(_UNIT.items()):
        legs = getattr(scenario.autopilot, name)
        autopilot["legs"][c] = len(legs)
        for j, leg in enumerate(legs):
            autopilot["at_s"][c, j] = leg.at_s
            autopilot["value"][c, j] = nan if leg.value is None else leg.value * unit
            autopilot["speed"][c, j] = getattr(leg, "climb_mps", getattr(leg, "change_mps2", inf))


def _know(autopilot: np.void, scenario: Scenario) -> None:
    """What the loops take from the aircraft: thrust, roll by sideslip, slowest airspeed."""
    aircraft = scenario.airframe
    terms = {name: term.value for name, term in aircraft.terms.items()}
    mass_kg = aircraft.mass.mass_kg * scenario.design_model.mass
    per_mass = aircraft.geometry.wing_area_m2 / mass_kg
    autopilot["thrust"] = per_mass * np.array([terms.get(THRUST_TERM, 0.0), terms.get("CX_adpt2", 0.0)])
    autopilot["glides"] = aircraft.airspeed_by == "pitch"
    if aircraft.airspeed_by == "power" and THRUST_TERM not in terms:
        set_up_engine(autopilot["engine"], aircraft.engine.thrust, mass_kg)
    by_sideslip = terms.get("Cl_beta", 0.0) / terms.get("Cl_p", -1.0)
    autopilot["dihedral"] = max(by_sideslip, LEAST_DIHEDRAL) * 2.0 / aircraft.geometry.span_m
    autopilot["weathercock"] = inf
    if terms.get("Cn_dpt3"):
        beta = POWER_SIDESLIP_RAD
        held = terms.get("Cn_beta", 0.0) * beta + terms.get("Cn_beta3", 0.0) * beta**3
        autopilot["weathercock"] = max(held / abs(terms["Cn_dpt3"]), 0.0)
    slowest, fastest = aircraft.envelope.airspeed_mps
    autopilot["slowest_mps"] = slowest + min(SPARE_MPS, SPARE_SHARE * (fastest - slowest))


def _know_what_holds(holding: np.void, layout: np.void, scenario: Scenario) -> None:
    """The table of level flight, where the aircraft's file has forces and a flap for the elevator."""
    aircraft, flap = scenario.airframe, int(layout["stand_in"])
    holding["from_s"], holding["bank"], holding["fastest"] = -1.0, radians(MOST_BANK_DEG), inf
    if flap < 0 or not aircraft.forces or THRUST not in aircraft.signals:
        return
    speeds_mps = np.linspace(*aircraft.envelope.airspeed_mps, N_QDYN)
    holding["qdyn"] = 0.5 * SEA_LEVEL_DENSITY_KG_M3 * speeds_mps**2
    holding["flap"] = np.linspace(layout["low"][flap], layout["high"][flap], N_FLAP)
    surfaces = aircraft.surfaces[layout["main"][PITCH]], aircraft.surfaces[flap]
    model = scenario.design_model
    mass_kg, scale = aircraft.mass.mass_kg * model.mass, tuple(model.coefficients.items())
    qdyn_pa, flap_rad = tuple(holding["qdyn"]), tuple(holding["flap"])
    needed = elevator_needed(aircraft, surfaces, mass_kg, scale, qdyn_pa, flap_rad)
    holding["known"], holding["elevator"] = bool(np.isfinite(needed).all()), needed
    holding["pace"], holding["reserve"] = PACE_MPS2, radians(FLAP_RESERVE_DEG)


@lru_cache(maxsize=32)
def elevator_needed(
    aircraft: Aircraft,
    surfaces: tuple[str, str],
    mass_kg: float,
    scale: tuple[tuple[str, float], ...],
    qdyn_pa: tuple[float, ...],
    flap_rad: tuple[float, ...],
) -> np.ndarray:
    """Deflection (n, m) rad for level flight at qdyn (n,) and flap (m,); not a number where there is none.

    surfaces: elevator and flap of this aircraft. scale: what the designer multiplies single terms by.
    """
    q, flap = (values.ravel() for values in np.meshgrid(qdyn_pa, flap_rad, indexing="ij"))
    load = mass_kg * GRAVITY_MPS2 / (q * aircraft.geometry.wing_area_m2)
    neutral = {factor: 0.0 for term in aircraft.terms.values() for factor in term.factors}
    ratio = dict(scale)

    def imbalance(unknown: np.ndarray) -> np.ndarray:
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
