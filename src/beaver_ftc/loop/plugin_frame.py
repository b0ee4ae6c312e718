"""A frame in which a plug-in diagnoses or commands: its answers are checked, and errors name it.

    begin -> diagnose -> decide -> command | take_command -> finish

are the stages of frame.py; left of the bar: built in, right of it: a plug-in's answer. A plug-in's verdict is
taken by `diagnose` (adaptive_estimators.plugin_update).
"""

from collections.abc import Callable, Mapping
from copy import deepcopy
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.compiled import direct
from beaver_ftc.control import Law, Reference, has_kernels, row_of
from beaver_ftc.design.context import Context
from beaver_ftc.design.model import DesignFunctions
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.diagnosis.deviations import plugin_errors
from beaver_ftc.diagnosis.state import (
    NOT_ISOLATED,
    PLUGIN_SCHEME,
    UNANTICIPATED,
    WORST_CASE_DETECTOR,
)
from beaver_ftc.documents.errors import NO_FAILURE, SimulationFailed
from beaver_ftc.loop import stepping as stages
from beaver_ftc.loop.assembly import Trim
from beaver_ftc.loop.findings import verdict_of
from beaver_ftc.plant.sensing import NOT_FINITE
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled, made
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

_AXES = {"p": 0, "q": 1, "r": 2, None: 0}
_REAL = "biuf"  # kinds of NumPy's types whose values are real numbers
_NUMBER = (float, int, np.floating, np.integer)


def _is_number(given: Any) -> bool:
    return isinstance(given, _NUMBER)


def _is_estimate(given: Any) -> bool:
    try:
        return given is None or (_is_number(given) and isfinite(given))
    except OverflowError:  # an int beyond every float
        return False


def _is_text(given: Any) -> bool:
    return isinstance(given, str)


# What each field of a verdict may be, besides which surface is isolated: that depends on the aircraft.
_ALLOWED: tuple[tuple[str, Callable[[Any], bool], str], ...] = (
    (
        "detected",
        lambda given: isinstance(given, bool | np.bool_ | int | np.integer) and given in (0, 1),
        "True or False",
    ),
    ("axis", lambda given: given is None or (_is_text(given) and given in _AXES), "p, q, r or None"),
    ("type", lambda given: given is None or _is_text(given), "a str or None"),
    ("estimate", _is_estimate, "a finite number"),
    ("statistic", _is_number, "a number"),
    (
        "candidates",
        lambda given: isinstance(given, tuple | list) and all(map(_is_text, given)),
        "a tuple of str",
    ),
)


