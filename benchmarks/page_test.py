"""Page's test [Page1954] for a fault whose effect is known, but not its instant.

It computes the log likelihood ratio of "this fault since this instant" for each instant, and takes the
largest. If the observations have one distribution before the fault and one after it, no test has a shorter
worst mean delay at the same mean time between false alarms. The noise is that of the true innovations: a
vector autoregression of ORDER frames is fitted to the accelerations that the design model does not explain in
healthy flights. It whitens the innovations and the effect of the fault. So it contains the errors of the
model, the gusts and the noise of the gyros as they are, not as they are declared.
"""

from typing import NamedTuple

import numpy as np

from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.studies.compare.replay import Recording

ORDER, SETTLED, FURTHEST = 20, 100, 1000  # frames: of the autoregression, before it is fitted, and back


class Whitener(NamedTuple):
    """A model of the noise. before (3 ORDER, 3): predicts a frame from those before it. root (3, 3): inverse
    root of the covariance of the prediction error."""

    before: np.ndarray
    root: np.ndarray

    def respond(self, z: np.ndarray) -> np.ndarray:
        """The whitened accelerations z (n, 3) rad/s2: their noise is white, with variance one."""
        return self.responses(z)[ORDER]

    def responses(self, z: np.ndarray) -> np.ndarray:
        """The same, (ORDER + 1, n, 3), of accelerations that are zero until j frames before each frame, j = 0
        to ORDER; the last one begins at any earlier frame."""
        rest = np.repeat(z[None], ORDER + 1, axis=0)
        for j, part in enumerate(self.before.reshape(ORDER, 3, 3), start=1):
            rest[j:, j:] -= z[:-j] @ part
        return rest @ self.root


def fitted(unexplained: list[np.ndarray]) -> Whitener:
    """The noise model of healthy flights. unexplained: their accelerations, (n, 3) rad/s2 each."""
    past = np.vstack([_past(z)[SETTLED:] for z in unexplained])
    now = np.vstack([z[SETTLED:] for z in unexplained])
    before = np.linalg.lstsq(past, now, rcond=None)[0]
    rest = now - past @ before
    return Whitener(before, np.linalg.inv(np.linalg.cholesky(rest.T @ rest / len(rest))).T)


def _past(z: np.ndarray) -> np.ndarray:
    """The ORDER frames before each, (n, 3 ORDER), the latest first."""
    return np.hstack([np.vstack((np.zeros((j, 3)), z[:-j])) for j in range(1, ORDER + 1)])


def unexplained(recording: Recording) -> np.ndarray:
    """The acceleration of each frame that neither the design model nor the gust at the vanes explains,
    (frames - 1, 3) rad/s2."""
    gust = VaneGust(recording.context)
    seen = [gust.subtracted(measured) for measured, _ in recording.seen]
    x, expected = (
        np.array([getattr(measured, of_it) for measured in seen]) for of_it in ("x", "acceleration")
    )
    return np.diff(x, axis=0) / recording.context.dt_s - expected[1:]


def largest_ratios(
    recording: Recording, does: np.ndarray, noise: Whitener, sizes: tuple[float, ...] = (1.0,),
    every: int = 1,
) -> dict[float, np.ndarray]:  # fmt: skip
    """By size m: the largest log likelihood ratio at every frame k, (n + 1,), of a fault that adds m does:

        max over s of  m N - m^2 / 2 D,  N = sum of R_s(i) g(i),  D = sum of R_s(i)^2,  s <= i <= k

    g (n, 3): whitened accelerations. R_s (n, 3): whitened effect of size 1 since frame s. does (n, 3): the
    effect, rad/s2. every: frames between the instants s.
    """
    g, n = noise.respond(unexplained(recording)), len(does)
    k, since = np.arange(n), np.arange(0, n, every)
    response = noise.responses(does)
    age = k[:, None] - since
    began = np.clip(age, 0, ORDER), k[:, None]
    late = (age >= 0) & (age < FURTHEST)
    N, D = (
        np.cumsum(np.where(age >= 0, seen.sum(axis=2)[began], 0.0), axis=0)
        for seen in (response * g, np.square(response))
    )
    return {
        m: np.concatenate(([0.0], np.where(late, m * N - 0.5 * m * m * D, 0.0).max(axis=1, initial=0.0)))
        for m in sizes
    }
