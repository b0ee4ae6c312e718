"""Monitors of what is not a control surface: sensors by their redundancy, engines by their symmetry."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

if TYPE_CHECKING:
    from beaver_ftc.diagnosis.monitors.engine_symmetry import THRUST, YAWING, mean_arm
    from beaver_ftc.diagnosis.monitors.redundancy import N_COMPUTED, RPM
else:
    __getattr__, __dir__ = lazily(__name__)
