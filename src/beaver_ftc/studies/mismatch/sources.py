"""The sources of mismatch: the part of each in truth less design, (n, 3) rad/s2.

The sources are steps from the design model, at the measured state and the command, to the truth. Each step
changes one thing and keeps the changes of the steps before it, so that their sum is the whole difference.

    f + G u  at the measured state and the command
      sensors            at the true state
      actuators          with the surfaces where healthy actuators put them       weighed with the design's G
      fault              with the surfaces and moments as they are                weighed with the design's G
      simplification     not frozen, not linearised
      engine             with the engine terms
      coefficients       with the truth's coefficients, term by term
      inertia            with the true inertia and centre of gravity
      inertia_coupling   with the declared errors of Pqr, Qpr, Rpq
      sinusoids          with the declared sinusoids
      wind_turbulence    with the rates of the turning air in the damping terms
      earth_rotation     on a turning Earth
      integration        as JSBSim's integration moves the rates

The effects of faults are computed with G of the design, as in the theory:

    loss of effectiveness   the lost share of the position; of several losses, each takes its share of the
                            effectiveness that those before it in the scenario leave
    mechanism (jam, ...)    position of the surface less that of the healthy actuator; of several faults on
                            one surface, the fault that began last has all of it
    unanticipated           its own pitching moment

Moments change the rates relative to inertial space, but rates are reported relative to the Earth. With the
reported rates w, the rotation W of the Earth in body axes and w_i = w + W, all (3,) rad/s,

    wdot = J^-1 (M - w_i x J w_i) + w_i x W            [SL03, sec. 1.5]

The design model has J^-1 (M - w x J w). The difference is the source `earth_rotation`.

A centre of gravity at c (m) from that of the aircraft file, with the aerodynamic force F (N), both (3,) along
the body axes, adds the moment F x c (N m).
"""

from collections.abc import Iterator
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, EARTH_RATE_RAD_S
from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.design.model import (
    InertiaCoefficients,
    acceleration_at,
    design_of,
    design_record,
    inertia_coefficients,
    inertia_of,
    responses_at,
)
from beaver_ftc.design.plain_model import anchor, inertial, unanticipated_at
from beaver_ftc.plant.adapter import START_LATITUDE_DEG
from beaver_ftc.plant.conditions import known_trim
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.faults import UNANTICIPATED, place_of
from beaver_ftc.scenario.instants import grown_share, is_before, is_in_force
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.mismatch.actuators import healthy_positions
from beaver_ftc.studies.mismatch.states import States

SOURCES = (  # in the order of the steps
    "sensors", "actuators", "fault", "simplification", "engine", "coefficients", "inertia",
    "inertia_coupling", "sinusoids", "wind_turbulence", "earth_rotation", "integration",
)  # fmt: skip
LOSS = "loss_of_effectiveness"
ENGINE_TERMS = tuple(term.name for term in load().moments if "dpt" in dict(term.of))
Contributions = dict[str, np.ndarray]
"""Angular accelerations (n, 3) rad/s2 by source, or by part of a source."""
Parts = Iterator[tuple[Any, np.ndarray]]
"""(fault, its part) of each fault: of a deflection, (n,) rad, or an angular acceleration, (n, 3) rad/s2."""


