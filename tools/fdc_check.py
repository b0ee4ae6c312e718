"""The truth against the FDC data: state derivatives at random states, and two doublet responses.

The data are CSV files computed from the FDC equations by an independent implementation.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.adapter import FT_PER_M, FlightState, Plant
from beaver_ftc.plant.linear import derivative

M_PER_FT = 1.0 / FT_PER_M
SAMPLE_S = 0.05
DERIVATIVE_BAR: dict[str, float | None] = {  # in the order of `plant.linear.derivative`
    "Vdot_mps2": 2e-4,
    "alphadot_rad_s": 5e-4,
    "betadot_rad_s": None,
    "pdot_rad_s2": 2e-4,
    "qdot_rad_s2": 2e-4,
    "rdot_rad_s2": 2e-4,
}
RESPONSE_BAR = {1000: 0.01, 100: 0.05}  # by frame rate, Hz

# FDC's altitude and track against JSBSim's; its earth is flat, so 20 s are short enough to compare positions.
_RESPONSE = {
    "V_mps": ("velocities/vt-fps", M_PER_FT),
    "alpha_rad": ("aero/alpha-rad", 1.0),
    "beta_rad": ("aero/beta-rad", 1.0),
    "p_rad_s": ("velocities/p-rad_sec", 1.0),
    "q_rad_s": ("velocities/q-rad_sec", 1.0),
    "r_rad_s": ("velocities/r-rad_sec", 1.0),
    "phi_rad": ("attitude/phi-rad", 1.0),
    "theta_rad": ("attitude/theta-rad", 1.0),
    "psi_rad": ("attitude/psi-rad", 1.0),
    "x_m": ("position/from-start-neu-n-ft", M_PER_FT),
    "y_m": ("position/from-start-neu-e-ft", M_PER_FT),
    "h_m": ("position/h-sl-meters", 1.0),
}
_SURFACE_COLUMNS = ("aileron_rad", "elevator_rad", "rudder_rad")


@dataclass(frozen=True)
class Agreement:
    """How well one signal agrees: `error` as the share it is measured in, and its bar (None: no bar)."""

    signal: str
    error: float
    bar: float | None

    @property
    def met(self) -> bool:
        return self.bar is None or self.error <= self.bar


def read_table(name: str) -> np.ndarray:
    """A CSV file of the FDC data, which has a header, as a structured array."""
    return np.genfromtxt(data_root() / "tests" / "data" / f"fdc_{name}.csv", delimiter=",", names=True)


def flight_state(row: np.void) -> FlightState:
    """The state, surfaces and engine of one row of the FDC data."""
    names = ("alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "phi_rad", "theta_rad", "psi_rad")
    return FlightState(
        airspeed_mps=float(row["V_mps"]),
        altitude_m=float(row["h_m"]),
        engine_rpm=float(row["engine_rpm"]),
        manifold_pressure_inhg=float(row["manifold_pressure_inHg"]),
        **{name: float(row[name]) for name in (*names, *_SURFACE_COLUMNS, "flap_rad")},
    )


def derivative_agreement() -> list[Agreement]:
    """RMS error over RMS value of each state derivative, over the random states."""
    table = read_table("state_derivatives")
    plant = Plant(rate_hz=100)
    found = np.array([derivative(plant, flight_state(row)) for row in table]).T
    return [
        Agreement(name, _rms(of - table[name]) / _rms(table[name]), bar)
        for (name, bar), of in zip(DERIVATIVE_BAR.items(), found, strict=False)
    ]


def response_agreement(surface: str, rate_hz: int) -> list[Agreement]:
    """Largest error over span of each signal, in the 20 s after a doublet of `surface` begins the flight.

    The truth is flown as the loop flies it: after each run the state is read and the next command written.
    """
    table = read_table(f"{surface}_doublet")
    agreements = []
    for name, flown in _fly(table, rate_hz).items():
        largest = np.abs(_difference(name, flown, table[name])).max()
        agreements.append(Agreement(name, float(largest / np.ptp(table[name])), RESPONSE_BAR[rate_hz]))
    return agreements


def _fly(table: np.ndarray, rate_hz: int) -> dict[str, np.ndarray]:
    """The responses of our plant to the surfaces of a table, at its samples."""
    plant = Plant(rate_hz=rate_hz)
    plant.start(flight_state(table[0]))
    frames = round(SAMPLE_S * rate_hz)
    samples = [[plant.read(name) for name, _ in _RESPONSE.values()]]
    for row in table[:-1]:
        for column in _SURFACE_COLUMNS:
            plant.write(f"fcs/{column.removesuffix('_rad')}-cmd-rad", float(row[column]))
        for _ in range(frames):
            plant.run()
        samples.append([plant.read(name) for name, _ in _RESPONSE.values()])
    values = np.array(samples).T
    return {name: values[i] * factor for i, (name, (_, factor)) in enumerate(_RESPONSE.items())}


def _difference(name: str, ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    difference = ours - theirs
    return (difference + pi) % (2 * pi) - pi if name == "psi_rad" else difference


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))
