"""The sources of mismatch, each by its own formula: what it adds to truth minus design, (n, 3) rad/s2.

They are the steps from the design model, at what was measured and commanded, to the truth: each changes
one thing and leaves the rest as the steps before it left it, so that all of them together make the whole
difference.

    f + G u  at the measured state and the command
      sensors            at the true state
      actuators          with the surfaces where healthy actuators put them       weighed with the design's G
      fault              with the surfaces and moments as they are                weighed with the design's G
      simplification     not frozen, not linearised
      engine             with the engine terms
      coefficients       with the truth's coefficients, term by term
      inertia            with the truth's mass and inertia
      inertia_coupling   with the declared errors of Pqr, Qpr, Rpq
      sinusoids          with the declared sinusoids
      wind_turbulence    with the rates of the turning air in the damping terms
      earth_rotation     on a turning Earth
      integration        as JSBSim's integration moves the rates

Healthy actuators are driven by the logged command: what the surfaces would have done with no fault,

    a' = a + min(max(w e, -rate dt), rate dt),  w = 1 - exp(-bandwidth dt),  e = demand - a

every JSBSim frame of dt, within the stops; e without what the dead band takes of it. With neither lag, rate
limit nor dead band a is the demand. The command of a row was in force in all JSBSim frames that led to it; at
the start the actuator rests at its command.

A declared fault is weighed with the design's G, as in theory. A loss of effectiveness is what it takes from
the surface where the surface is: the product of all losses, taken one after the other. A fault of the
mechanism (jam, runaway, bias, ...) is the way from where the healthy actuator would be to where the surface
is; of several on one surface at once the latest to strike has it. The unanticipated one is its own moment.

Moments turn the body against inertial space; its rates are reported against the Earth. With w the
reported rates, W the Earth's rotation in body axes and w_i = w + W,

    wdot = J^-1 (M - w_i x J w_i) + w_i x W            [SL03, sec. 1.5]

The design model has J^-1 (M - w x J w): the difference is all that the Earth adds, and J enters by itself.
"""

from collections.abc import Iterator
from math import exp, inf, radians
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, EARTH_RATE_RAD_S
from beaver_ftc.compiled import kernel
from beaver_ftc.design.fdc import GEOMETRY, SURFACES, TRAVEL
from beaver_ftc.design.model import InertiaCoefficients, inertial
from beaver_ftc.plant.adapter import START_LATITUDE_DEG
from beaver_ftc.scenario.airframe import ActuatorDynamics
from beaver_ftc.scenario.faults import UNANTICIPATED, place_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import grown_share, is_before, is_in_force
from beaver_ftc.studies.mismatch.models import (
    ENGINE_TERMS,
    MOMENT_TERMS,
    RATES,
    DesignModelOfFlight,
    MomentModel,
    States,
    design_model_of_flight,
    quantities,
    term,
    true_moments,
)

SOURCES = (
    "sensors", "actuators", "fault", "simplification", "engine", "coefficients", "inertia",
    "inertia_coupling", "sinusoids", "wind_turbulence", "earth_rotation", "integration",
)  # fmt: skip
LOSS = "loss_of_effectiveness"
Contributions = dict[str, np.ndarray]