def earth_in_body(attitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """The rotation W of the Earth in body axes, (n, 3) rad/s: (cos(latitude), 0, -sin(latitude)) times its
    rate in north, east, down, turned by psi, theta and phi. attitude (n, 3) phi, theta, psi rad; latitude
    (n,) rad."""
    phi, theta, psi = attitude.T
    north, down = EARTH_RATE_RAD_S * np.cos(latitude), -EARTH_RATE_RAD_S * np.sin(latitude)
    ahead, right = north * np.cos(psi), -north * np.sin(psi)  # after the turn by psi
    forward = ahead * np.cos(theta) - down * np.sin(theta)
    below = ahead * np.sin(theta) + down * np.cos(theta)
    return np.column_stack([
        forward, right * np.cos(phi) + below * np.sin(phi), below * np.cos(phi) - right * np.sin(phi)
    ])  # fmt: skip


def earth_rotation(
    inertia: InertiaCoefficients, x: np.ndarray, attitude: np.ndarray, latitude: np.ndarray
) -> np.ndarray:
    """The source `earth_rotation`, (n, 3) rad/s2: -J^-1 (w_i x J w_i) + J^-1 (w x J w) + w_i x W. x (n, 3)
    rad/s: w."""
    W = earth_in_body(attitude, latitude)
    inertial_rate = x + W
    return inertial(inertia, inertial_rate) - inertial(inertia, x) + np.cross(inertial_rate, W)


class Models:
    """The models of the moments, from the design model to the truth. Each has one error less than the one
    before:

    - design: the design model, which may be linearised about the trim or have a frozen alpha.
    - untied: neither linearised nor frozen. whole: with the terms of the engine. turning: with the
      coefficients of the truth. truth: with the inertia of the truth.
    - parts: by name of each coefficient that differs, `whole` with this coefficient of the truth.
    - inertia: inertia coefficients of `truth`.
    """

    def __init__(self, scenario: Scenario) -> None:
        model = scenario.design_model
        true = scenario.uncertainty.coefficients
        self.scenario = scenario
        declared = Declared.of(scenario)
        self.design, mass = design_of(declared)[0], declared.mass
        anchor(self.design, *known_trim(declared))
        design_scale = {
            k: v for k, v in model.coefficients.items() if model.engine_terms or k not in ENGINE_TERMS
        }
        self.untied = design_record(scale=declared.scale, mass=mass)[0]
        self.whole, self.turning = (
            design_record(scale=scale, mass=mass)[0] for scale in (design_scale, true)
        )
        of_file = load().mass
        true_inertia = {
            f"{name}_kg_m2": ratio * getattr(of_file, f"{name}_kg_m2")
            for name, ratio in scenario.uncertainty.inertia
        }
        self.truth = design_record(scale=true, mass=replace(of_file, **true_inertia))[0]
        self.inertia = inertia_of(self.truth)
        self.parts = {
            term.name: design_record(scale=design_scale | {term.name: true.get(term.name, 1.0)}, mass=mass)[0]
            for term in load().moments
            if true.get(term.name, 1.0) != design_scale.get(term.name, 1.0)
        }


def fault_effects(m: Models, states: States, G: np.ndarray, healthy: np.ndarray) -> Parts:
    """G (n, 3, 4) times its part of the deflection, of each fault of a surface. healthy (n, 4) rad: positions
    of healthy actuators."""
    for s, surface in enumerate(SURFACES):
        faults = [fault for fault in m.scenario.faults if getattr(fault, "actuator", "") == surface]
        position = states.position[:, s]
        parts = *_lost(faults, states, position), *_displaced(faults, states.t_s, position - healthy[:, s])
        for fault, by_rad in parts:
            yield fault, G[:, :, s] * by_rad[:, None]


def unanticipated_effects(m: Models, states: States) -> Parts:
    """The angular acceleration of each unanticipated fault, which is a pitching moment."""
    for fault in m.scenario.faults:
        if fault.type == UNANTICIPATED:
            extra: Any = fault
            pitch = unanticipated_at(m.design, states.y, extra.Cm_alpha3 * share(fault, states.t_s))
            yield fault, np.outer(pitch, (0.0, 1.0, 0.0))


def named(parts: Parts) -> Contributions:
    """The parts by name of their faults. Faults of the same name share a part."""
    by_name: Contributions = {}
    for fault, part in parts:
        name = name_of(fault)
        by_name[name] = by_name.get(name, 0.0) + part
    return by_name


def name_of(fault: Any) -> str:
    """The name of a fault: surface, type and time."""
    place = "" if place_of(fault) == fault.type else f"{place_of(fault)} "
    return f"{place}{fault.type.replace('_', ' ')} at {fault.at_s:g} s"


def share(fault: Any, t_s: np.ndarray) -> np.ndarray:
    """B(t - T0) (n,): the share to which a fault has grown, 0 where it is not in force."""
    grown = np.array([grown_share(fault, t) for t in t_s])
    return np.where(is_in_force(fault, t_s), grown, 0.0)


def _lost(faults: list, states: States, position: np.ndarray) -> Parts:
    """The deflection (n,) rad that each loss takes, after the losses before it in the scenario."""
    remaining = np.ones_like(position)
    for fault in faults:
        if fault.type == LOSS:
            taken = remaining * fault.magnitude * share(fault, states.t_s)
            remaining = remaining - taken
            yield fault, -taken * position


def _displaced(faults: list, t_s: np.ndarray, way: np.ndarray) -> Parts:
    """The displacement of the surface, (n,) rad, of the fault that causes it. Among the faults that are in
    force, it is the one that began last. If none is in force, it is the last that began, whose effect may
    remain after a repair."""
    order = sorted((fault for fault in faults if fault.type != LOSS), key=lambda fault: fault.at_s)
    begun = [~is_before(t_s, fault.at_s) for fault in order]
    in_force = [is_in_force(fault, t_s) for fault in order]
    owner = np.full(t_s.size, -1)
    for masks in (begun, in_force):  # faults in force are written last, over those that have ended
        for i, mask in enumerate(masks):
            owner[mask] = i
    for i, fault in enumerate(order):
        yield fault, np.where(owner == i, way, 0.0)


def off_centre(m: Models, s: States) -> np.ndarray:
    """The part of the source `inertia` that comes from the centre of gravity, (n, 3) rad/s2: J^-1 (F x c)."""
    inertia = m.inertia
    L, M, N = np.cross(s.force, m.scenario.uncertainty.cg_m).T
    return np.column_stack([inertia.Pl * L + inertia.Pn * N, inertia.Qm * M, inertia.Rl * L + inertia.Rn * N])


def inertia_coupling(m: Models, s: States) -> np.ndarray:
    """The source `inertia_coupling`, (n, 3) rad/s2: theta times the rate products [Zhang2005, sec. VII] with
    the inertia of the aircraft file."""
    p, q, r = s.x.T
    theta = m.scenario.uncertainty.inertia_coupling
    inertia = inertia_coefficients(load().mass)
    return np.column_stack(
        [theta.p * inertia.Pqr * q * r, theta.q * inertia.Qpr * p * r, theta.r * inertia.Rpq * p * q]
    )


def sinusoids(m: Models, s: States) -> np.ndarray:
    """The source `sinusoids`, (n, 3) rad/s2: amplitude sin(frequency t) [Zhang2005, sec. VII]."""
    declared = [getattr(m.scenario.uncertainty.sinusoid, axis) for axis in AXES]
    return np.column_stack([d.amplitude_rad_s2 * np.sin(d.frequency_rad_s * s.t_s) for d in declared])


def wind_turbulence(m: Models, s: States) -> np.ndarray:
    """The source `wind_turbulence`, (n, 3) rad/s2: moments with the rates relative to the turning air less
    those with the body rates.

    Wind that does not turn acts on the moments only through alpha, beta and V, which are measured.
    """
    in_air, over_earth = (
        acceleration_at(m.truth, rates, s.y, s.effective) - inertial(m.inertia, rates)
        for rates in (s.x_air, s.x)
    )
    return in_air - over_earth


def earth(m: Models, s: States) -> np.ndarray:
    """The source `earth_rotation` along the flight, whose latitude follows from the way to the north. Gravity
    has no moment about the centre of gravity."""
    latitude = radians(START_LATITUDE_DEG) + s.north_m / (EARTH_RADIUS_M + m.scenario.initial.altitude_m)
    return earth_rotation(m.inertia, s.x, s.attitude, latitude)


def instantaneous(m: Models, s: States) -> tuple[Contributions, dict[str, Contributions]]:
    """All sources but `integration`, and the parts of `fault` and `coefficients`: each fault and each
    coefficient."""
    healthy = healthy_positions(m.scenario, s.u)
    _, G = responses_at(m.design, s.x, s.y)
    moments = named(unanticipated_effects(m, s))
    faults = named(fault_effects(m, s, G, healthy)) | moments
    nothing = np.zeros_like(s.x)
    measured = acceleration_at(m.design, s.x_measured, s.y_measured, s.u)
    tied, untied, whole, turning, truth = (
        acceleration_at(model, s.x, s.y, s.effective)
        for model in (m.design, m.untied, m.whole, m.turning, m.truth)
    )
    # the inertia of the truth applies to the moment of an unanticipated fault, too; Qm: 1 / Iy
    extra = sum(moments.values(), nothing) * (m.truth["Qm"] / m.design["Qm"] - 1.0)
    contributions = {
        "sensors": acceleration_at(m.design, s.x, s.y, s.u) - measured,
        "actuators": np.einsum("kas,ks->ka", G, healthy - s.u),
        "fault": sum(faults.values(), nothing),
        "simplification": untied - tied,
        "engine": whole - untied,
        "coefficients": turning - whole,
        "inertia": truth - turning + extra + off_centre(m, s),
        "inertia_coupling": inertia_coupling(m, s),
        "sinusoids": sinusoids(m, s),
        "wind_turbulence": wind_turbulence(m, s),
        "earth_rotation": earth(m, s),
    }
    errors = {name: acceleration_at(part, s.x, s.y, s.effective) - whole for name, part in m.parts.items()}
    return contributions, {"fault": faults, "coefficients": errors}
