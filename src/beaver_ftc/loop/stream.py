"""The diagnosis as a stream, without JSBSim: for another simulator, a log, an autopilot."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.compiled import direct
from beaver_ftc.design.table import N_Y
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop import stepping, watching
from beaver_ftc.loop.assembly import Trim, configure_design, configure_diagnosis_at_trim
from beaver_ftc.loop.findings import estimate_now, verdict_of, words_follow_from
from beaver_ftc.plugins import DETECTORS, is_compiled
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.scenario.schema import Scenario, load

Vector = NDArray[np.float64]
FLOW = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa")  # signals every aircraft measures
Start = tuple[ArrayLike, ArrayLike, ArrayLike]
_START = ("rates_rad_s", "signals", "command_rad")


class Diagnosis:
    """The built-in diagnosis of an aircraft without a simulation: one call of `step` for each sample.

        diagnosis = Diagnosis(aircraft("beaver"), rate_hz=100, fdi={"bounds": {"inertia": 0.05}})
        verdict = diagnosis.step(rates_rad_s, signals, command_rad)

    - `aircraft`: the aircraft. Its file states the surfaces and their travel.
    - `rate_hz`: number of samples in a second. The samples are evenly spaced.
    - `fdi`, `actuators`, `design_model`: contents of the sections with these names in a scenario file. The
      sensors are assumed to be sound, whatever the fault class: `step` takes no accelerations.
    - `start`: three arrays in trim: rates (3,) rad/s, signals (4 + signals,), and deflections of the surfaces
      (surfaces,) rad. The linearised design model and the statistical detector need these values. By default
      the values of the first sample are used.

    Attributes: `declared` lists the errors that `fdi.bounds` declares, and the parts of the diagnosis that
    use these errors. `t_s` is the time from the first sample to the last, s. `config` is the section `fdi`
    with all defaults.

    The memory of the diagnosis is one record of fixed size. Raises BadInput if a key or value is wrong. The
    message names the key.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        rate_hz: float = 100.0,
        fdi: Mapping[str, Any] | None = None,
        *,
        actuators: Any = "ideal",
        design_model: Mapping[str, Any] | None = None,
        start: Start | None = None,
    ) -> None:
        if not isinstance(aircraft, Aircraft):
            raise BadInput(f"aircraft: {aircraft!r:.60} is none, allowed: what aircraft() gives")
        if not (start is None or (isinstance(start, tuple | list) and len(start) == len(_START))):
            raise BadInput(f"start: {start!r:.60} is not usable, allowed: three arrays: {', '.join(_START)}")
        said = dict(fdi or {})
        if said.get("sensor_monitor") in (None, "auto"):
            said["sensor_monitor"] = "never"  # `step` takes no accelerations, which the monitor compares
        given = {
            "name": "stream", "rate_hz": rate_hz, "fdi": said, "actuators": actuators,
            "design_model": design_model or {},
        }  # fmt: skip
        with checked_against(aircraft):
            self._scenario = load(given)
        self._aircraft, self._start = aircraft, start
        self.declared = Declared.of(self._scenario)
        if not is_compiled(DETECTORS, scheme := self._scenario.fdi.scheme):
            allowed = "adaptive-estimators (step a plug-in itself)"
            raise BadInput(f"fdi.scheme: {scheme} is plugged in, allowed: {allowed}")
        if not self._scenario.fdi.diagnoses:
            allowed = "adaptive-estimators, zhang2005"
            raise BadInput(f"fdi.scheme: {scheme}: no diagnosis would run, allowed: {allowed}")
        if self._scenario.fdi.probing is not None:
            raise BadInput("fdi.probing: moves surfaces, allowed here: a diagnosis that only looks on")
        self.reset()

    def reset(self) -> None:
        """Delete the memory of the diagnosis. The next sample then counts as the first sample of a flight."""
        travel = self.declared.travel_rad
        self._frames = configure_design(self._scenario, travel)
        self._frame = self._frames[0]
        self._fdi = self._frame["fdi"]
        self._fdi["engine_monitor"]["config"]["n_engines"] = 0  # nobody says where levers are
        self._attitude, command = np.zeros(3), np.zeros(travel.shape[1])
        self._altitude_m = self._scenario.initial.altitude_m
        self._y = np.zeros_like(self._frame["measured"]["y"])  # beyond the aircraft's own signals always zero
        self._signals = self._y[: len(FLOW) + len(self._aircraft.signals)]
        self._take = direct(watching.take, self._frames, self._attitude, self._y, command, self._attitude)
        self._diagnose = direct(stepping.diagnose, self._frames)
        self._accommodate_and_advance = direct(watching.accommodate_and_advance, self._frames)
        self._theta = direct(watching.theta, self._frames)
        self._said, self._followed = Verdict(), b""
        self._fresh = True

    @property
    def t_s(self) -> float:
        """Time of the last sample, s since the first."""
        return float(self._frame["t"])

    def step(
        self,
        rates_rad_s: ArrayLike,
        signals: ArrayLike,
        command_rad: ArrayLike,
        attitude_rad: ArrayLike | None = None,
        altitude_m: float | None = None,
    ) -> Verdict:
        """Diagnose one further sample, and return the verdict of all samples up to this one.

        - `rates_rad_s` (3,) rad/s: measured p, q and r.
        - `signals` (4 + signals,): angle of attack rad, sideslip rad, airspeed m/s, dynamic pressure Pa, and
          the signals that the aircraft declares. The Beaver declares one, `dpt`.
        - `command_rad` (surfaces,) rad: command that was active since the previous sample. For the first
          sample, give the deflections in trim.
        - `attitude_rad` (3,) rad: roll, pitch and yaw angle. The angles are required if `fdi.bounds` declares
          turbulence.
        - `altitude_m`: measured altitude above sea level, m. The altitude is used only if turbulence is
          declared, because turbulence depends on the height. If you leave it out, the previous altitude is
          used. Before the first altitude, 1828.8 m is used.

        Raises BadInput for a wrong shape, and for a value that is infinite or NaN. Such a sample is ignored.
        """
        x = _numbers("rates_rad_s", rates_rad_s, 3)
        self._signals[:] = _numbers("signals", signals, self._signals.size)
        command = _numbers("command_rad", command_rad, len(self._aircraft.surfaces))
        attitude, altitude = self._attitude, self._altitude_m
        if attitude_rad is not None:
            attitude = _numbers("attitude_rad", attitude_rad, 3)
        elif self.declared.air.moves:
            raise BadInput("attitude_rad: is missing, allowed: (3,) rad where fdi.bounds declares turbulence")
        if altitude_m is not None:
            altitude = float(_numbers("altitude_m", np.atleast_1d(altitude_m), 1)[0])
        if self._fresh:
            self._begin(x, command)
        self._frame["measured"]["altitude"] = altitude
        if not (isfinite(altitude) and self._take(self._frames, x, self._y, command, attitude)):
            raise BadInput(f"the sample after {self.t_s:g} s is not finite, allowed: finite numbers")
        self._attitude, self._altitude_m = attitude, altitude
        self._diagnose(self._frames)
        self._accommodate_and_advance(self._frames)
        if not self._fdi["verdict"]["detected"]:
            return Verdict()
        # words are looked for only when there are others: of a loss in noise they take a frame's time
        if (follows := words_follow_from(self._fdi)) != self._followed:
            self._followed, self._said = follows, verdict_of(self._frame, self._aircraft.surfaces)
        elif self._said.estimate is not None:
            self._said = self._said._replace(estimate=self._estimate())
        return self._said

    @property
    def config(self) -> FdiConfig:
        """What it goes by: `fdi` with all defaults."""
        return self._scenario.fdi

    def innovation(self) -> tuple[Vector, Vector, Vector]:
        """Three arrays of the last frame in rad/s²: the innovation (3,), its bound (3,), and the effect of
        each surface (3, surfaces).

        The last frame ends with the last sample. The bound follows from the declared errors. The effects are
        predictions of the design model.
        """
        innovation = self._fdi["bank"]["output"]["innovation"]
        bound = self._fdi["bound"]["nu_max"]
        return innovation.copy(), bound.copy(), self._frame["prediction"]["means"]["Gu"].copy()

    def model(self) -> tuple[Vector, Vector]:
        """The design model xdot = f + G u at the last sample, as the tuple (f, G): f (3,) rad/s², G (3,
        surfaces) rad/s² for each rad.
        """
        prediction = self._frame["prediction"]
        return prediction["f"].copy(), prediction["G"].copy()

    def inside(self) -> tuple[np.ndarray, Scenario]:
        """The memory of the diagnosis as a structured array (1,), and the scenario of this diagnosis.

        Use it to inspect or record the state of the diagnosis after a sample.
        """
        return self._frames, self._scenario

    def _estimate(self) -> float | None:
        if self._scenario.fdi.fault_class == "published":
            return float(self._theta(self._frames))
        return estimate_now(self._fdi, self._said, self._aircraft.surfaces)

    def _begin(self, x: Vector, command: Vector) -> None:
        """Configure what depends on the trim: `start`, or the first sample."""
        first = [x, self._signals.copy(), command]
        if self._start is not None:
            parts = zip(_START, self._start, first, strict=True)
            first = [_numbers(what, np.asarray(given), part.size) for what, given, part in parts]
            if not all(np.isfinite(part).all() for part in first):
                raise BadInput("start: is not finite, allowed: finite numbers")
        if all(np.isfinite(part).all() for part in first):
            x, y, u = first
            configure_diagnosis_at_trim(self._frame, self._scenario, Trim(x, y, u, u))
            self._fresh = False


def _numbers(what: str, given: Any, size: int) -> Vector:
    """So many numbers, copied, or what is wrong with them.

    The loop's own record of the signals has room for more than an aircraft declares: it fits as well.
    """
    try:
        if len(given) in (size, N_Y if what == "signals" else size):
            numbers = np.empty(size)
            numbers[:] = given[:size]
            return numbers
    except (TypeError, ValueError):
        pass
    shown = " ".join(repr(given).split())
    raise BadInput(f"{what}: {shown:.80} does not fit, allowed: {size} numbers")
