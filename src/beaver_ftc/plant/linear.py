"""The truth linearised about a flight condition, in two ways.

`differences`: central differences of JSBSim's accelerations, each at a settled state. It is right everywhere.

`own`: JSBSim's FGLinearization, as a second opinion. Three things to know (1.3.3). It asks the first
engine for its thruster and, the Beaver having no engine, would bring the process down: so a copy of the
aircraft is loaded with one that weighs nothing and gives nothing. Setting alpha it passes sideslip in
degrees where radians are due, so only a flight condition with no sideslip is linearised rightly. It does
not wait for the side force of betadot to settle.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import cos, hypot, radians
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import jsbsim
import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import EARTH_RADIUS_M, M_PER_FT
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant.adapter import START_LATITUDE_DEG, FlightState, Plant
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc.plant.true_aircraft import configure
from beaver_ftc.scenario.truth import Truth

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario
    from control import StateSpace


_PARALLEL_RADIUS_M = EARTH_RADIUS_M * cos(radians(START_LATITUDE_DEG))
# State by our name, with its unit (a field of FlightState, but for north and east), and by JSBSim's, with the
# factor to ours; how far it is moved for a difference: small against the curvature of the polynomials, large
# against rounding. Latitude and longitude become metres.
_STATES = (
    ("airspeed", "airspeed_mps", "Vt", M_PER_FT, 1e-2),
    ("alpha", "alpha_rad", "Alpha", 1.0, 1e-4),
    ("beta", "beta_rad", "Beta", 1.0, 1e-4),
    ("p", "p_rad_s", "P", 1.0, 1e-4),
    ("q", "q_rad_s", "Q", 1.0, 1e-4),
    ("r", "r_rad_s", "R", 1.0, 1e-4),
    ("phi", "phi_rad", "Phi", 1.0, 1e-4),
    ("theta", "theta_rad", "Theta", 1.0, 1e-4),
    ("psi", "psi_rad", "Psi", 1.0, 1e-4),
    ("altitude", "altitude_m", "Alt", M_PER_FT, 10.0),
    ("north", "north_m", "Latitude", EARTH_RADIUS_M, 0.0),
    ("east", "east_m", "Longitude", _PARALLEL_RADIUS_M, 0.0),
)
_MOVED = [state for state in _STATES if state[-1]]
_UNITS = {name: unit for name, unit, *_ in _STATES}
_SURFACE_STEP_RAD = 1e-3
_PRESSURE_STEP_INHG = 0.1
_INPUTS = {"DaCmd": "aileron", "DeCmd": "elevator", "DrCmd": "rudder"}

_PLACE = '<location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>'
_NO_PROPULSION = "<propulsion/>"
_INERT_PROPULSION = (
    f'<propulsion> <engine file="inert"> {_PLACE} <thruster file="nothing"> {_PLACE} </thruster> </engine>'
    " </propulsion>"
)
_ENGINE = '<electric_engine name="inert"> <power unit="WATTS"> 0 </power> </electric_engine>'
_THRUSTER = '<direct name="nothing"> </direct>'


@dataclass(frozen=True)
class LinearModel:
    """Linear model xdot = A x + B u about a flight condition, in SI units and rad.

    - `A` (n, n), `B` (n, m): the matrices.
    - `states` (n,), `inputs` (m,): names of the states and of the surfaces, in the order of `A` and `B`.
    """

    A: np.ndarray
    B: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]

    def of(self, states: tuple[str, ...]) -> "LinearModel":
        """The model with only these states, in this order. All other states keep their trim values."""
        rows = [self.states.index(name) for name in states]
        return LinearModel(self.A[np.ix_(rows, rows)], self.B[rows], states, self.inputs)

    def state_space(self) -> "StateSpace":
        """The model as a `StateSpace` of python-control.

        Every state is an output. Names of states, inputs and outputs end with the unit. Raises BadInput if
        the extra `control` is not installed.
        """
        try:
            import control
        except ImportError:
            raise BadInput(
                "python-control is not installed, allowed: pip install 'beaver-ftc[control]'"
            ) from None
        states, inputs = [_UNITS[name] for name in self.states], [f"{name}_rad" for name in self.inputs]
        n, m = self.B.shape
        return control.ss(
            self.A, self.B, np.eye(n), np.zeros((n, m)), states=states, inputs=inputs, outputs=states
        )


def differences(plant: Plant, point: FlightState) -> LinearModel:
    """The plant about a flight condition: ten states (no position over ground), all surfaces."""
    surfaces = plant.aircraft.surfaces
    A = [_slope(plant, point, field, step) for _, field, _, _, step in _MOVED]
    B = [_slope(plant, point, f"{surface}_rad", _SURFACE_STEP_RAD) for surface in surfaces]
    names = tuple(name for name, *_ in _MOVED)
    return LinearModel(np.column_stack(A), np.column_stack(B), names, surfaces)


def engine_slope(plant: Plant, point: FlightState) -> np.ndarray:
    """What the ten states' derivatives, as in `differences`, gain per inHg of manifold pressure, (10,)."""
    return _slope(plant, point, "manifold_pressure_inhg", _PRESSURE_STEP_INHG)