class HealthyActuators:
    """A scenario's actuators, before the first command: `follow` moves them on, some commands at a time."""

    def __init__(self, scenario: Scenario) -> None:
        dt = 1.0 / (scenario.rate_hz * scenario.substeps)
        each = [getattr(scenario.actuators, surface) for surface in SURFACES]
        off = [getattr(scenario.uncertainty.actuators, surface) for surface in SURFACES]
        bandwidths = [a.bandwidth_rad_s * b.bandwidth for a, b in zip(each, off, strict=True)]
        rates = [radians(a.rate_limit_deg_s * b.rate_limit) for a, b in zip(each, off, strict=True)]
        share = [1.0 - exp(-bandwidth * dt) if bandwidth else 1.0 for bandwidth in bandwidths]
        reach = [rate * dt if rate else inf for rate in rates]
        self._share, self._reach = np.array(share), np.array(reach)  # of the way, rad; in a JSBSim frame
        self._band = np.array([radians(one.dead_band_deg) for one in off])
        self._low, self._high = np.array([_stops(*both) for both in zip(SURFACES, each, strict=True)]).T
        self._runs = scenario.substeps
        self._at_rad: np.ndarray | None = None

    def follow(self, commands: np.ndarray) -> np.ndarray:
        """Positions (n, 4) rad at rows with these commands (n, 4) rad, following those given before."""
        if self._at_rad is None:
            self._at_rad = np.clip(commands[0], self._low, self._high)
        positions, stops = np.empty_like(commands), (self._low, self._high)
        moves = self._share, self._reach, self._band
        _follow(commands, *moves, *stops, self._runs, self._at_rad, positions)
        return positions


def _stops(surface: str, dynamics: ActuatorDynamics) -> tuple[float, float]:
    if dynamics.travel_deg is not None:
        return radians(dynamics.travel_deg[0]), radians(dynamics.travel_deg[1])
    return TRAVEL[surface].min_rad, TRAVEL[surface].max_rad


@kernel
def _follow(commands, share, reach, band, low, high, runs, at, positions):
    """Fill positions (n, 4) rad, `runs` JSBSim frames a row, and leave `at` (4,) rad at the last."""
    for k in range(commands.shape[0]):
        for s in range(4):
            demand = min(max(commands[k, s], low[s]), high[s])
            ideal = share[s] == 1.0 and reach[s] == np.inf and band[s] == 0.0
            for _ in range(runs):
                e = demand - at[s]
                e -= min(max(e, -band[s]), band[s])
                way = min(max(share[s] * e, -reach[s]), reach[s])
                at[s] = demand if ideal else min(max(at[s] + way, low[s]), high[s])
            positions[k, s] = at[s]


