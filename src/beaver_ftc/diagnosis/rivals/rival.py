"""What the rival detectors share: options, the gust that vanes measure, the alarm, the words of a verdict."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options
from beaver_ftc.diagnosis.rivals.gust import VaneGust

UNANTICIPATED = Verdict(True, None, "unanticipated", "unanticipated")


class RivalDetector:
    """Base of the rival detectors; each has `start`, `advance` and `isolate`, and may have
    `begin_isolation`.

    After `reset`, options has the parameters, context and dt (s) are those of the flight (its turbulence: see
    `reset`), leading (3,) has the surfaces that lead roll, pitch and yaw, and alarm_s (inf: none yet)
    and alarm_axis describe the alarm. A detector with one statistic has the alarm axis 0.
    """

    name: ClassVar[str] = ""
    defaults: ClassVar[Mapping[str, float]] = {}

    def reset(self, context: Context) -> None:
        """Prepare for a flight. Where vanes measure the gust, `step` subtracts its effect from the
        innovation. The context of the detector then declares only the rest of the turbulence."""
        self.options = rival_options(self.name, self.defaults, context)
        self.vane_gust = VaneGust(context)
        self.context = self.vane_gust.context
        self.dt = context.dt_s
        self.leading = list(context.leading)
        self.alarm_s = np.inf
        self.alarm_axis = 0
        self.start()

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Advance by a frame; from the alarm on, isolate."""
        measured = self.vane_gust.subtracted(measured)
        statistics = np.atleast_1d(self.advance(measured, command))
        statistic = float(statistics.max())
        if statistic > 1.0 and self.alarm_s == np.inf:
            self.alarm_s = measured.t_s
            self.alarm_axis = int(statistics.argmax())
            self.begin_isolation()
        verdict = Verdict() if self.alarm_s == np.inf else self.isolate(measured)
        return verdict._replace(statistic=statistic)

    def loss(self, i: int, theta: float, effectiveness: np.ndarray | None = None) -> Verdict:
        """The verdict that the main surface of axis i has lost effectiveness; theta: size, -1 to 0."""
        name = self.context.leaders[i]
        return Verdict(True, "pqr"[i], name, "loss_of_effectiveness", theta, effectiveness)

    def start(self) -> None:
        """Set the memory to that of a healthy flight."""
        raise NotImplementedError

    def advance(self, measured: Measured, command: np.ndarray) -> float | np.ndarray:
        """Decision statistics of this frame, one or one for each axis; the alarm is at 1."""
        raise NotImplementedError

    def begin_isolation(self) -> None:
        """Prepare at the alarm, before the first `isolate`."""

    def isolate(self, measured: Measured) -> Verdict:
        """The verdict of a frame from the alarm on; its `detected` is True."""
        raise NotImplementedError
