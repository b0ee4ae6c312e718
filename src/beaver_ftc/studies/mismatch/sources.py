"""The sources of mismatch: what each adds to truth minus design, (n, 3) rad/s2.

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

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, EARTH_RATE_RAD_S
from beaver_ftc.compiled import kernel
from beaver_ftc.design.fdc import SURFACES, TRAVEL
from beaver_ftc.design.model import (
    InertiaCoefficients,
    acceleration_at,
    anchor,
    design_of,
    design_record,
    inertia_of,
    inertial,
    responses_at,
    unanticipated_at,
)
from beaver_ftc.plant.adapter import START_LATITUDE_DEG
from beaver_ftc.plant.conditions import known_trim
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.faults import UNANTICIPATED, place_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import grown_share, is_before, is_in_force
from beaver_ftc.studies.mismatch.states import States

SOURCES = (
    "sensors", "actuators", "fault", "simplification", "engine", "coefficients", "inertia",
    "inertia_coupling", "sinusoids", "wind_turbulence", "earth_rotation", "integration",
)  # fmt: skip
LOSS = "loss_of_effectiveness"
ENGINE_TERMS = tuple(term.name for term in load().moments if "dpt" in dict(term.of))
Contributions = dict[str, np.ndarray]
"""Angular acceleration (n, 3) rad/s2 by source, or by part of a source."""
Parts = Iterator[tuple[Any, np.ndarray]]
"""Each fault of a surface, and its part of the deflection (n,) rad."""


def healthy_positions(scenario: Scenario, commands: np.ndarray) -> np.ndarray:
    """Positions (n, 4) rad of a scenario's healthy actuators at rows with these commands (n, 4) rad."""
    dt = 1.0 / (scenario.rate_hz * scenario.substeps)
    share, reach, band, low, high = np.array([_servo(scenario, surface, dt) for surface in SURFACES]).T
    positions = np.empty_like(commands)
    _follow(commands, share, reach, band, low, high, scenario.substeps, positions)
    return positions


def _servo(scenario: Scenario, surface: str, dt: float) -> tuple[float, ...]:
    """The servo of a surface in a JSBSim frame: share of the way, reach, dead band and stops, rad."""
    servo = getattr(scenario.actuators, surface)
    off = getattr(scenario.uncertainty.actuators, surface)
    bandwidth = servo.bandwidth_rad_s * off.bandwidth
    rate = servo.rate_limit_deg_s * off.rate_limit
    stops = TRAVEL[surface].min_rad, TRAVEL[surface].max_rad
    if servo.travel_deg is not None:
        stops = radians(servo.travel_deg[0]), radians(servo.travel_deg[1])
    share = 1.0 - exp(-bandwidth * dt) if bandwidth else 1.0
    reach = radians(rate) * dt if rate else inf
    return share, reach, radians(off.dead_band_deg), *stops


@kernel
def _follow(commands, share, reach, band, low, high, runs, positions):
    """Fill positions (n, 4) rad with a, as the head of the file says, `runs` JSBSim frames a row.

    commands (n, 4) rad. Of each surface (4,): share w of the way that is left; rad: reach rate * dt, dead
    band to each side, and stops low and high.
    """
    at = np.minimum(np.maximum(commands[0], low), high)
    ideal = (share == 1.0) & (reach == np.inf) & (band == 0.0)
    for k in range(commands.shape[0]):
        demand = np.minimum(np.maximum(commands[k], low), high)
        for _ in range(runs):
            e = demand - at
            e -= np.minimum(np.maximum(e, -band), band)
            way = np.minimum(np.maximum(share * e, -reach), reach)
            at = np.where(ideal, demand, np.minimum(np.maximum(at + way, low), high))
        positions[k] = at


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
    """The part of the angular acceleration that comes from the Earth's rotation, (n, 3) rad/s2."""
    W = earth_in_body(attitude, latitude)
    inertial_rate = x + W
    return inertial(inertia, inertial_rate) - inertial(inertia, x) + np.cross(inertial_rate, W)


class Models:
    """The moment models of a flight, from the one in use to the truth, each with one error less.

    design: in use, tied to the trim where it is linearised or frozen. untied: without that. whole: with the
    engine's terms, as in the table. turning: with the truth's coefficients. truth: with its inertia as well.
    parts: `whole` with one of the truth's coefficients that differ, by name.
    """

    def __init__(self, scenario: Scenario) -> None:
        model = scenario.design_model
        true = scenario.uncertainty.coefficients
        self.scenario = scenario
        declared = Declared.of(scenario)
        self.design, mass = design_of(declared)[0], declared.mass
        anchor(self.design, *known_trim(declared))
        kept = {k: v for k, v in model.coefficients.items() if model.engine_terms or k not in ENGINE_TERMS}
        self.untied = design_record(scale=declared.scale, mass=mass)[0]
        self.whole, self.turning = (design_record(scale=scale, mass=mass)[0] for scale in (kept, true))
        self.truth = design_record(scale=true)[0]
        self.inertia = inertia_of(self.truth)
        self.parts = {
            term.name: design_record(scale=kept | {term.name: true.get(term.name, 1.0)}, mass=mass)[0]
            for term in load().moments
            if true.get(term.name, 1.0) != kept.get(term.name, 1.0)
        }


def fault_effects(m: Models, states: States, G: np.ndarray, healthy: np.ndarray) -> Contributions:
    """The angular acceleration (n, 3) rad/s2 of each fault of a surface, weighed with G (n, 3, 4); healthy
    (n, 4) rad is where they found the surfaces."""
    effects: Contributions = {}
    for s, surface in enumerate(SURFACES):
        here = [fault for fault in m.scenario.faults if getattr(fault, "actuator", "") == surface]
        position = states.position[:, s]
        moved = *_lost(here, states, position), *_displaced(here, states.t_s, position - healthy[:, s])
        for fault, by_rad in moved:
            name = name_of(fault)
            effects[name] = effects.get(name, 0.0) + G[:, :, s] * by_rad[:, None]
    return effects


