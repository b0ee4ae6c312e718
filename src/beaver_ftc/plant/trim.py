"""Trim: steady straight flight with wings level, solved on the truth's own accelerations.

Wings level, the propeller's side force and moments are balanced by a little sideslip, aileron and rudder
[FDC]. Unknowns: alpha, beta, theta, aileron, elevator, rudder. Equations: JSBSim's six body accelerations
are zero, which absorbs everything the textbook leaves out (round rotating Earth, real gravity, standard
atmosphere).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from math import asin, cos, degrees, isfinite, sin

import numpy as np

from beaver_ftc.aircraft import Travel
from beaver_ftc.design.coefficients import GEOMETRY, MASS, SURFACES, TRAVEL, value
from beaver_ftc.errors import BadInput
from beaver_ftc.plant.adapter import FT_PER_M, PA_PER_PSF, Plant
from beaver_ftc.plant.state import FlightState

TOLERANCE = 1e-9  # m/s2 and rad/s2, in each of the six accelerations

# R-985 Wasp Junior: 450 hp for take-off at 2300 rpm and 36.5 inHg; below, idling.
ENGINE_RPM = (600.0, 2300.0)
MANIFOLD_PRESSURE_INHG = (10.0, 36.5)
# The chart fit [FDC] gives 333 kW at that rating, more in thin air. With the throttle closed the engine
# absorbs no more than its friction: 1.3 bar in 16.1 l at 2300 rpm is 40 kW.
ENGINE_POWER_KW = (-40.0, 400.0)

_ALPHA_LIMIT_RAD = 0.6  # beyond it an aircraft has departed, so it cannot be trimmed there
_MAX_ITERATIONS = 12
_STEP = 1e-5  # rad, for the Jacobian
_LIFTED_TRAVEL_RAD = 10.0
_MAX_CHANGE_RAD = 0.2  # a longer Newton step leaves the region its Jacobian describes
_UNKNOWNS = ("alpha_rad", "beta_rad", "theta_rad", "aileron_rad", "elevator_rad", "rudder_rad")
_ACCELERATIONS = (
    ("accelerations/udot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/vdot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/wdot-ft_sec2", 1.0 / FT_PER_M),
    ("accelerations/pdot-rad_sec2", 1.0),
    ("accelerations/qdot-rad_sec2", 1.0),
    ("accelerations/rdot-rad_sec2", 1.0),
)


@dataclass(frozen=True)
class TrimPoint(FlightState):
    """A trimmed flight condition.

    gamma_rad: flight-path angle, positive climbing. residual: the six accelerations left, (udot, vdot,
    wdot) m/s2 and (pdot, qdot, rdot) rad/s2. envelope_valid: inside the flight-validated envelope.
    """

    gamma_rad: float = 0.0
    residual: tuple[float, ...] = ()
    envelope_valid: bool = True


def trim(
    airspeed_mps: float,
    altitude_m: float,
    engine_rpm: float = 1800.0,
    manifold_pressure_inhg: float = 20.0,
    flap_rad: float = 0.0,
    plant: Plant | None = None,
) -> TrimPoint:
    """Trim the Beaver in steady straight flight, wings level; the flight-path angle is what the engine gives.

    plant: the aircraft to trim, with its uncertainties set and no failure; it is left somewhere near the
    trim point, so start it afterwards. Without one, the nominal aircraft. Raises BadInput, naming what is
    wrong and what is allowed, if there is no such flight.
    """
    wanted = FlightState(
        airspeed_mps=airspeed_mps,
        altitude_m=altitude_m,
        flap_rad=flap_rad,
        engine_rpm=engine_rpm,
        manifold_pressure_inhg=manifold_pressure_inhg,
    )
    _check_request(wanted)
    truth = plant or Plant(rate_hz=100)
    with _travel_lifted(truth) as travel:
        _check("flap", flap_rad, (travel["flap"].min_rad, travel["flap"].max_rad), "rad")
        solution, residual = _solve(truth, _first_guess(wanted, truth))
        _check_solution(solution, travel)
        valid = truth.read("aero/envelope-valid") == 1.0
    return TrimPoint(
        **asdict(solution),
        gamma_rad=_climb_angle(solution),
        residual=tuple(float(a) for a in residual),
        envelope_valid=valid,
    )


@contextmanager
def _travel_lifted(truth: Plant) -> Iterator[dict[str, Travel]]:
    """Let the solver move the surfaces freely, so that a trim beyond their travel is found and named."""
    ends = ("min", "max")
    names = {surface: [f"actuators/{surface}/position-{end}-rad" for end in ends] for surface in SURFACES}
    travel = {surface: Travel(*map(truth.read, names[surface])) for surface in SURFACES}
    try:
        for low, high in names.values():
            truth.write(low, -_LIFTED_TRAVEL_RAD)
            truth.write(high, _LIFTED_TRAVEL_RAD)
        yield travel
    finally:
        for surface, (low, high) in names.items():
            truth.write(low, travel[surface].min_rad)
            truth.write(high, travel[surface].max_rad)


def _check(what: str, given: float, allowed: tuple[float, float], unit: str) -> None:
    low, high = allowed
    if not low <= given <= high:
        raise BadInput(f"{what} is {given:g} {unit}, allowed: {low:g} to {high:g} {unit}")


def _check_request(wanted: FlightState) -> None:
    _check("engine speed", wanted.engine_rpm, ENGINE_RPM, "rpm")
    _check("manifold pressure", wanted.manifold_pressure_inhg, MANIFOLD_PRESSURE_INHG, "inHg")
    if not (isfinite(wanted.airspeed_mps) and wanted.airspeed_mps > 0 and isfinite(wanted.altitude_m)):
        raise BadInput(
            f"cannot trim at {wanted.airspeed_mps:g} m/s and {wanted.altitude_m:g} m, "
            "allowed: a positive airspeed and a finite altitude"
        )


def _first_guess(wanted: FlightState, truth: Plant) -> FlightState:
    """Lift balances weight and the pitching moment vanishes, in straight flight along the body axis."""
    truth.start(wanted)
    _check("engine power", truth.read("engine/power-kw"), ENGINE_POWER_KW, "kW")
    dpt, df = truth.read("aero/dpt"), wanted.flap_rad
    weight = MASS.mass_kg * truth.read("accelerations/gravity-ft_sec2") / FT_PER_M
    lift = weight / (truth.read("aero/qbar-psf") * PA_PER_PSF * GEOMETRY.wing_area_m2)
    at_zero = value("CZ_0") + value("CZ_df") * df + value("CZ_dpt") * dpt
    alpha = -(lift + at_zero) / (value("CZ_alpha") + value("CZ_dfa") * df)
    alpha = max(-_ALPHA_LIMIT_RAD, min(_ALPHA_LIMIT_RAD, alpha))
    pitching = value("Cm_0") + (value("Cm_alpha") + value("Cm_alpha2") * alpha) * alpha
    elevator = -(pitching + value("Cm_df") * df + value("Cm_dpt") * dpt) / value("Cm_de")
    elevator = max(TRAVEL["elevator"].min_rad, min(TRAVEL["elevator"].max_rad, elevator))
    return replace(wanted, alpha_rad=alpha, theta_rad=alpha, elevator_rad=elevator)


def _accelerations(truth: Plant, state: FlightState) -> np.ndarray:
    """Start the truth at a state and read its six accelerations, m/s2 and rad/s2."""
    truth.start(state)
    return np.array([truth.read(name) * factor for name, factor in _ACCELERATIONS])


def _moved(state: FlightState, step: np.ndarray) -> FlightState:
    return replace(
        state, **{name: getattr(state, name) + float(dx) for name, dx in zip(_UNKNOWNS, step, strict=True)}
    )


def _jacobian(truth: Plant, state: FlightState, here: np.ndarray) -> np.ndarray:
    """d accelerations / d unknowns, (6, 6), by forward differences."""
    columns = [(_accelerations(truth, _moved(state, step)) - here) / _STEP for step in _STEP * np.eye(6)]
    return np.column_stack(columns)


def _solve(truth: Plant, state: FlightState) -> tuple[FlightState, np.ndarray]:
    """Newton's method on the truth. Returns the state, left in `truth`, and its accelerations."""
    here = _accelerations(truth, state)
    for _ in range(_MAX_ITERATIONS):
        if np.abs(here).max() <= TOLERANCE:
            return state, here
        if not np.isfinite(here).all():
            break
        step = np.linalg.lstsq(_jacobian(truth, state, here), -here, rcond=None)[0]
        step *= min(1.0, _MAX_CHANGE_RAD / np.abs(step).max())
        state = _moved(state, step)
        here = _accelerations(truth, state)
    raise BadInput(
        f"no steady straight flight at {state.airspeed_mps:g} m/s, {state.altitude_m:g} m with this engine "
        "and flap setting, allowed: an airspeed at which the wing carries the aircraft (validated: 30 to 55)"
    )


def _check_solution(solution: FlightState, travel: dict[str, Travel]) -> None:
    for surface in SURFACES:
        needed, allowed = getattr(solution, f"{surface}_rad"), travel[surface]
        if not allowed.min_rad <= needed <= allowed.max_rad:
            raise BadInput(
                f"trim at {solution.airspeed_mps:g} m/s and {solution.altitude_m:g} m needs {surface} "
                f"{degrees(needed):.1f} deg, allowed: {degrees(allowed.min_rad):.1f} to "
                f"{degrees(allowed.max_rad):.1f} deg, its travel"
            )
    _check("angle of attack in trim", solution.alpha_rad, (-_ALPHA_LIMIT_RAD, _ALPHA_LIMIT_RAD), "rad")


def _climb_angle(state: FlightState) -> float:
    """Flight-path angle with wings level: the velocity's vertical part over its length, rad."""
    a, b, theta = state.alpha_rad, state.beta_rad, state.theta_rad
    return asin(cos(b) * (cos(a) * sin(theta) - sin(a) * cos(theta)))
