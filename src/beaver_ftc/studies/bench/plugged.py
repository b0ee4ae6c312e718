"""The least a user may plug in: a detector and a law in Python, to time their way through the loop."""

import numpy as np

from beaver_ftc.control.base import Reference
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis.base import Measured, Verdict


class InnovationDetector:
    """Alarms when the rates do what neither the design model nor its declared error explains."""

    def reset(self, context: Context) -> None:
        """Nothing seen yet."""
        self._dt_s = context.dt_s
        self._before: np.ndarray | None = None
        self._detected = False

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Compare the frame that has elapsed with the model's."""
        if self._before is not None:
            innovation = (measured.x - self._before) / self._dt_s - measured.acceleration
            self._detected = self._detected or bool((np.abs(innovation) > measured.eta_bar).any())
        self._before = measured.x
        return Verdict(detected=self._detected)


class ProportionalInversion:
    """Inverts the design model on a proportional feedback, with the flap left in trim."""

    _FEEDBACK_PER_S = 3.0

    def reset(self, context: Context) -> None:
        """Keep the model and the trim."""
        self._model, self._flap_rad = context.model, context.trim_rad[3]

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Ask the three main surfaces for what the reference model does, and for what is missing."""
        G = self._model.G(measured.y)
        feedback = self._FEEDBACK_PER_S * (reference.rate - measured.x)
        wanted = reference.acceleration + feedback - self._model.f(measured.x, measured.y)
        return np.append(np.linalg.solve(G[:, :3], wanted - G[:, 3] * self._flap_rad), self._flap_rad)
