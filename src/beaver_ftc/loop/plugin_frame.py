"""A frame in which a plug-in diagnoses or commands: its answers are checked, and errors name it.

    begin -> diagnose -> decide -> command | take_command -> finish

are the stages of frame.py; left of the bar: built in, right of it: a plug-in's answer. A plug-in's verdict is
taken by `diagnose` (adaptive_estimators.plugin_update).
"""

from collections.abc import Callable
from copy import deepcopy
from math import isfinite
from typing import Any

import numpy as np

from beaver_ftc.compiled import direct
from beaver_ftc.control import Law, Reference
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.diagnosis.conclusion import NOT_ISOLATED, UNANTICIPATED
from beaver_ftc.documents.errors import NO_FAILURE, SimulationFailed
from beaver_ftc.loop import stepping as stages
from beaver_ftc.loop.assembly import Trim
from beaver_ftc.loop.findings import verdict_of
from beaver_ftc.loop.plugin_context import context_of, measured_of
from beaver_ftc.plant.sensing import NOT_FINITE
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled
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
        # The size of a type that is no loss is an angle, which says nothing of the effectiveness.
        is_loss = verdict.estimate is not None and verdict.type in (None, "loss_of_effectiveness")
        theta = verdict.estimate if is_loss else 0.0
        taken["detected"], taken["axis"] = bool(verdict.detected), _AXES[verdict.axis]
        taken["isolated"], taken["theta"] = self._isolated[verdict.isolated], theta
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