class PluginFrame:
    """One frame of the loop with a detector or a law that is not compiled in, called as `stepping.fly_frame`.

    detector, law: the plug-ins, None where the built-in one is in place. trim: as in `context_of`.
    begun: the frame that this one follows in flight, whose plug-ins are not restarted.
    """

    def __init__(
        self,
        frames: np.ndarray,
        scenario: Scenario,
        trim: Trim,
        detector: Detector | None,
        law: Law | None,
        begun: "PluginFrame | None",
    ) -> None:
        self.detector, self.law, self.verdict, self.t_s = detector, law, Verdict(), 0.0
        self._direct: dict[Any, Any] = {}  # machine code of stages: for flights of records of one shape
        self._surfaces = surfaces = scenario.airframe.surfaces
        self._isolated = {None: NOT_ISOLATED, "unanticipated": UNANTICIPATED}
        self._isolated |= {surface: s for s, surface in enumerate(surfaces)}
        scheme, other = scenario.fdi.scheme, scenario.control.law
        self._names = (  # to blame: the scenario's, or those of their classes if it does not name them
            type(detector).__name__ if is_compiled(DETECTORS, scheme) else scheme,
            type(law).__name__ if is_compiled(LAWS, other) else other,
        )
        if detector is not None and not (begun and begun.detector is detector):
            context = context_of(frames, scenario, trim, scenario.fdi.options)
            self._ask(self._names[0], detector.reset, context)
        if law is not None and not (begun and begun.law is law):
            context = context_of(frames, scenario, trim, scenario.control.options)
            self._ask(self._names[1], law.reset, context)

    def __call__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> int:
        """Fly one frame; see `stepping.fly_frame`."""
        frame = frames[0]
        status = self._stage(stages.begin, frames)
        if status == NOT_FINITE:
            return status
        row, measured = int(frame["row"]), measured_of(frame)
        self.t_s = measured.t_s
        self._diagnose(frames, measured)
        self._stage(stages.decide, frames)
        self._command(frames, references[row], measured)
        self._stage(stages.finish, frames, references, log)
        return status

    def _stage(self, stage: Any, *arrays: np.ndarray) -> int:
        """Call a stage's machine code."""
        if stage not in self._direct:
            self._direct[stage] = direct(stage, *arrays)
        return self._direct[stage](*arrays)

    def _diagnose(self, frames: np.ndarray, measured: Measured) -> None:
        frame = frames[0]
        if self.detector is not None:
            answer = self._ask(self._names[0], self.detector.step, measured, frame["prediction"]["u"].copy())
            self.verdict = self._checked(answer, frame["fdi"]["plugin_verdict"])
        self._stage(stages.diagnose, frames)

    def _command(self, frames: np.ndarray, commanded: np.ndarray, measured: Measured) -> None:
        frame = frames[0]
        if self.law is None or frame["held"]:
            self._stage(stages.command, frames)
            return
        name, model = self._names[1], frame["control"]["reference"]["output"]
        reference = Reference(
            commanded.copy(), model["model_rate"].copy(), model["model_acceleration"].copy()
        )
        if self.detector is None:
            verdict = verdict_of(frame, self._surfaces)
        else:  # which may have written into its own
            verdict, measured = self.verdict, deepcopy(measured)
        answer = self._ask(name, self.law.step, measured, reference, verdict)
        self._stage(stages.take_command, frames, self._a_number_each(name, "the command", answer))

    def _ask(self, name: str, question: Any, *arguments: Any) -> Any:
        try:
            return question(*arguments)
        except NO_FAILURE:
            raise
        except BaseException as error:
            reason = " ".join(str(error).split())
            self._blame(name, f"{question.__name__} raised {type(error).__name__}: {reason}")

    def _blame(self, name: str, what: str) -> None:
        raise SimulationFailed(f"plug-in {name} at {self.t_s:g} s: {what[:500]}")

    def _checked(self, verdict: Any, taken: np.void) -> Verdict:
        """A verdict that is one, put into the record that compiled code reads."""
        name = self._names[0]
        if not isinstance(verdict, Verdict):
            self._blame(name, f"step returned {type(verdict).__name__}, allowed: a Verdict")
        for field, is_allowed, allowed in _ALLOWED:
            if not is_allowed(given := getattr(verdict, field)):
                self._blame(name, f"verdict.{field} is {given!r}, allowed: {allowed}")
        if not isinstance(verdict.isolated, str | None) or verdict.isolated not in self._isolated:
            allowed = ", ".join(str(key) for key in self._isolated)
            self._blame(name, f"verdict.isolated is {verdict.isolated!r}, allowed: {allowed}")
        estimate = 0.0 if verdict.estimate is None else verdict.estimate
        taken["detected"], taken["axis"] = bool(verdict.detected), _AXES[verdict.axis]
        taken["isolated"], taken["theta"] = self._isolated[verdict.isolated], estimate
        taken["has_effectiveness"] = verdict.effectiveness is not None
        if verdict.effectiveness is not None:
            taken["effectiveness"] = self._a_number_each(name, "verdict.effectiveness", verdict.effectiveness)
        return verdict

    def _a_number_each(self, name: str, what: str, values: Any) -> np.ndarray:
        """A finite number for each surface, or the plug-in is to blame."""
        try:
            given = np.asarray(values)
            array = given.astype(float) if given.dtype.kind in _REAL else np.empty(0)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (len(self._surfaces),):
            shape = f"shape {array.shape}" if array.size else f"type {type(values).__name__}"
            self._blame(name, f"{what} has {shape}, allowed: {len(self._surfaces)} numbers")
        if not np.isfinite(array).all():
            self._blame(name, f"{what} is not finite: {array.tolist()}")
        return array