def unanticipated_effects(m: Models, states: States) -> Contributions:
    """The angular acceleration (n, 3) rad/s2 of each unanticipated fault: a pitching moment."""
    effects: Contributions = {}
    for fault in m.scenario.faults:
        if fault.type == UNANTICIPATED:
            extra: Any = fault
            pitch = unanticipated_at(m.design, states.y, extra.Cm_alpha3 * share(fault, states.t_s))
            effects[name_of(fault)] = np.outer(pitch, (0.0, 1.0, 0.0))
    return effects


def name_of(fault: Any) -> str:
    """A name of a fault's own: surface, type and time."""
    place = "" if place_of(fault) == fault.type else f"{place_of(fault)} "
    return f"{place}{fault.type.replace('_', ' ')} at {fault.at_s:g} s"


def share(fault: Any, t_s: np.ndarray) -> np.ndarray:
    """B(t - T0) (n,): how far a fault has grown, 0 where it is not there."""
    grown = np.array([grown_share(fault, t) for t in t_s])
    return np.where(is_in_force(fault, t_s), grown, 0.0)


def _lost(faults: list, states: States, position: np.ndarray) -> Parts:
    """The part of the effective deflection that each loss takes, (n,) rad, after those before it."""
    remaining = np.ones_like(position)
    for fault in faults:
        if fault.type == LOSS:
            taken = remaining * fault.magnitude * share(fault, states.t_s)
            remaining = remaining - taken
            yield fault, -taken * position


def _displaced(faults: list, t_s: np.ndarray, way: np.ndarray) -> Parts:
    """The way of the surface, (n,) rad, by the other fault that moves it: the one that struck last, also if
    its effect remains after a repair."""
    order = sorted((fault for fault in faults if fault.type != LOSS), key=lambda fault: fault.at_s)
    struck = [~is_before(t_s, fault.at_s) for fault in order]
    there = [is_in_force(fault, t_s) for fault in order]
    owner = np.full(t_s.size, -1)
    for of in (struck, there):  # who is there now goes before who has been
        for i, mask in enumerate(of):
            owner[mask] = i
    for i, fault in enumerate(order):
        yield fault, np.where(owner == i, way, 0.0)


def inertia_coupling(m: Models, s: States) -> np.ndarray:
    """The declared relative errors of the rate products [Zhang2005, sec. VII]."""
    p, q, r = s.x.T
    theta = m.scenario.uncertainty.inertia_coupling
    of = m.inertia
    return np.column_stack([theta.p * of.Pqr * q * r, theta.q * of.Qpr * p * r, theta.r * of.Rpq * p * q])


def sinusoids(m: Models, s: States) -> np.ndarray:
    """The declared sinusoids [Zhang2005, sec. VII]."""
    declared = [getattr(m.scenario.uncertainty.sinusoid, axis) for axis in AXES]
    return np.column_stack([d.amplitude_rad_s2 * np.sin(d.frequency_rad_s * s.t_s) for d in declared])


def wind_turbulence(m: Models, s: States) -> np.ndarray:
    """The damping terms at the rates relative to the turning air, less the same at the body rates.

    Wind that does not turn reaches the moments only through alpha, beta and V, which are measured.
    """
    in_air, over_earth = (
        acceleration_at(m.truth, rates, s.y, s.effective) - inertial(m.inertia, rates)
        for rates in (s.x_air, s.x)
    )
    return in_air - over_earth


def earth(m: Models, s: States) -> np.ndarray:
    """The Earth's rotation on the flight's path; real gravity makes no moment about the centre of gravity."""
    latitude = radians(START_LATITUDE_DEG) + s.north_m / (EARTH_RADIUS_M + m.scenario.initial.altitude_m)
    return earth_rotation(m.inertia, s.x, s.attitude, latitude)


def instantaneous(m: Models, s: States) -> tuple[Contributions, dict[str, Contributions]]:
    """All sources but the integration at every frame, and the single faults and single coefficients."""
    healthy = healthy_positions(m.scenario, s.u)
    _, G = responses_at(m.design, s.x, s.y)
    moments = unanticipated_effects(m, s)
    faults = fault_effects(m, s, G, healthy) | moments
    nothing = np.zeros_like(s.x)
    measured = acceleration_at(m.design, s.x_measured, s.y_measured, s.u)
    tied, untied, whole, turning, truth = (
        acceleration_at(model, s.x, s.y, s.effective)
        for model in (m.design, m.untied, m.whole, m.turning, m.truth)
    )
    # the truth's inertia turns the extra moment of an unanticipated fault, too
    extra = sum(moments.values(), nothing) * (m.truth["Qm"] / m.design["Qm"] - 1.0)
    contributions = {
        "sensors": acceleration_at(m.design, s.x, s.y, s.u) - measured,
        "actuators": np.einsum("kas,ks->ka", G, healthy - s.u),
        "fault": sum(faults.values(), nothing),
        "simplification": untied - tied,
        "engine": whole - untied,
        "coefficients": turning - whole,
        "inertia": truth - turning + extra,
        "inertia_coupling": inertia_coupling(m, s),
        "sinusoids": sinusoids(m, s),
        "wind_turbulence": wind_turbulence(m, s),
        "earth_rotation": earth(m, s),
    }
    errors = {name: acceleration_at(one, s.x, s.y, s.effective) - whole for name, one in m.parts.items()}
    return contributions, {"fault": faults, "coefficients": errors}
