"""Linear models of the truth and of the design, at the trim with which a scenario starts.

truth     differences of the accelerations of JSBSim about the trim
fdc       the FDC equations, differentiated by complex steps: an independent computation
design    the FDC equations with the moments of the design model
own       the linearisation of JSBSim itself; it is compared with the FDC equations at the same condition
          without sideslip
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beaver_ftc.design import fdc
from beaver_ftc.design.engine import engine_power_kw, slipstream
from beaver_ftc.design.model import design_of
from beaver_ftc.design.plain_model import jacobian
from beaver_ftc.design.table import AIRSPEED, ALPHA
from beaver_ftc.documents.files import Document
from beaver_ftc.plant.adapter import FlightState
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import LinearModel, differences, own
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.linear_systems import CHANNELS, CLASSICAL, MODES, Mode, deviation, modes, zeros

_STEP = 1e-30  # size of a complex step: f'(x) = Im f(x + i h) / h without cancellation
_V, _FLOW_AT, _RATES_AT, _H = map(fdc.STATES.index, ("airspeed", "alpha", "p", "altitude"))
_FLOW = slice(_FLOW_AT, _FLOW_AT + 2)  # alpha, beta
_RATES = slice(_RATES_AT, _RATES_AT + 3)  # p, q, r


ByMode = dict[str, float]
"""A number for each of MODES."""


@dataclass(frozen=True)
class LinearAnalysis:
    """Linear models over the eight classical states.

    - point: the trim. models, modes: the models `truth`, `fdc` and `design`, and their modes, by name.
    - own_deviation: by mode, deviation of the linearisation of JSBSim itself from the FDC equations, without
      sideslip.
    """

    point: FlightState
    models: dict[str, LinearModel]
    modes: dict[str, dict[str, Mode]]
    own_deviation: ByMode

    def channel(self, name: str, surface: str, rate: str) -> tuple[np.ndarray, np.ndarray, int]:
        """Arguments of `response` and `zeros`: A of a model, the column of B of a surface, and the row of a
        rate."""
        model = self.models[name]
        return model.A, model.B[:, model.inputs.index(surface)], model.states.index(rate)

    def deviation(self, name: str) -> ByMode:
        """Distance of each pole of a model from that of the truth, over the magnitude of the latter."""
        truth = self.modes["truth"]
        return {mode: deviation(self.modes[name][mode].pole, truth[mode].pole) for mode in MODES}


def analyse(scenario: Scenario) -> LinearAnalysis:
    """Linearise truth, FDC equations and design model of a scenario at its trim."""
    plant, point = trimmed(scenario)
    equations = fdc_model(scenario, point)
    models = {
        "truth": differences(plant, point).of(CLASSICAL),
        "fdc": equations.of(CLASSICAL),
        "design": designed(scenario, point, equations).of(CLASSICAL),
    }
    by_name = {name: modes(model.A) for name, model in models.items()}
    return LinearAnalysis(point, models, by_name, own_deviation(scenario, point))


def own_deviation(scenario: Scenario, point: FlightState) -> ByMode:
    """By mode, deviation of the linearisation of JSBSim itself from the FDC equations, at `point` without
    sideslip."""
    straight = replace(point, beta_rad=0.0)
    modes_of_jsbsim, reference = (
        modes(model(scenario, straight).of(CLASSICAL).A) for model in (own, fdc_model)
    )
    return {name: deviation(modes_of_jsbsim[name].pole, reference[name].pole) for name in MODES}


def fdc_model(scenario: Scenario, point: FlightState) -> LinearModel:
    """The FDC equations with the coefficients of the truth, twelve states."""
    ratio = scenario.uncertainty.coefficients
    return LinearModel(*fdc.linearise(*in_fdc(point), ratio), fdc.STATES, fdc.SURFACES)


def in_fdc(point: FlightState) -> tuple[np.ndarray, np.ndarray, fdc.Engine]:
    """The arguments of the FDC equations: state (12,) SI and rad, deflections (4,) rad, engine setting."""
    state = np.array([
        point.airspeed_mps, point.alpha_rad, point.beta_rad, point.p_rad_s, point.q_rad_s, point.r_rad_s,
        point.phi_rad, point.theta_rad, point.psi_rad, 0.0, 0.0, point.altitude_m,
    ])  # fmt: skip
    deflections = np.array([point.surfaces_rad[surface] for surface in fdc.SURFACES])
    return state, deflections, fdc.Engine(point.engine_rpm, point.manifold_pressure_inhg)


def designed(scenario: Scenario, point: FlightState, equations: LinearModel) -> LinearModel:
    """The equations, with the rows of p, q and r from the design model. Airspeed and altitude act on the
    moments through the air data, whose derivatives follow from a complex step."""
    f_x, f_y, G = designed_derivatives(scenario, point)
    A, B = equations.A.copy(), equations.B.copy()
    A[_RATES] = 0.0
    A[_RATES, _RATES] = f_x
    A[_RATES, _FLOW] = f_y[:, :AIRSPEED]
    B[_RATES] = G
    for column, step in ((_V, (1j * _STEP, 0j)), (_H, (0j, 1j * _STEP))):
        A[_RATES, column] = f_y[:, AIRSPEED:] @ (air_data(point, *step).imag / _STEP)
    return replace(equations, A=A, B=B)


def designed_derivatives(scenario: Scenario, point: FlightState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """f_x (3, 3), f_y (3, 5) and G (3, 4) of the design model at a trim. With `frozen_alpha`, alpha has no
    effect."""
    design = design_of(Declared.of(scenario))[0]
    y = np.array([point.alpha_rad, point.beta_rad, *air_data(point)])
    _, G, f_x, f_y = jacobian(design, np.zeros(3), y, in_fdc(point)[1])
    if scenario.design_model.frozen_alpha:
        f_y[:, ALPHA] = 0.0
    return f_x, f_y, G


def air_data(point: FlightState, faster_mps: Any = 0.0, higher_m: Any = 0.0) -> np.ndarray:
    """V m/s, qdyn Pa and dpt, (3,), at a point or a step away, with the engine setting of the point. Steps
    may be complex."""
    V, density = point.airspeed_mps + faster_mps, fdc.air_density(point.altitude_m + higher_m)
    power = engine_power_kw(point.engine_rpm, point.manifold_pressure_inhg, density)
    return np.array([V, 0.5 * density * V**2, slipstream(power, density, V)])


def linear_document(analysis: LinearAnalysis) -> Document:
    """The document: modes of all models, deviations from the truth, and zeros from each surface to its
    rate."""
    deviations = {name: analysis.deviation(name) for name in analysis.models if name != "truth"}
    return {
        "airspeed_mps": analysis.point.airspeed_mps,
        "altitude_m": analysis.point.altitude_m,
        "modes": {
            mode: {
                **{name: _mode(by_mode[mode]) for name, by_mode in analysis.modes.items()},
                "deviation": {name: by_mode[mode] for name, by_mode in deviations.items()},
                "jsbsim_own_deviation": analysis.own_deviation[mode],
            }
            for mode in MODES
        },
        "zeros": {
            f"{surface} to {rate}": {
                name: [
                    [float(zero.real), float(zero.imag)]
                    for zero in zeros(*analysis.channel(name, surface, rate))
                ]
                for name in analysis.models
            }
            for surface, rate in CHANNELS
        },
    }


def _mode(mode: Mode) -> Document:
    """A mode for the document."""
    return {
        "real_per_s": mode.pole.real,
        "imaginary_rad_s": mode.pole.imag,
        "frequency_rad_s": mode.frequency_rad_s,
        "damping": mode.damping,
    }
