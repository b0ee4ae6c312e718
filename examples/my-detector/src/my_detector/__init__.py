"""A detector in under 40 lines: a cumulative sum of what the design model does not explain."""

import numpy as np

from beaver_ftc.diagnosis import Verdict

SURFACE_OF_AXIS = {"p": "aileron", "q": "elevator", "r": "rudder"}


class MyCusum:
    """Two-sided cumulative sum of the innovation over its declared bound [Page1954]."""

    def reset(self, context):
        self.dt = context.dt_s
        self.limit = context.options.get("limit", 3.0)  # how far over the bound, summed over frames
        self.up, self.down = np.zeros(3), np.zeros(3)
        self.before = None
        self.verdict = Verdict()

    def step(self, measured, command):
        if self.before is None:
            self.before = measured.x
            return self.verdict
        innovation = (measured.x - self.before) / self.dt - measured.acceleration  # rad/s2
        share = innovation / np.maximum(measured.eta_bar, 1e-6)  # within 1 while nothing is wrong
        self.up = np.maximum(0.0, self.up + share - 1.0)
        self.down = np.maximum(0.0, self.down - share - 1.0)
        self.before = measured.x
        height = np.maximum(self.up, self.down) / self.limit
        worst = int(np.argmax(height))
        if height[worst] > 1.0 and not self.verdict.detected:
            axis = "pqr"[worst]
            self.verdict = Verdict(True, axis, SURFACE_OF_AXIS[axis])
        return self.verdict._replace(statistic=float(height[worst]))
