"""A frame in which a plug-in diagnoses or commands: its answers are checked, and errors name it."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.control.base import Law, Reference
from beaver_ftc.control.laws import ADAPTIVE, NOMINAL, ORACLE
from beaver_ftc.design.context import Context, DesignFunctions
from beaver_ftc.diagnosis.base import Detector, Measured, Verdict
from beaver_ftc.diagnosis.bounds.variances import declared_of
from beaver_ftc.diagnosis.state import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.documents.errors import BeaverFtcError, SimulationFailed
from beaver_ftc.loop import stepping
from beaver_ftc.loop.assembly import y_places
from beaver_ftc.loop.outcome import verdict_of
from beaver_ftc.plant.sensing import NOT_FINITE
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled, made
from beaver_ftc.scenario.schema import Scenario

_AXES = {"p": 0, "q": 1, "r": 2, None: 0}


class PluginFrame:
    """One frame of the loop with a detector or a law that is not compiled in, called as `stepping.fly_frame`.

    detector, law: the plug-ins, None where the built-in one is in place. names: what to call them when one is
    at fault. begun: the frame that this one follows in flight, whose plug-ins are not begun anew.
    """

    def __init__(
        self,
        detector: Detector | None,
        law: Law | None,
        names: tuple[str, str],
        context: tuple[Context, Context],
        begun: "PluginFrame | None" = None,
    ) -> None:
        self.detector, self.law = detector, law
        self.verdict = Verdict()
        self._names = names
        self._surfaces = surfaces = context[0].surfaces
        self._isolated = {None: NOT_ISOLATED, "unanticipated": UNANTICIPATED}
        self._isolated |= {surface: s for s, surface in enumerate(surfaces)}
        self._t_s = 0.0
        if detector is not None and not (begun and begun.detector is detector):
            self._ask(names[0], detector.reset, context[0])
        if law is not None and not (begun and begun.law is law):
            self._ask(names[1], law.reset, context[1])

    def __call__(self, frames: np.ndarray, references: np.ndarray, log: np.ndarray) -> int:
        """Fly one frame; see `stepping.fly_frame`."""
        status = stepping.measure(frames)
        if status == NOT_FINITE:
            return status
        frame = frames[0]
        self._t_s = float(frame["t"])
        measured = measured_of(frame)
        self._diagnose(frames, measured)
        stepping.decide(frames)
        self._command(frames, references, measured)
        stepping.finish(frames, references, log)
        return status

    def _diagnose(self, frames: np.ndarray, measured: Measured) -> None:
        if self.detector is None:
            stepping.diagnose(frames)
            return
        verdict = self._ask(self._names[0], self.detector.step, measured, frames["belief"]["u"][0].copy())
        self._check(verdict, frames["verdict"][0])
        self.verdict = verdict
        stepping.take_verdict(frames)

    def _command(self, frames: np.ndarray, references: np.ndarray, measured: Measured) -> None:
        if self.law is None or frames["held"][0]:
            stepping.command(frames)
            return
        frame = frames[0]
        control = frame["control"]
        reference = Reference(
            references[int(frame["row"])].copy(),
            control["reference"]["model_rate"].copy(),
            control["reference"]["model_acceleration"].copy(),
        )
        verdict = self.verdict if self.detector is not None else verdict_of(frame, self._surfaces)
        answer = self._ask(self._names[1], self.law.step, measured, reference, verdict)
        stepping.take_command(frames, self._deflections(answer))

    def _ask(self, name: str, question: Any, *arguments: Any) -> Any:
        try:
            return question(*arguments)
        except BeaverFtcError:
            raise
        except (Exception, SystemExit) as error:
            reason = " ".join(str(error).split())
            self._blame(name, f"{question.__name__} raised {type(error).__name__}: {reason}")

    def _blame(self, name: str, what: str) -> None:
        raise SimulationFailed(f"plug-in {name} at {self._t_s:g} s: {what[:500]}")

    def _check(self, verdict: Any, taken: np.void) -> None:
        """Check a verdict and put it into the record that compiled code reads."""
        name = self._names[0]
        if not isinstance(verdict, Verdict):
            self._blame(name, f"step returned {type(verdict).__name__}, allowed: a Verdict")
        if verdict.axis not in _AXES:
            self._blame(name, f"verdict.axis is {verdict.axis!r}, allowed: p, q, r or None")
        if verdict.isolated not in self._isolated:
            allowed = ", ".join(str(key) for key in self._isolated)
            self._blame(name, f"verdict.isolated is {verdict.isolated!r}, allowed: {allowed}")
        taken["detected"], taken["axis"] = bool(verdict.detected), _AXES[verdict.axis]
        taken["isolated"] = self._isolated[verdict.isolated]
        taken["theta"] = 0.0 if verdict.estimate is None else self._finite(verdict.estimate)
        taken["estimates"] = verdict.effectiveness is not None
        if verdict.effectiveness is not None:
            taken["effectiveness"] = self._a_number_each(name, "verdict.effectiveness", verdict.effectiveness)

    def _finite(self, value: Any) -> float:
        if not isinstance(value, float | int | np.floating) or not isfinite(value):
            self._blame(self._names[0], f"verdict.estimate is {value!r}, allowed: a finite number")
        return float(value)

    def _deflections(self, answer: Any) -> np.ndarray:
        return self._a_number_each(self._names[1], "the command", answer)

    def _a_number_each(self, name: str, what: str, values: Any) -> np.ndarray:
        """A finite number for each surface, or the plug-in is to blame."""
        try:
            array = np.asarray(values, dtype=float)
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
        frame["measured"]["y"][: len(y_places(frame))].copy(),
        frame["belief"]["means"]["acceleration"].copy(),
        frame["belief"]["means"]["Gu"].copy(),
        frame["fdi"]["bound"]["eta_bar"].copy(),
    )


def context_of(
    frames: np.ndarray, scenario: Scenario, start: np.ndarray, options: Mapping[str, float]
) -> Context:
    """What a plug-in is given before the flight; start: the truth's channels at the start, in SI."""
    frame = frames[0]
    layout, fdi = frame["control"]["layout"], frame["fdi"]
    trim_y = start[y_places(frame)]
    return Context(
        dt_s=float(frame["dt"]),
        substeps=scenario.substeps,
        model=DesignFunctions(frames["belief"]["design"].copy()),
        trim_x=start[:3].copy(),
        trim_y=trim_y,
        trim_rad=layout["trim"].copy(),
        travel_rad=np.array([layout["low"], layout["high"]]),
        constant_rad_s2=largest_constant(fdi["bound"], scenario),
        inertia_coupling=fdi["bound"]["inertia"].copy(),
        seed=scenario.seed,
        surfaces=scenario.airframe.surfaces,
        leading=(int(layout["main"][0]), int(layout["main"][1]), int(layout["main"][2])),
        options=dict(options),
        declared=declared_of(
            scenario.fdi.bounds,
            scenario.actuators,
            frames["belief"]["design"],
            trim_y,
            layout["trim"],
            scenario.airframe,
        ),
    )


