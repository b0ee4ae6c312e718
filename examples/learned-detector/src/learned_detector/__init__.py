"""A learned detector: a small network names the surface from features of the innovation.

The network is trained by train.py; in flight it is four arrays and two products. The alarm level follows from
healthy flights by split conformal prediction, so that the rate of false alarms per flight is bounded for
flights that are drawn as those were [Vovk2005].
"""

import os
from pathlib import Path

import numpy as np

from beaver_ftc.diagnosis import Verdict

VARIABLE = "LEARNED_DETECTOR"  # names the file of a trained network, if it is not learned.npz in this folder
CLASSES = ("none", "aileron", "elevator", "rudder")
MEMORY_S = (0.1, 1.0)  # over which the features are averaged
N_FEATURES = 9 * len(MEMORY_S)


class Features:
    """What the network is shown at a frame: of each memory, how much of the innovation each surface explains.

    Of the innovation nu over the declared bound, and the effect c_s of a surface, with fading means < >:
    <nu^2> of each axis, <nu c_s> / sqrt(<c_s^2>) and log <c_s^2> of each surface.
    """

    def __init__(self, context):
        self.dt, self.leading, self.before = context.dt_s, list(context.leading), None
        self.keep = np.exp(-context.dt_s / np.array(MEMORY_S))[:, None]
        self.square, self.cross, self.effect = (np.zeros((len(MEMORY_S), 3)) for _ in range(3))

    def step(self, measured):
        """The features (N_FEATURES,) at this frame."""
        if self.before is not None:
            bound = np.maximum(measured.eta_bar, 1e-6)
            nu = ((measured.x - self.before) / self.dt - measured.acceleration) / bound
            c = measured.contribution[:, self.leading] / bound[:, None]
            for mean, new in ((self.square, nu**2), (self.cross, nu @ c), (self.effect, (c**2).sum(axis=0))):
                mean[:] = self.keep * mean + (1.0 - self.keep) * new
        self.before = measured.x
        explained = self.cross / np.sqrt(self.effect + 1e-6)
        parts = np.log1p(self.square), np.sign(explained) * np.log1p(np.abs(explained)), np.log1p(self.effect)
        return np.concatenate([part.ravel() for part in parts])


class Network:
    """A trained network: one hidden layer of rectified units, and a level for the alarm."""

    def __init__(self, mean, scale, W1, b1, W2, b2, level=1.0):
        self.mean, self.scale, self.W1, self.b1, self.W2, self.b2 = mean, scale, W1, b1, W2, b2
        self.level = float(level)

    @classmethod
    def load(cls, path):
        with np.load(path, allow_pickle=False) as file:
            return cls(**file)

    def scores(self, features):
        """Log odds (..., surfaces) of each surface's fault against none."""
        hidden = np.maximum(0.0, (features - self.mean) / self.scale @ self.W1 + self.b1)
        out = hidden @ self.W2 + self.b2
        return out[..., 1:] - out[..., :1]


class LearnedNetwork:
    """A small neural network of innovation features, its alarm level by split conformal prediction."""

    tunable = {"margin": (0.1, 10.0)}  # noqa: RUF012
    network = None  # in place of the file's, for who has just trained one

    def reset(self, context):
        path = os.environ.get(VARIABLE) or Path(__file__).with_name("learned.npz")
        self.net = self.network or Network.load(path)
        self.features, self.leaders = Features(context), context.leaders
        self.level = self.net.level * context.options.get("margin", 1.0)
        self.verdict = Verdict()

    def step(self, measured, command):
        scores = self.net.scores(self.features.step(measured))
        worst = int(np.argmax(scores))
        statistic = float(np.logaddexp(0.0, scores[worst])) / self.level
        if statistic > 1.0 or self.verdict.detected:
            name = self.leaders[worst]
            self.verdict = Verdict(True, "pqr"[worst], name, "loss_of_effectiveness")
        return self.verdict._replace(statistic=statistic)
