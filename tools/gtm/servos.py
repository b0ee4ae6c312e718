"""Surfaces and engines of the specification between command and position."""

from math import pi
from typing import Any

import numpy as np
from scipy.linalg import expm

from tools.gtm.specification import STEP_S, SURFACES, Controls


class Servos:
    """Surfaces and engines between command and position. A surface has a delay of 15 ms, and follows as a
    first-order system of 5 Hz, within 300 deg/s and its stops; an engine has its spool. The step is exact for
    a command that is constant in it, unless the rate is limited."""

    def __init__(self, of: dict[str, Any], command: Controls) -> None:
        self.limits = {name: ends for name, ends in of["actuators"]["limits"].items() if name in SURFACES}
        self.at = dict(command.surfaces)
        self._late = [dict(command.surfaces)] * 3
        spool = of["engines"]["spool"]
        A, B = np.array(spool["A"], float), np.array(spool["B"], float)
        self.C = np.array(spool["C"])
        of_a_step = expm(STEP_S * np.block([[A, B[:, None]], [np.zeros((1, 3))]]))
        self.A, self.B = of_a_step[:2, :2], of_a_step[:2, 2]
        self.spools = [np.array([0.0, throttle / 0.7314]) for throttle in command.throttles]

    def move(self, command: Controls) -> Controls:
        """Advance by one step; returns the positions."""
        self._late.append(dict(command.surfaces))
        asked = self._late.pop(0)
        share, most = 1.0 - np.exp(-2.0 * pi * 5.0 * STEP_S), 300.0 * STEP_S
        for name, (low, high) in self.limits.items():
            wanted = min(max(asked[name], low), high)
            self.at[name] += float(np.clip((wanted - self.at[name]) * share, -most, most))
        self.at["STAB"] = asked["STAB"]
        lagged = tuple(float(self.C @ spool) for spool in self.spools)
        self.spools = [self.A @ s + self.B * u for s, u in zip(self.spools, command.throttles, strict=True)]
        return Controls(dict(self.at), (lagged[0], lagged[1]))