def earth_in_body(attitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """The Earth's rotation in body axes (n, 3) rad/s; attitude (n, 3) phi, theta, psi, latitude (n,), rad."""
    phi, theta, psi = attitude.T
    north, down = EARTH_RATE_RAD_S * np.cos(latitude), -EARTH_RATE_RAD_S * np.sin(latitude)
    ahead, right = north * np.cos(psi), -north * np.sin(psi)  # turned into the heading
    forward = ahead * np.cos(theta) - down * np.sin(theta)
    below = ahead * np.sin(theta) + down * np.cos(theta)
    return np.column_stack([
        forward, right * np.cos(phi) + below * np.sin(phi), below * np.cos(phi) - right * np.sin(phi)
    ])  # fmt: skip


def earth_rotation(
    inertia: InertiaCoefficients, x: np.ndarray, attitude: np.ndarray, latitude: np.ndarray
) -> np.ndarray:
    """What the Earth's rotation adds to the angular acceleration, (n, 3) rad/s2."""
    W = earth_in_body(attitude, latitude)
    inertial_rate = x + W
    return inertial(inertia, inertial_rate) - inertial(inertia, x) + np.cross(inertial_rate, W)


class Models:
    """Of a flight: the design model in use, the truth, and the actuators."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario, self.actuators = scenario, HealthyActuators(scenario)
        self.design_model, self.truth = design_model_of_flight(scenario), true_moments(scenario)


def fault_effects(m: Models, states: States, G: np.ndarray, healthy: np.ndarray) -> Contributions:
    """The angular acceleration (n, 3) rad/s2 of each fault, weighed with G (n, 3, 4); healthy (n, 4) rad is
    where they found the surfaces."""
    effects: Contributions = {}
    for s, surface in enumerate(SURFACES):
        here = [fault for fault in m.scenario.faults if getattr(fault, "actuator", "") == surface]
        position = states.position[:, s]
        moved = *_lost(here, states, position), *_displaced(here, states.t_s, position - healthy[:, s])
        for fault, by_rad in moved:
            name = name_of(fault)
            effects[name] = effects.get(name, 0.0) + G[:, :, s] * by_rad[:, None]
    for fault in m.scenario.faults:
        if fault.type == UNANTICIPATED:
            effects[name_of(fault)] = unanticipated(fault, m.design_model, states)
    return effects


def name_of(fault: Any) -> str:
    """A name of a fault's own: surface, type and time."""
    place = "" if place_of(fault) == fault.type else f"{place_of(fault)} "
    return f"{place}{fault.type.replace('_', ' ')} at {fault.at_s:g} s"


def share(fault: Any, t_s: np.ndarray) -> np.ndarray:
    """B(t - T0) (n,): how far a fault has grown, 0 where it is not there."""
    grown = np.array([grown_share(fault, t) for t in t_s])
    return np.where(is_in_force(fault, t_s), grown, 0.0)


def unanticipated(fault: Any, design_model: DesignModelOfFlight, states: States) -> np.ndarray:
    """The extra pitching moment on alpha^3 as an acceleration (n, 3) rad/s2 [Zhang2005]."""
    moment = states.y[:, 3] * GEOMETRY.wing_area_m2 * GEOMETRY.chord_m * states.y[:, 0] ** 3
    pitch = fault.Cm_alpha3 * share(fault, states.t_s) * design_model.moments.inertia.Qm * moment
    return np.column_stack([0.0 * pitch, pitch, 0.0 * pitch])


def _lost(faults: list, states: States, position: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
    """What each loss takes from the effective deflection, (n,) rad, of what those before it have left."""
    remaining = np.ones_like(position)
    for fault in faults:
        if fault.type == LOSS:
            taken = remaining * fault.magnitude * share(fault, states.t_s)
            remaining = remaining - taken
            yield fault, -taken * position


def _displaced(faults: list, t_s: np.ndarray, way: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
    """Which of the other faults moves the surface so far, (n,) rad: who struck last, also what lingers after
    a repair."""
    order = sorted((fault for fault in faults if fault.type != LOSS), key=lambda fault: fault.at_s)
    struck = [~is_before(t_s, fault.at_s) for fault in order]
    there = [is_in_force(fault, t_s) for fault in order]
    owner = np.full(t_s.size, -1)
    for of in (struck, there):  # who is there now goes before who has been
        for i, mask in enumerate(of):
            owner[mask] = i
    for i, fault in enumerate(order):
        yield fault, np.where(owner == i, way, 0.0)


def engine(m: Models, s: States) -> np.ndarray:
    """The slipstream's moments where the design model neglects them, with the table's coefficients."""
    if m.scenario.design_model.engine_terms:
        return np.zeros_like(s.x)
    table = {name: MOMENT_TERMS[name].value for name in ENGINE_TERMS}
    neglected = MomentModel(table, m.design_model.moments.inertia)
    return neglected.aerodynamic(s.x, s.y, s.effective, ENGINE_TERMS)


def coefficient_errors(m: Models, s: States) -> Contributions:
    """Each term whose coefficient differs between truth and design, neglected engine terms aside."""
    of = quantities(s.x, s.y, s.effective)
    neglected = () if m.scenario.design_model.engine_terms else ENGINE_TERMS
    designed = m.design_model.moments.coefficients | {name: MOMENT_TERMS[name].value for name in neglected}
    return {
        name: term(name, error, m.design_model.moments.inertia, of, s.y[:, 3])
        for name in MOMENT_TERMS
        if (error := m.truth.coefficients[name] - designed[name]) != 0.0
    }


def inertia(m: Models, s: States, extra_moment: np.ndarray) -> np.ndarray:
    """The truth's moments and rate products by the truth's inertia less by the designer's.

    extra_moment (n, 3) rad/s2: the pitching moment of unanticipated faults, as the designer's inertia
    weighs it.
    """
    true, designed = m.truth.inertia, m.design_model.moments.inertia
    if true == designed:
        return np.zeros_like(s.x)
    by_true, by_designed = (
        MomentModel(m.truth.coefficients, inertia).acceleration(s.x, s.y, s.effective)
        for inertia in (true, designed)
    )
    return by_true - by_designed + extra_moment * (true.Qm / designed.Qm - 1.0)


def inertia_coupling(m: Models, s: States) -> np.ndarray:
    """The declared relative errors of the rate products [Zhang2005, sec. VII]."""
    p, q, r = s.x.T
    theta, of = m.scenario.uncertainty.inertia_coupling, m.truth.inertia
    return np.column_stack([theta.p * of.Pqr * q * r, theta.q * of.Qpr * p * r, theta.r * of.Rpq * p * q])


def sinusoids(m: Models, s: States) -> np.ndarray:
    """The declared sinusoids [Zhang2005, sec. VII]."""
    declared = [getattr(m.scenario.uncertainty.sinusoid, axis) for axis in AXES]
    return np.column_stack([d.amplitude_rad_s2 * np.sin(d.frequency_rad_s * s.t_s) for d in declared])


def wind_turbulence(m: Models, s: States) -> np.ndarray:
    """The damping terms at the rates relative to the turning air, less the same at the body rates.

    Wind that does not turn reaches the moments only through alpha, beta and V, which are measured.
    """
    if np.array_equal(s.x_air, s.x):
        return np.zeros_like(s.x)
    names = [name for name, t in MOMENT_TERMS.items() if set(t.factors) & set(RATES)]
    in_air, over_earth = (m.truth.aerodynamic(rates, s.y, s.effective, names) for rates in (s.x_air, s.x))
    return in_air - over_earth


def earth(m: Models, s: States) -> np.ndarray:
    """The Earth's rotation on the flight's path; real gravity makes no moment about the centre of gravity."""
    latitude = radians(START_LATITUDE_DEG) + s.north_m / (EARTH_RADIUS_M + m.scenario.initial.altitude_m)
    return earth_rotation(m.truth.inertia, s.x, s.attitude, latitude)


def instantaneous(m: Models, s: States) -> tuple[Contributions, dict[str, Contributions]]:
    """All sources but the integration at every frame, and the single faults and single coefficients."""
    design_model, healthy = m.design_model, m.actuators.follow(s.u)
    G = design_model.effectiveness(s.y)
    faults, errors = fault_effects(m, s, G, healthy), coefficient_errors(m, s)
    nothing = np.zeros_like(s.x)
    extra = sum((effect for name, effect in faults.items() if name.startswith("unanticipated")), nothing)
    measured = design_model.acceleration(s.x_measured, s.y_measured, s.u)
    exact = design_model.moments.acceleration(s.x, s.y, s.effective)
    contributions = {
        "sensors": design_model.acceleration(s.x, s.y, s.u) - measured,
        "actuators": np.einsum("kas,ks->ka", G, healthy - s.u),
        "fault": sum(faults.values(), nothing),
        "simplification": exact - design_model.acceleration(s.x, s.y, s.effective),
        "engine": engine(m, s),
        "coefficients": sum(errors.values(), nothing),
        "inertia": inertia(m, s, extra),
        "inertia_coupling": inertia_coupling(m, s),
        "sinusoids": sinusoids(m, s),
        "wind_turbulence": wind_turbulence(m, s),
        "earth_rotation": earth(m, s),
    }
    return contributions, {"fault": faults, "coefficients": errors}


def integration(m: Models, s: States, following: States) -> np.ndarray:
    """How the rates moved over a frame less JSBSim's acceleration at its start; the design's likewise.

    The design model's mean over a frame is the diagnosis': over all its JSBSim frames. With one JSBSim frame
    a frame it is the sample at the start. following: the same frames, each one later.
    """
    moved = (following.x - s.x) * m.scenario.rate_hz - s.xdot
    sampled = m.design_model.acceleration(s.x_measured, s.y_measured, s.u)
    return moved - (following.design_mean - sampled)
