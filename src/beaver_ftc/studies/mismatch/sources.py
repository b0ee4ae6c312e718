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
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.studies.mismatch import moments
from beaver_ftc.studies.mismatch.actuator import HealthyActuators
from beaver_ftc.studies.mismatch.believed import Belief, Parts, belief_of, true_parts
from beaver_ftc.studies.mismatch.faults import fault_effects
from beaver_ftc.studies.mismatch.rotation import earth_rotation, latitude_rad
from beaver_ftc.studies.mismatch.states import AXES, States

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

SOURCES = (
    "sensors", "actuators", "fault", "simplification", "engine", "coefficients", "inertia",
    "inertia_coupling", "sinusoids", "wind_turbulence", "earth_rotation", "integration",
)  # fmt: skip
Contributions = dict[str, np.ndarray]


@dataclass
class Case:
    """What is known of one flight: its scenario, what the designer believes and what the truth is made of."""

    scenario: "Scenario"
    belief: Belief
    truth: Parts
    actuators: HealthyActuators

    @classmethod
    def of(cls, scenario: "Scenario", trim: States) -> "Case":
        """The case of a flight that starts with these states."""
        return cls(scenario, belief_of(scenario, trim), true_parts(scenario), HealthyActuators.of(scenario))


def sensors(case: Case, s: States) -> np.ndarray:
    """The design model at the true state less the same at the measured one."""
    belief = case.belief
    return belief.acceleration(s.x, s.y, s.u) - belief.acceleration(s.x_measured, s.y_measured, s.u)


def actuators(case: Case, s: States, healthy: np.ndarray) -> np.ndarray:
    """Lag and limits: G times what healthy actuators fall short of the command by."""
    return np.einsum("kas,ks->ka", case.belief.effectiveness(s.y), healthy - s.u)


def simplification(case: Case, s: States) -> np.ndarray:
    """What freezing or linearising leaves out."""
    exact = case.belief.parts.acceleration(s.x, s.y, s.effective)
    return exact - case.belief.acceleration(s.x, s.y, s.effective)


def engine(case: Case, s: States) -> np.ndarray:
    """The slipstream's moments where the design model neglects them, with the table's coefficients."""
    if case.scenario.design_model.engine_terms:
        return np.zeros_like(s.x)
    of = moments.quantities(s.x, s.y, s.effective)
    table = {name: moments.MOMENT_TERMS[name].value for name in moments.ENGINE_TERMS}
    return moments.aerodynamic(table, case.belief.parts.inertia, of, s.y[:, 3], moments.ENGINE_TERMS)


def coefficient_errors(case: Case, s: States) -> Contributions:
    """Each term whose coefficient differs between truth and design, neglected engine terms aside."""
    of = moments.quantities(s.x, s.y, s.effective)
    return {
        name: moments.term(name, error, case.belief.parts.inertia, of, s.y[:, 3])
        for name in moments.MOMENT_TERMS
        if (error := case.truth.coefficients[name] - _believed_coefficient(case, name)) != 0.0
    }


def _believed_coefficient(case: Case, name: str) -> float:
    neglected = not case.scenario.design_model.engine_terms and name in moments.ENGINE_TERMS
    return moments.MOMENT_TERMS[name].value if neglected else case.belief.parts.coefficients[name]


def inertia(case: Case, s: States, extra_moment: np.ndarray) -> np.ndarray:
    """The truth's moments and rate products by the truth's inertia less by the designer's.

    extra_moment (n, 3) rad/s2: the pitching moment of unanticipated faults, as the designer's inertia
    weighs it.
    """
    true, believed = case.truth.inertia, case.belief.parts.inertia
    if true == believed:
        return np.zeros_like(s.x)
    of = moments.quantities(s.x, s.y, s.effective)
    by = [
        moments.inertial(inertia, s.x) + moments.aerodynamic(case.truth.coefficients, inertia, of, s.y[:, 3])
        for inertia in (true, believed)
    ]
    return by[0] - by[1] + extra_moment * (true.Qm / believed.Qm - 1.0)


def inertia_coupling(case: Case, s: States) -> np.ndarray:
    """The declared relative errors of the rate products [Zhang2005, sec. VII]."""
    p, q, r = s.x.T
    theta, of = case.scenario.uncertainty.inertia_coupling, case.truth.inertia
    return np.column_stack([theta.p * of.Pqr * q * r, theta.q * of.Qpr * p * r, theta.r * of.Rpq * p * q])


def sinusoids(case: Case, s: States) -> np.ndarray:
    """The declared sinusoids [Zhang2005, sec. VII]."""
    declared = [getattr(case.scenario.uncertainty.sinusoid, axis) for axis in AXES]
    return np.column_stack([d.amplitude_rad_s2 * np.sin(d.frequency_rad_s * s.t_s) for d in declared])


def wind_turbulence(case: Case, s: States) -> np.ndarray:
    """The damping terms at the rates relative to the turning air, less the same at the body rates.

    Wind that does not turn reaches the moments only through alpha, beta and V, which are measured.
    """
    if s.x_air is s.x or np.array_equal(s.x_air, s.x):
        return np.zeros_like(s.x)
    names = [name for name, t in moments.MOMENT_TERMS.items() if set(t.factors) & set(moments.RATES)]
    at = [
        moments.aerodynamic(
            case.truth.coefficients,
            case.truth.inertia,
            moments.quantities(rates, s.y, s.effective),
            s.y[:, 3],
            names,
        )
        for rates in (s.x_air, s.x)
    ]
    return at[0] - at[1]


def earth(case: Case, s: States) -> np.ndarray:
    """The Earth's rotation; real gravity makes no moment about the centre of gravity."""
    latitude = latitude_rad(s.north_m, case.scenario.initial.altitude_m)
    return earth_rotation(lambda w: moments.inertial(case.truth.inertia, w), s.x, s.attitude, latitude)


def instantaneous(case: Case, s: States) -> tuple[Contributions, dict[str, Contributions]]:
    """All sources but the integration at every frame, and the parts of those that have parts."""
    healthy = case.actuators.follow(s.u)
    faults = fault_effects(case.scenario, case.belief, s, healthy)
    errors = coefficient_errors(case, s)
    nothing = np.zeros_like(s.x)
    contributions = {
        "sensors": sensors(case, s),
        "actuators": actuators(case, s, healthy),
        "fault": sum(faults.values(), nothing),
        "simplification": simplification(case, s),
        "engine": engine(case, s),
        "coefficients": sum(errors.values(), nothing),
        "inertia": inertia(case, s, _unanticipated(case, faults, nothing)),
        "inertia_coupling": inertia_coupling(case, s),
        "sinusoids": sinusoids(case, s),
        "wind_turbulence": wind_turbulence(case, s),
        "earth_rotation": earth(case, s),
    }
    return contributions, {"fault": faults, "coefficients": errors}


def _unanticipated(case: Case, faults: Contributions, nothing: np.ndarray) -> np.ndarray:
    return sum((effect for name, effect in faults.items() if name.startswith("unanticipated")), nothing)


def integration(case: Case, s: States, following: States) -> np.ndarray:
    """How the rates moved over a frame less JSBSim's acceleration at its start; the design's likewise.

    The design model's mean over a frame is the diagnosis': over all its JSBSim frames. With one JSBSim frame
    a frame it is the sample at the start. following: the same frames, each one later.
    """
    moved = (following.x - s.x) * case.scenario.rate_hz - s.xdot
    sampled = case.belief.acceleration(s.x_measured, s.y_measured, s.u)
    return moved - (following.design_mean - sampled)
