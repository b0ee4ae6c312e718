"""The probe is active diagnosis: it moves flap and elevator against each other.

The flap goes down and back, and the allocation gives the rest of the pitch demand to the elevator. On a
healthy aircraft the two moments cancel. If a surface does not follow, they do not, and the diagnosis detects
it.

    deflection = amplitude (1 - cos phase) / 2,    phase = step probed        rad, of the flap
"""

from math import pi, radians

import numpy as np

from beaver_ftc.compiled import fill, kernel, record
from beaver_ftc.scenario.diagnosis import Probing

# amplitude rad: largest deflection of the flap; step rad: change of the phase in a frame; frames: number of
# frames after which the movement ends when it is next at rest, 0 for no probe.
CONFIG = record(amplitude=float, step=float, frames=int)
# deflection rad of the flap; probed: frames of the present movement, 0 without one; from_s, to_s: when it
# began and ended, s, -1 for never (0 without a probe).
MEMORY = record(deflection=float, probed=int, from_s=float, to_s=float)
PROBE = record(config=CONFIG, memory=MEMORY)


def configure_probe(probe: np.void, probing: Probing | None, dt: float) -> None:
    """Fill the record (dtype PROBE) for frames of dt s."""
    if probing is not None:
        fill(
            probe["config"], amplitude=radians(probing.amplitude_deg),
            step=2.0 * pi * probing.frequency_hz * dt, frames=round(probing.duration_s / dt),
        )  # fmt: skip
        fill(probe["memory"], from_s=-1.0, to_s=-1.0)


@kernel
def advance_probe(probe, wanted, t):
    """Bring the probe to the next frame, at t s. It begins once in a flight, when it is wanted. It ends at
    rest, that is after a whole period, once it is no longer wanted or has lasted config.frames."""
    config = probe.config
    memory = probe.memory
    if memory.probed == 0:
        if not wanted or memory.from_s >= 0.0:
            return
        memory.from_s = t
    phase = config.step * memory.probed
    at_rest = phase % (2.0 * pi) < config.step
    if at_rest and (not wanted or memory.probed >= config.frames):
        memory.deflection = 0.0
        memory.probed = 0
        memory.to_s = t
        return
    memory.deflection = 0.5 * config.amplitude * (1.0 - np.cos(phase))
    memory.probed += 1