def measured_of(frame: np.void) -> Measured:
    """What is known at the frame just flown."""
    return Measured(
        float(frame["t"]),
        frame["measured"]["x"].copy(),
        frame["measured"]["y"][: 4 + int(frame["truth"]["declared"])].copy(),
        frame["prediction"]["means"]["F"].copy(),
        frame["prediction"]["means"]["Gu"].copy(),
        frame["fdi"]["bound"]["eta_bar"].copy(),
        frame["measured"]["attitude"].copy(),
        frame["measured"]["force"].copy(),
        float(frame["measured"]["altitude"]),
    )


def context_of(frames: np.ndarray, scenario: Scenario, trim: Trim, options: Mapping[str, float]) -> Context:
    """What a plug-in is given before the flight; trim: what is known of it."""
    frame, aircraft = frames[0], scenario.airframe
    layout, bound, design = frame["control"]["layout"], frame["fdi"]["bound"], frames["prediction"]["design"]
    constant = bound["const"].copy()
    if bound["error_map"]["n_boxes"]:
        constant += aircraft.model_error_rad_s2  # the most that the aircraft's terms leave in it
    return Context(
        dt_s=float(frame["dt"]),
        substeps=scenario.substeps,
        model=DesignFunctions(design.copy()),
        trim_x=trim.x.copy(),
        trim_y=trim.y.copy(),
        trim_rad=trim.command.copy(),
        travel_rad=np.array([layout["low"], layout["high"]]),
        constant_rad_s2=constant,
        inertia_coupling=bound["inertia_coupling_error_share"].copy(),
        surfaces=aircraft.surfaces,
        leading=(int(layout["main"][0]), int(layout["main"][1]), int(layout["main"][2])),
        options=dict(options),
        declared=plugin_errors(Declared.of(scenario), design, trim.y, trim.u),
    )


def named_detector(scenario: Scenario) -> Detector | None:
    """The plug-in a scenario names for its diagnosis; None if it is compiled in.

    Raises BadInput for a name that cannot be loaded.
    """
    scheme = scenario.fdi.scheme
    return None if is_compiled(DETECTORS, scheme) else made(DETECTORS, scheme)


def named_law(frames: np.ndarray, scenario: Scenario, trim: Trim) -> Law | None:
    """The plug-in a scenario names for its law; None if it is compiled in, or has a compiled form, which is
    put into the record then. trim: as in `context_of`. Raises as `named_detector` does."""
    if is_compiled(LAWS, scenario.control.law):
        return None
    law = made(LAWS, scenario.control.law)
    compile_into = getattr(law, "compile_into", None)
    if compile_into is None or not has_kernels(scenario.control.law):
        return law
    law.reset(context_of(frames, scenario, trim, scenario.control.options))
    control = frames["control"][0]
    control["power"]["config"]["enabled"] = 0
    compile_into(control[row_of(scenario.control.law).file])
    return None


def plugged(
    frames: np.ndarray,
    scenario: Scenario,
    trim: Trim,
    detector: Detector | None,
    law: Law | None,
    begun: PluginFrame | None = None,
) -> PluginFrame | None:
    """The frame with these plug-ins, the record made ready for them; None with none. begun: as in
    `PluginFrame`. Raises SimulationFailed for a plug-in that fails at reset."""
    if detector is None and law is None:
        return None
    if detector is not None:  # no built-in isolation; instead, one estimator a surface for its verdict
        fdi = frames["fdi"][0]
        fdi["config"]["enabled"] = fdi["config"]["diagnoses_all_types"] = fdi["isolation"]["config"][
            "n_estimators"
        ] = 0
        fdi["statistical"]["test"]["enabled"] = fdi["sensor_monitor"]["config"]["enabled"] = 0
        fdi["config"]["scheme_number"] = PLUGIN_SCHEME
        fdi["config"]["exclusion_authority"] = WORST_CASE_DETECTOR
        fdi["types"]["pair"]["enabled"] = 0
        n = fdi["types"]["surface"].size
        fdi["isolation"]["estimator"]["surface"][:n] = range(n)
    if law is not None:
        control = frames["control"][0]
        control["power"]["config"]["enabled"] = 0
        config = control["config"]
        config["uses_verdict"], config["reallocates"] = getattr(law, "fault_tolerant", False), 0
        config["informed"] = 0
    return PluginFrame(frames, scenario, trim, detector, law, begun)
