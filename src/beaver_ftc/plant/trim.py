"""Trim: steady straight flight with wings level, solved on the accelerations of JSBSim's aircraft.

Sideslip, aileron and rudder balance the side force and the moments of the propeller [FDC]. Unknowns: alpha,
beta, theta and the surfaces that lead the axes; without a rudder, also bank. Equations: the six body
accelerations of JSBSim are zero, with its rotating Earth, gravity and atmosphere.

A full start costs nine JSBSim frames, and Newton's method needs two dozen of them. An aircraft without
engines is therefore first brought near by Broyden's method: differences give the Jacobian once, and each step
corrects it [Broyden1965, the first method]. A quick evaluation (`look`) repeats only the part of a start that
changes. In it the side force due to betadot is that of the evaluation before: this error vanishes with the
steps. Newton's method on full starts ends the search.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import asin, cos, degrees, isfinite, sin
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Travel, main_surface_index_by_axis
from beaver_ftc.aircraft.schema import SIDESLIP_RATE
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant.adapter import FT_PER_M, PA_PER_PSF, FlightState, Plant

ACCELERATIONS = (
    *((f"accelerations/{axis}dot-ft_sec2", 1.0 / FT_PER_M) for axis in "uvw"),
    *((f"accelerations/{axis}dot-rad_sec2", 1.0) for axis in "pqr"),
)
STEP_RAD = 1e-5  # for differences
MAX_CHANGE_RAD = 0.2  # a longer step leaves the region its Jacobian describes
_GOAL = 1e-11  # m/s2 and rad/s2: rounding leaves a tenth of it
_MAX_STEPS = 15  # of Broyden's method
_RATES_AND_FLOW = ("ic/u-fps", "ic/v-fps", "ic/w-fps")
TOLERANCE = 1e-9  # m/s2 and rad/s2, in each of the six accelerations
ROUNDED = 1e-8  # the same where no step brings less: rounding of an airship, whose lift and weight are large

_ALPHA_LIMIT_RAD = 0.6  # beyond it an aircraft has departed, so it cannot be trimmed there
_MAX_ITERATIONS = 40
_ALPHA_GUESS_RAD = 0.05  # where the file has no forces
_LIFTED_TRAVEL_RAD = 10.0
_NO_DEFLECTION_RAD = 1.6  # square to the air
_FLOW_UNKNOWNS = ("alpha_rad", "beta_rad", "theta_rad")

Vector = np.ndarray
Look = Callable[[Vector], Vector]


@dataclass(frozen=True, init=False)
class TrimPoint(FlightState):
    """A flight condition in trim. Its attributes are the states, `<surface>_rad` and the engine settings.

    - `gamma_rad`: flight path angle, rad, positive in a climb.
    - `residual`: the six accelerations that remain in trim: (udot, vdot, wdot) m/s² and (pdot, qdot, rdot)
      rad/s².
    - `envelope_valid`: True inside the validated envelope.
    """

    gamma_rad: float = 0.0
    residual: tuple[float, ...] = ()
    envelope_valid: bool = True


def trim(airspeed_mps: float, altitude_m: float, plant: Plant | None = None, **given: float) -> TrimPoint:
    """Trim in steady straight flight, wings level; the flight-path angle is what the engine gives.

    plant: the aircraft to trim, with its uncertainties set and no failure; it is left somewhere near the
    trim point, so start it afterwards. Without one, the nominal built-in aircraft. given: `<surface>_rad` of
    surfaces that do not lead an axis, and engine settings. Raises BadInput, naming what is wrong and what
    is allowed, if there is no such flight.
    """
    truth = plant or Plant(rate_hz=100)
    aircraft = truth.aircraft
    named: dict[str, Any] = dict(given)  # by the aircraft's own names, which FlightState checks
    wanted = FlightState(airspeed_mps, altitude_m, aircraft=aircraft, **named)
    _check_request(wanted, aircraft)
    truth.forget_conditions()  # of what was flown before, which would show in the last bits
    with _travel_lifted(truth) as travel:
        for surface in aircraft.left_by_trim:
            allowed = travel[surface].min_rad, travel[surface].max_rad
            _check(surface, wanted.surfaces_rad[surface], allowed, "rad")
        solution, residual = _solve(truth, _first_guess(wanted, truth))
        _check_solution(solution, travel, aircraft)
        valid = truth.read("aero/envelope-valid") == 1.0
    return TrimPoint.of(
        solution,
        gamma_rad=_climb_angle(solution),
        residual=tuple(float(a) for a in residual),
        envelope_valid=valid,
    )


@contextmanager
def _travel_lifted(truth: Plant) -> Iterator[dict[str, Travel]]:
    """Let the solver move the surfaces freely, so that a trim beyond their travel is found and named."""
    ends = ("min", "max")
    names = {s: [f"actuators/{s}/position-{end}-rad" for end in ends] for s in truth.aircraft.surfaces}
    travel = {surface: Travel(*map(truth.read, names[surface])) for surface in names}
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


def _check_request(wanted: FlightState, aircraft: Aircraft) -> None:
    for name, setting in aircraft.engine.settings.items():
        _check(setting.says or name, wanted.settings[name], setting.range, setting.unit)
    if not (isfinite(wanted.airspeed_mps) and wanted.airspeed_mps > 0 and isfinite(wanted.altitude_m)):
        raise BadInput(
            f"cannot trim at {wanted.airspeed_mps:g} m/s and {wanted.altitude_m:g} m, "
            "allowed: a positive airspeed and a finite altitude"
        )


def _first_guess(wanted: FlightState, truth: Plant) -> FlightState:
    """Lift balances weight and the pitching moment vanishes, in straight flight along the body axis."""
    aircraft = truth.aircraft
    truth.start(wanted)
    for name, limit in aircraft.engine.limits.items():
        _check(limit.says or name, truth.read(limit.property), limit.range, limit.unit)
    of = dict.fromkeys((*aircraft.signal_names, SIDESLIP_RATE), 0.0)
    of |= {name: truth.read(signal.property) for name, signal in aircraft.signals.items()}
    of |= wanted.surfaces_rad
    alpha = _alpha_for_lift(aircraft, of, truth) if aircraft.forces else _ALPHA_GUESS_RAD
    pitch = aircraft.surfaces[main_surface_index_by_axis(aircraft)[1]]
    at_zero = aircraft.coefficient("Cm", of | {"alpha": alpha, pitch: 0.0})
    per_rad = aircraft.coefficient("Cm", of | {"alpha": alpha, pitch: 1.0}) - at_zero
    travel = aircraft.travel[pitch]
    # a coefficient beyond all measure leaves no slope beside it: the search then says that there is no trim
    balancing_rad = -at_zero / per_rad if per_rad else 0.0
    deflection: Any = max(travel.min_rad, min(travel.max_rad, balancing_rad))
    return replace(wanted, alpha_rad=alpha, theta_rad=alpha, **{f"{pitch}_rad": deflection})


def _alpha_for_lift(aircraft: Aircraft, of: dict[str, float], truth: Plant) -> float:
    """The angle of attack at which the lift of the linear terms is the weight, rad."""
    weight = aircraft.mass.mass_kg * truth.read("accelerations/gravity-ft_sec2") / FT_PER_M
    lift = weight / (truth.read("aero/qbar-psf") * PA_PER_PSF * aircraft.geometry.wing_area_m2)
    at_zero = aircraft.coefficient("CZ", of)
    slope = (aircraft.coefficient("CZ", of | {"alpha": STEP_RAD}) - at_zero) / STEP_RAD
    if not slope:
        return _ALPHA_GUESS_RAD
    return max(-_ALPHA_LIMIT_RAD, min(_ALPHA_LIMIT_RAD, -(lift + at_zero) / slope))


def _jacobian(look: Look, x: Vector, here: Vector) -> Vector:
    """d accelerations / d unknowns, (6, unknowns), at x, where they are `here`: by forward differences."""
    return np.column_stack([(look(x + step) - here) / STEP_RAD for step in STEP_RAD * np.eye(x.size)])


def _solve(truth: Plant, state: FlightState) -> tuple[FlightState, np.ndarray]:
    """Broyden's method on quick looks at the truth, then Newton's on full starts until these agree.

    Returns the state, left in `truth`, and its accelerations.
    """
    together = truth.aircraft.together
    unknowns = _unknowns(truth.aircraft)
    names = (*unknowns, *(f"{surface}_rad" for surface in together))
    x, n = np.array([getattr(state, name) for name in names]), len(unknowns)

    def state_at(x: Vector) -> FlightState:
        placed, led = x[:n].tolist(), zip(x[n:].tolist(), together.values(), strict=True)
        moved = {f"{name}_rad": share * rad for rad, of in led for name, share in of}
        return replace(state, **dict(zip(unknowns, placed, strict=True)), **moved)

    def look(x: Vector) -> Vector:
        truth.start(state_at(x))
        return np.array([truth.read(name) * factor for name, factor in ACCELERATIONS])

    if not truth.n_engines:
        near = _approach(_looking(truth, state), x)
        if np.isfinite(near).all():
            x = x + (near - x)  # which is not `near` to the last bit
    here = look(x)
    for _ in range(_MAX_ITERATIONS):
        if np.abs(here).max() <= TOLERANCE:
            return state_at(x), here
        if not np.isfinite(here).all():
            break
        x = x + _shortened(_newton_step(_jacobian(look, x, here), here))
        here = look(x)
    if np.abs(here).max() <= ROUNDED:
        return state_at(x), here
    raise _not_flown(state_at(x), _left_over(here), truth.aircraft)


def _unknowns(aircraft: Aircraft) -> tuple[str, ...]:
    """The angles that trim finds: what no surface turns about an axis, a little bank does."""
    return _FLOW_UNKNOWNS if len(aircraft.together) >= len(AXES) else (*_FLOW_UNKNOWNS, "phi_rad")


def _approach(look: Look, x: Vector) -> Vector:
    """Values of the unknowns, from x, at which the accelerations nearly vanish, (unknowns,) rad.

    What comes out is not finite, or not near, where there is no such flight.
    """
    here = look(x)
    J = _jacobian(look, x, here)
    for _ in range(_MAX_STEPS):
        if not np.abs(here).max() > _GOAL:
            break
        step = _shortened(_newton_step(J, here))
        x = x + step
        there = look(x)
        J += np.outer(there - here - J @ step, step) / (step @ step)
        here = there
    return x


def _newton_step(J: Vector, here: Vector) -> Vector:
    """The step that takes `here` (6,) to zero in the least-squares sense; NaN where that is not finite."""
    if not isfinite(J.sum() + here.sum()):
        return np.full(J.shape[1], np.nan)
    try:
        return np.linalg.solve(J, -here)
    except np.linalg.LinAlgError:  # singular, or other than six unknowns
        return np.linalg.lstsq(J, -here, rcond=None)[0]


def _shortened(step: Vector) -> Vector:
    """At most MAX_CHANGE_RAD in each unknown."""
    return step * min(1.0, MAX_CHANGE_RAD / max(np.abs(step).max(), STEP_RAD))


def _looking(truth: Plant, state: FlightState) -> Look:
    """The six accelerations, m/s2 and rad/s2, as a function of the unknowns of a state at which the truth has
    been started: alpha, beta, theta, then the surfaces that lead."""
    fdm, speed_fps = truth.fdm, state.airspeed_mps * FT_PER_M
    attitude = "ic/theta-rad", *["ic/phi-rad"] * ("phi_rad" in _unknowns(truth.aircraft))
    turned, flow = ([truth.input(name) for name in of] for of in (attitude, _RATES_AND_FLOW))
    led = [(k, name, share) for k, of in enumerate(truth.aircraft.together.values()) for name, share in of]
    surfaces = [truth.input(truth.aircraft.surface[name].command) for _, name, _ in led]
    puts = [node.set_double_value for node in (*turned, *flow, *surfaces)]
    gets = [truth.node(name).get_double_value for name, _ in ACCELERATIONS]
    factors = np.array([factor for _, factor in ACCELERATIONS])

    def look(x: Vector) -> Vector:
        alpha, beta, *angles = x[: 2 + len(turned)].tolist()
        deflections = x[2 + len(turned) :].tolist()
        along = speed_fps * cos(beta)
        flow_fps = along * cos(alpha), speed_fps * sin(beta), along * sin(alpha)
        moved = [share * deflections[k] for k, _, share in led]
        for put, value in zip(puts, (*angles, *flow_fps, *moved), strict=True):
            put(value)
        if not fdm.run_ic():
            raise SimulationFailed("JSBSim cannot initialise the flight")
        return np.array([get() for get in gets]) * factors

    return look


def _not_flown(state: FlightState, why: str, aircraft: Aircraft) -> BadInput:
    low, high = aircraft.envelope.airspeed_mps
    return BadInput(
        f"no steady straight flight at {state.airspeed_mps:g} m/s, {state.altitude_m:g} m with this engine "
        f"and surface setting{why}, allowed: an airspeed at which the wing carries the aircraft "
        f"(validated: {low:g} to {high:g})"
    )


def _left_over(accelerations: np.ndarray) -> str:
    """What keeps the aircraft from flying steadily: the largest of the six accelerations that are left."""
    if not np.isfinite(accelerations).all():
        return " (its accelerations are not finite)"
    says = "forward", "to the right", "downward", "in roll", "in pitch", "in yaw"
    worst = int(np.abs(accelerations).argmax())
    unit = "m/s2" if worst < 3 else "rad/s2"
    return f" ({accelerations[worst]:.2g} {unit} {says[worst]} cannot be balanced)"


def _check_solution(solution: FlightState, travel: dict[str, Travel], aircraft: Aircraft) -> None:
    for surface, needed in solution.surfaces_rad.items():
        allowed = travel[surface]
        stops = f"{degrees(allowed.min_rad):.1f} to {degrees(allowed.max_rad):.1f} deg"
        if abs(needed) > _NO_DEFLECTION_RAD:  # a root of the equations, but nothing that flies
            raise _not_flown(solution, f" (no {surface} within its travel, {stops}, balances it)", aircraft)
        if not allowed.min_rad <= needed <= allowed.max_rad:
            raise BadInput(
                f"trim at {solution.airspeed_mps:g} m/s and {solution.altitude_m:g} m needs {surface} "
                f"{degrees(needed):.1f} deg, allowed: {stops}, its travel"
            )
    _check("angle of attack in trim", solution.alpha_rad, (-_ALPHA_LIMIT_RAD, _ALPHA_LIMIT_RAD), "rad")


def _climb_angle(state: FlightState) -> float:
    """Flight-path angle: the velocity's vertical part over its length, rad."""
    a, b, theta, phi = state.alpha_rad, state.beta_rad, state.theta_rad, state.phi_rad
    along = cos(b) * (cos(a) * sin(theta) - sin(a) * cos(phi) * cos(theta))
    return asin(along - sin(b) * sin(phi) * cos(theta))
