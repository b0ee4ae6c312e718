"""A flight at one frame, as certificates, studies and integrations read it; and what these may set in it.

The layout of the records is the business of their stages alone. `frame` is a record of
`assembly.frame_dtype`; a readout copies what it returns.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from beaver_ftc.control.readout import ControlReadout
from beaver_ftc.design.model import inertia_of
from beaver_ftc.diagnosis import readout as of_diagnosis
from beaver_ftc.diagnosis.readout import DiagnosisReadout, Readout, value
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


class FrameReadout(Readout):
    """A flight at the frame in which it is read first; see the types of what it returns.

    since, k                     number of the frame with which this diagnosis began, and of the coming frame
    dt_s                         duration of a frame, s
    rates_rad_s, alpha_rad       measured p, q, r, (3,) rad/s, and angle of attack, rad
    missing_sensors              numbers of the sensors without a reading in this frame
    expected_u_rad               positions that the actuators' model gives, (surfaces,) rad
    G, mean_G                    effectiveness by the design model, (3, surfaces) rad/s2 per rad: at this
                                 instant, and the mean over the elapsed frame
    model_rad_s2                 f + G u by the design model, mean over the elapsed frame, (3,) rad/s2
    inertia                      inertia coefficients of the design model, SI
    height_m, airspeed_mps       true height above sea level, m, and true airspeed, m/s
    envelope_exits               how often the flight has left its declared envelope so far
    diagnosis, control           the diagnosis, and the law
    """

    since = value(int, "since")
    k = value(int, "k")
    dt_s = value(float, "dt")
    rates_rad_s = value(np.array, "measured", "x")
    alpha_rad = value(float, "measured", "y", 0)
    missing_sensors = value(np.flatnonzero, "measured", "missing")
    expected_u_rad = value(np.array, "prediction", "u")
    G = value(np.array, "prediction", "G")
    mean_G = value(np.array, "prediction", "means", "G")
    model_rad_s2 = value(np.array, "prediction", "means", "F")
    inertia = value(inertia_of, "prediction", "design")
    height_m = value(float, "truth", "value", ALTITUDE)
    airspeed_mps = value(float, "truth", "value", AIRSPEED)
    envelope_exits = value(int, "accounts", "envelope", "n_exits")
    diagnosis = value(DiagnosisReadout, "fdi")
    control = value(ControlReadout, "control")

    @cached_property
    def actuators(self) -> Actuators:
        """The declared actuators."""
        actuators = self._record["prediction"]["actuators"]
        return Actuators(*(actuators[name].copy() for name in ("low", "high", "approach", "step")))

    @cached_property
    def design(self) -> np.void:
        """The design model's record, not a copy, for the functions of `design.model`."""
        return self._record["prediction"]["design"]

    @cached_property
    def true_signals(self) -> np.ndarray:
        """The measured signals beside the rates without errors, in the order of y, SI."""
        truth = self._record["truth"]
        return np.asarray((truth["value"] * truth["factor"])[y_places(self._record)])

    @cached_property
    def origin(self) -> Origin:
        """Where the flight starts."""
        names = "latitude_0", "longitude_0", "radius_m", "parallel_radius_m"
        return Origin(*(float(self._record["truth"][name]) for name in names))

    @cached_property
    def alarmed(self) -> bool:
        """Whether an alarm of the built-in diagnosis stands, of surfaces or of sensors."""
        return any(map(bool, of_diagnosis.alarm_flags(self._record["fdi"])))


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
