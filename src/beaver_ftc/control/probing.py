"""Active diagnosis: move flap and elevator against each other, so that a healthy aircraft feels nothing.

The flap goes down and back by (1 - cos) / 2; the allocation gives the elevator what the flap does not leave.
A surface that does not follow then shows.
"""

import numpy as np

from beaver_ftc.compiled import kernel


@kernel
def advance(control, wanted, t):
    """Bring the probe to the next frame, t s: begin when wanted, end with the movement when no longer."""
    if control.probed == 0:
        if not wanted or control.probe_from_s >= 0.0:
            return
        control.probe_from_s = t
    phase = control.probe_step * control.probed
    at_rest = phase % (2.0 * np.pi) < control.probe_step
    if control.probed > 0 and at_rest and (not wanted or control.probed >= control.probe_frames):
        control.probe, control.probed, control.probe_to_s = 0.0, 0, t
        return
    control.probe = 0.5 * control.probe_amplitude * (1.0 - np.cos(phase))
    control.probed += 1
