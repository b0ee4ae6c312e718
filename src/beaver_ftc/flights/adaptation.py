"""What of one flight may differ from the model, and how far: trim, gain, and each group's own gain.

All start from the model and are bounded, so that a fault from the start is not learnt away. The trim differs
as another loading or rigging would make it (a shift of each group's command) and a little freely; it wanders.
Gains return to the model's in time: airspeed varies about what it was when the model was identified.
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.flights.model import Model
from beaver_ftc.flights.recording import Floats


@dataclass(frozen=True)
class Adaptation:
    """Of the N = 4 + G states: trim (3,) rad/s a sample, gain, own gain of each group.

    mean (N,) and covariance (N, N) before the flight; bound (N,) on the distance from the mean; keep (N,)
    share of that distance left a sample later; walk (N,) variance added a sample.
    """

    mean: Floats
    covariance: Floats
    bound: Floats
    keep: Floats
    walk: Floats


def adaptation_of(model: Model) -> Adaptation:
    """The bounds of adaptation that a model's settings say."""
    settings, groups = model.settings, len(model.groups)
    _, _, response, noise = model.arrays()
    variance = np.diag(noise)
    shift = response.sum(axis=1) * settings.trim_shift
    covariance = np.zeros((4 + groups, 4 + groups))
    covariance[:3, :3] = np.diag(variance * settings.trim_sd**2) + shift.T @ shift
    covariance[3, 3] = settings.gain_sd**2
    covariance[range(4, 4 + groups), range(4, 4 + groups)] = settings.own_gain_sd**2
    times_s = np.array([np.inf] * 3 + [settings.gain_time_s] + [settings.own_gain_time_s] * groups)
    keep = np.exp(-1.0 / (model.rate_hz * times_s))
    walk = (1.0 - keep**2) * np.diag(covariance)
    walk[:3] = variance * np.array(settings.trim_walk) ** 2
    reach = np.array([settings.trim_bound] * 3 + [settings.gain_bound] * (1 + groups))
    mean = np.array([0.0, 0.0, 0.0, 1.0] + [0.0] * groups)
    return Adaptation(mean, covariance, np.sqrt(np.diag(covariance)) * reach, keep, walk)
