"""The base of the rival laws that fly compiled: their `step` calls the kernels of laws/compiled_rivals.py.

If a scenario names such a law, the kernels of the loop fly it, and `step` is not called. `step` serves an
object of the class that is given to the loop, or that a plug-in registers by another name.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from beaver_ftc.control import Reference
from beaver_ftc.control.laws.compiled_rivals import add_command, rival_dtype
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.diagnosis.rivals import rival_options

GAINS = {"proportional_per_s": 2.0, "integral_per_s2": 1.0}  # Kp and Ki of a law with such a feedback


class KernelLaw:
    """A law that moves the surfaces that lead roll, pitch and yaw; the others stay in trim."""

    name: ClassVar[str]
    defaults: ClassVar[Mapping[str, float]]
    fault_tolerant = False

    def reset(self, context: Context) -> None:
        """Prepare for a flight, in trim, with integrals of 0; `axes` (3,): surfaces that lead the axes."""
        self.context = context
        self.option = rival_options(self.name, self.defaults, context)
        self.law = np.zeros(1, rival_dtype(len(context.surfaces)))[0]
        self.axes = np.array(context.leading)
        self.compile_into(self.law)

    def compile_into(self, law: np.void) -> None:
        """Fill the record of the kernels (`rival_dtype`), in trim."""
        raise NotImplementedError

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """The command (surfaces,) rad, within the travel."""
        context = self.context
        wanted = self.context.trim_rad.copy()
        add_command(
            self.law, context.dt_s, reference.rate, reference.acceleration, self.axes, measured.x,
            measured.contribution, context.model.G(measured.y), np.zeros(3), wanted,
        )  # fmt: skip
        command: np.ndarray = np.clip(wanted, *context.travel_rad)
        self.law["memory"]["saturated"] = (command != wanted).sum()
        return command
