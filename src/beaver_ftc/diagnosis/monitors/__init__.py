"""Monitors of what is not a control surface: sensors by their redundancy, engines by their symmetry."""

from typing import TYPE_CHECKING

from beaver_ftc.public import lazily

# Published to other packages. They are imported at first use, so one monitor does not import the others.
if TYPE_CHECKING:
    from beaver_ftc.diagnosis.monitors.engine_monitor import THRUST_SIGNAL, YAW_SIGNAL, yaw_per_thrust
    from beaver_ftc.diagnosis.monitors.numbering import RPM_TEST
    from beaver_ftc.diagnosis.monitors.redundancy import COMPARISON_ROUNDING
else:
    __getattr__, __dir__ = lazily(__name__)
