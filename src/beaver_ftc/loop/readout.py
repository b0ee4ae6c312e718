"""A flight at one frame, as certificates, studies and integrations read it; and what these may set in it.

The layout of the records is the business of their stages alone. `frame` is a record of
`assembly.frame_dtype`; a readout copies what it returns.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from beaver_ftc.control.readout import ControlReadout
from beaver_ftc.design.model import InertiaCoefficients, inertia_of
from beaver_ftc.diagnosis import readout as of_diagnosis
from beaver_ftc.diagnosis.readout import DiagnosisReadout
from beaver_ftc.loop.assembly import y_places
from beaver_ftc.plant.channels import AIRSPEED, ALTITUDE


class Origin(NamedTuple):
    """Where a flight starts: latitude and longitude, rad; radius of the Earth and of the parallel, m."""

    latitude_rad: float
    longitude_rad: float
    radius_m: float
    parallel_radius_m: float


class Actuators(NamedTuple):
    """The declared actuators, (surfaces,): stops, rad; of an instant the share of the way to the command that
    is made, and the longest way, rad."""

    low_rad: np.ndarray
    high_rad: np.ndarray
    approach: np.ndarray
    step_rad: np.ndarray


class FrameReadout:
    """A flight at the frame in which it is read first; see the types of what it returns."""

    def __init__(self, frame: np.void) -> None:
        self._frame = frame

    @cached_property
    def since(self) -> int:
        """The frame with which this diagnosis began."""
        return int(self._frame["since"])

    @cached_property
    def k(self) -> int:
        """Number of the coming frame."""
        return int(self._frame["k"])

    @cached_property
    def dt_s(self) -> float:
        """Duration of a frame, s."""
        return float(self._frame["dt"])

    @cached_property
    def rates_rad_s(self) -> np.ndarray:
        """Measured p, q, r, (3,) rad/s."""
        return np.array(self._frame["measured"]["x"])

    @cached_property
    def alpha_rad(self) -> float:
        """Measured angle of attack, rad."""
        return float(self._frame["measured"]["y"][0])

    @cached_property
    def missing_sensors(self) -> np.ndarray:
        """Numbers of the sensors without a reading in this frame."""
        return np.flatnonzero(self._frame["measured"]["missing"])

    @cached_property
    def expected_u_rad(self) -> np.ndarray:
        """Positions that the actuators' model gives, (surfaces,) rad."""
        return np.array(self._frame["prediction"]["u"])

    @cached_property
    def actuators(self) -> Actuators:
        """The declared actuators."""
        actuators = self._frame["prediction"]["actuators"]
        return Actuators(*(actuators[name].copy() for name in ("low", "high", "approach", "step")))

    @cached_property
    def G(self) -> np.ndarray:
        """Effectiveness by the design model at this instant, (3, surfaces) rad/s2 per rad."""
        return np.array(self._frame["prediction"]["G"])

    @cached_property
    def mean_G(self) -> np.ndarray:
        """The same, mean over the elapsed frame."""
        return np.array(self._frame["prediction"]["means"]["G"])

    @cached_property
    def model_rad_s2(self) -> np.ndarray:
        """f + G u by the design model, mean over the elapsed frame, (3,) rad/s2."""
        return np.array(self._frame["prediction"]["means"]["F"])

    @cached_property
    def inertia(self) -> InertiaCoefficients:
        """The inertia coefficients of the design model, SI."""
        return inertia_of(self.design)

    @cached_property
    def design(self) -> np.void:
        """The design model's record, not a copy, for the functions of `design.model`."""
        return self._frame["prediction"]["design"]

    @cached_property
    def true_signals(self) -> np.ndarray:
        """The measured signals beside the rates without errors, in the order of y, SI."""
        truth = self._frame["truth"]
        return np.asarray((truth["value"] * truth["factor"])[y_places(self._frame)])

    @cached_property
    def height_m(self) -> float:
        """True height above sea level, m."""
        return float(self._frame["truth"]["value"][ALTITUDE])

    @cached_property
    def airspeed_mps(self) -> float:
        """True airspeed, m/s."""
        return float(self._frame["truth"]["value"][AIRSPEED])

    @cached_property
    def origin(self) -> Origin:
        """Where the flight starts."""
        names = "latitude_0", "longitude_0", "radius_m", "parallel_radius_m"
        return Origin(*(float(self._frame["truth"][name]) for name in names))

    @cached_property
    def envelope_exits(self) -> int:
        """How often the flight has left its declared envelope so far."""
        return int(self._frame["accounts"]["envelope"]["n_exits"])

    @cached_property
    def alarmed(self) -> bool:
        """Whether an alarm of the built-in diagnosis stands, of surfaces or of sensors."""
        return any(map(bool, of_diagnosis.alarm_flags(self._frame["fdi"])))

    @cached_property
    def diagnosis(self) -> DiagnosisReadout:
        """The diagnosis."""
        return DiagnosisReadout(self._frame["fdi"])

    @cached_property
    def control(self) -> ControlReadout:
        """The law."""
        return ControlReadout(self._frame["control"])


class Instruments:
    """The readings of a flight that goes on: they change with it."""

    def __init__(self, frame: np.void) -> None:
        self._signal = frame["measured"]["signal"]

    def readings(self) -> list[float]:
        """Of each of `plant.instruments.SENSORS`, SI."""
        return self._signal.tolist()


def alarm_flags(frame: np.void) -> tuple[np.int64, np.int64]:
    """Whether the alarm of the surfaces stands, and that of the sensor monitor."""
    return of_diagnosis.alarm_flags(frame["fdi"])


def recorded_arrays(
    frame: np.void, n: int, diagnoses_all_types: bool, statistical: bool
) -> tuple[dict[str, np.ndarray], ...]:
    """The arrays that a certificate wants: see `diagnosis.readout.certificate_arrays`."""
    return of_diagnosis.certificate_arrays(frame["fdi"], n, diagnoses_all_types, statistical)


def switch_statistical_tests(frame: np.void, enabled: bool) -> None:
    """Switch the statistical tests on or off, for every scheme."""
    of_diagnosis.switch_statistical_tests(frame["fdi"], enabled)


def stop_diagnosis(frame: np.void) -> None:
    """Stop the diagnosis of surfaces and sensors from the next frame on."""
    of_diagnosis.disable_diagnosis(frame["fdi"])


WITHHELD = {"verdict": ("uses_verdict", "reallocates"), "stand-in": ("reallocates",)}


def withhold_from_law(frame: np.void, what: str) -> None:
    """Fly on with a law that makes no use of the verdict, or of a stand-in for another surface (WITHHELD)."""
    for name in WITHHELD[what]:
        frame["control"]["config"][name] = 0


def set_ground(frame: np.void, ground_m: float, slow_mps: float) -> None:
    """Put the ground at this height above sea level; below slow_mps on it the flight is over."""
    frame["truth"]["ground_m"], frame["truth"]["slow_mps"] = ground_m, slow_mps


def hold_from_start(frame: np.void, deflections_rad: np.ndarray) -> None:
    """Command these deflections, (surfaces,) rad, in the law's place from the first frame on."""
    frame["held"], frame["held_rad"] = 1, deflections_rad


def end_outer_loops(frame: np.void) -> None:
    """Switch the outer loops off."""
    frame["autopilot"]["enabled"] = 0


def command_power(frame: np.void, setting: float) -> None:
    """Command the engine's setting in the law's place."""
    power = frame["control"]["power"]["output"]
    power["in_use"], power["command"][0] = 1, setting
