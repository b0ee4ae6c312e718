"""The test that is told the fault, on a recorded flight of the survey."""

import numpy as np

from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.studies.compare.replay import Recording
from beaver_ftc.studies.engine.told import Whitening


def deflections(
    recording: Recording, surface: str, magnitude: float, within_s: tuple[float, ...]
) -> list[float]:
    """d of a loss of effectiveness in a recorded flight, as long after it struck."""
    since = [measured for measured, _ in recording.seen if measured.t_s > recording.fault_at_s + 1e-9]
    if not since:
        return [0.0] * len(within_s)
    moment = np.array([measured.contribution[:, SURFACES.index(surface)] for measured in since])
    d = Whitening(recording.context).deflection(-magnitude * moment)
    frames = [round(s / recording.context.dt_s) for s in within_s]
    return [float(d[min(n, len(d)) - 1]) for n in frames]