def _slope(plant: Plant, point: FlightState, field: str, step: float) -> np.ndarray:
    here = getattr(point, field)
    ahead, behind = (derivative(plant, replace(point, **{field: here + way})) for way in (step, -step))
    return (ahead - behind) / (2.0 * step)


def derivative(plant: Plant, state: FlightState) -> np.ndarray:
    """Time derivative of the ten states, (10,), from JSBSim's accelerations."""
    plant.start(state)
    u, v, w = (plant.read(f"velocities/{axis}-fps") * M_PER_FT for axis in "uvw")
    udot, vdot, wdot = (plant.read(f"accelerations/{axis}dot-ft_sec2") * M_PER_FT for axis in "uvw")
    V, uw = hypot(u, v, w), hypot(u, w)
    Vdot = (u * udot + v * vdot + w * wdot) / V
    flow = [Vdot, (u * wdot - w * udot) / uw**2, (vdot * V - v * Vdot) / (V * uw)]
    turning = [plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in "pqr"]
    attitude = [plant.read(f"velocities/{angle}dot-rad_sec") for angle in ("phi", "theta", "psi")]
    return np.array([*flow, *turning, *attitude, plant.read("velocities/h-dot-fps") * M_PER_FT])


def own(scenario: "Scenario", point: FlightState) -> LinearModel:
    """The scenario's truth as JSBSim linearises it: twelve states, three surfaces.

    point: a flight condition with no sideslip. Raises SimulationFailed where JSBSim makes nothing of it.
    """
    if point.beta_rad != 0.0:
        raise SimulationFailed("JSBSim linearises rightly only with no sideslip")
    with _aircraft_with_an_engine(scenario.airframe) as model:
        plant = Plant(scenario.rate_hz, aircraft=scenario.airframe, model=model)
        configure(plant, Truth.of(scenario))
        plant.start(point)
        linear = jsbsim.FGLinearization(plant.fdm)
        per_norm = [plant.read(f"actuators/{surface}/position-max-rad") for surface in _INPUTS.values()]
    return _in_our_units(linear, np.array(per_norm))


@contextmanager
def _aircraft_with_an_engine(aircraft: Aircraft) -> Iterator[Path]:
    """A copy of the aircraft's model with an inert engine added."""
    text = aircraft.jsbsim.read_text(encoding="utf-8")
    if _NO_PROPULSION not in text:
        raise SimulationFailed("the aircraft is not the one linear analysis knows: it has engines")
    with TemporaryDirectory(prefix="beaver-ftc-") as folder:
        root = Path(folder)
        copy_of(aircraft.jsbsim, root)
        for path, content in (
            (aircraft.jsbsim.name, text.replace(_NO_PROPULSION, _INERT_PROPULSION)),
            ("Engines/inert.xml", _ENGINE),
            ("Engines/nothing.xml", _THRUSTER),
        ):
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(content, encoding="utf-8")
        yield root / aircraft.jsbsim.name


def _in_our_units(linear: jsbsim.FGLinearization, rad_per_norm: np.ndarray) -> LinearModel:
    """Rename and rescale; JSBSim's surface inputs are shares of the travel, and its throttle goes."""
    ours = {theirs: (name, factor) for name, _, theirs, factor, _ in _STATES}
    named = [ours[name] for name in linear.x_names]
    columns = [linear.u_names.index(name) for name in _INPUTS]
    factor = np.array([factor for _, factor in named])
    A = np.array(linear.system_matrix) * factor[:, None] / factor
    B = np.array(linear.input_matrix)[:, columns] * factor[:, None] / rad_per_norm
    if not (np.isfinite(A).all() and np.isfinite(B).all()):
        raise SimulationFailed("JSBSim's linearisation is not finite")
    return LinearModel(A, B, tuple(name for name, _ in named), tuple(_INPUTS.values()))