def largest_constant(bound: np.void, scenario: Scenario) -> np.ndarray:
    """The declared constant bound, (3,) rad/s2, with the most the aircraft's terms leave in it."""
    largest: np.ndarray = bound["constant"].copy()
    if bound["error_map"]["n_boxes"]:
        largest += scenario.airframe.model_error_rad_s2
    return largest


def plugin_frame(
    frames: np.ndarray, scenario: Scenario, start: np.ndarray, detector: Detector | None, law: Law | None
) -> PluginFrame | None:
    """The frame with the plug-ins the scenario names, or with these; None if everything is compiled in.

    frames: the assembled record, made ready for them. start: as in `context_of`. Raises BadInput for a name
    that cannot be loaded, SimulationFailed for a plug-in that fails at reset.
    """
    if detector is None:
        detector = named_detector(scenario)
    if law is None:
        law = named_law(frames, scenario, start)
    return plugged(frames, scenario, start, detector, law)


def named_detector(scenario: Scenario) -> Detector | None:
    """The plug-in a scenario names for its diagnosis; None if it is compiled in."""
    scheme = scenario.fdi.scheme
    return None if is_compiled(DETECTORS, scheme) else made(DETECTORS, scheme)


def named_law(frames: np.ndarray, scenario: Scenario, start: np.ndarray) -> Law | None:
    """The plug-in a scenario names for its law; None if it is compiled in, or has a compiled form, which is
    put into the record then. start: as in `context_of`."""
    if is_compiled(LAWS, scenario.control.law):
        return None
    law = made(LAWS, scenario.control.law)
    compile_into = getattr(law, "compile_into", None)
    if compile_into is None:
        return law
    law.reset(context_of(frames, scenario, start, scenario.control.options))
    frames["control"]["power"]["enabled"] = 0
    frames["control"]["inner"] = compile_into(frames["control"]["rival"][0])
    return None


def plugged(
    frames: np.ndarray,
    scenario: Scenario,
    start: np.ndarray,
    detector: Detector | None,
    law: Law | None,
    begun: PluginFrame | None = None,
) -> PluginFrame | None:
    """The frame with these plug-ins, the record made ready for them; None with none. begun: as in
    `PluginFrame`."""
    if detector is None and law is None:
        return None
    if detector is not None:
        _clear_for_detector(frames["fdi"][0])
    if law is not None or frames["control"]["law"][0] != ORACLE:
        frames["control"]["power"]["enabled"] = 0
    if law is not None:
        frames["control"]["law"] = ADAPTIVE if getattr(law, "fault_tolerant", False) else NOMINAL
    contexts = (
        context_of(frames, scenario, start, scenario.fdi.options),
        context_of(frames, scenario, start, scenario.control.options),
    )
    return PluginFrame(detector, law, _names(scenario, detector, law), contexts, begun)


def _names(scenario: Scenario, detector: Detector | None, law: Law | None) -> tuple[str, str]:
    """What to call the plug-ins: by the scenario's names, or by their classes if the scenario did not name
    them."""
    scheme, other = scenario.fdi.scheme, scenario.control.law
    return (
        type(detector).__name__ if is_compiled(DETECTORS, scheme) else scheme,
        type(law).__name__ if is_compiled(LAWS, other) else other,
    )


def _clear_for_detector(fdi: np.void) -> None:
    """No built-in isolation; instead, one estimator a surface for the plug-in's verdict."""
    config, isolation, n = fdi["config"], fdi["isolation"], fdi["types"]["surface"].size
    config["enabled"] = config["every_type"] = isolation["n"] = 0
    fdi["statistical"]["tests"]["enabled"] = fdi["watch"]["enabled"] = 0
    isolation["estimator"]["surface"][:n] = range(n)
