"""The likelihood ratio of a fault from its onset to an alarm: evidence, limit, and a shorter equivalent.

    evidence = |sum of w.g of the innovation| - sum over the constants of tolerance |sum of w.g of a constant|
    limit    = max(level sqrt(D), room + LEVEL_NOISE_SHARE level sqrt(D)),   D = sum of w.g of the signature

    room     = sum of eta_0 |w| + min(sum of eta_r |w - w before| + eta_r |w last|, sum of pace eta_r |w|)

g, rad/s: the whitened innovation, signature or regressor of a constant. w = S^-1 g of the signature,
1/(rad/s), with the covariance S of the whitened innovation. This evidence is that of the sense "either".

room: the largest contribution of a model error within its bound. It is the sum of that of a constant error,
and of the lesser of those of an error that swings between the ends of the bound and of one that changes at
the rate `pace`. eta_0, eta_r, rad/s: effect on g of an error at its bound, if it is constant, and if it
swings. Sums are over the frames and the axes. docs/explanation/statistical.md derives the equations.
"""

from collections import namedtuple
from dataclasses import dataclass, replace
from math import nan, sqrt

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection import (
    LEVEL_NOISE_SHARE,
    advance_block,
    new_filter_block,
    response_of_block,
    whiten_frame,
)
from beaver_ftc_assurance.certificates.check_certificate import NO_PACE
from beaver_ftc_assurance.certificates.history import Document

# A number that changes evidence and limit by a smaller share of it is left out.
NEGLIGIBLE_SHARE_OF_LIMIT = 1e-7
MAX_WRITTEN_CONSTANTS = 6  # largest number in a frame: with more, a certificate would exceed 200 kB


class Inputs(namedtuple("Inputs", "signature jitter drift bounded pace keep known air foreseen")):
    """Inputs of the filter in each of N frames, for n axes and m constants. These fields of a frame, in this
    order, are those of a certificate (docs/explanation/certificate-fields.csv), which lacks those that are
    None.

    signature  (N, n)     rad/s2   acceleration that the fault causes
    jitter     (N, n)     rad2/s2  variance that the frame adds to the rate
    drift      (N, n, n)  rad2/s4  covariance that the frame adds to the drifts
    bounded    (N, n)     rad/s2   bound eta_bar on the model error; None: 0
    pace       (N,)       1        largest change of the model error, share of its bound; None: NO_PACE
    keep       (N,)       1        factor on the drift; None: 1
    known      (N, m, n)  rad/s2   regressor of each constant; None if m = 0
    air        (N, n)     rad/s2   acceleration that the measured gust causes; None: 0
    foreseen   (N, n)     rad/s    part of g that the filter for calm air predicts; None: 0
    """


@dataclass(frozen=True)
class LikelihoodRatio:
    """A test of n axes from its onset on: the fields of its statement, and the innovation (frames, n) rad/s2.

    Y (2 n, 2 + m): states of the filter before the first frame: a row for the rate error of each axis, rad/s,
    then one for minus the drift of each axis, rad/s2; a column for the innovation, for the signature, and for
    each of m constants. tolerance (m,): largest magnitude of each constant. P (2 n, 2 n): covariance of the
    states before the first frame. R (n,): variance of a reading of each gyro, (rad/s)2. level: the alarm
    level, standard deviations. sense: "less" if only a negative correlation supports the fault, else
    "either". first: row of the first frame. dt, s.
    """

    level: float
    axes: list[int]
    sense: str
    tolerance: np.ndarray
    R: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    first: int
    series: Inputs
    innovation: np.ndarray
    dt: float

    @property
    def fields(self) -> Document:
        """The fields of the statement; zeros of R, Y and P are null."""
        written = {
            name: values.tolist() for name, values in self.series._asdict().items() if values is not None
        }
        return {
            "level": self.level, "axes": self.axes, "sense": self.sense, "tolerance": self.tolerance.tolist(),
            "R": _null_for_zero(self.R), "Y": [*map(_null_for_zero, self.Y)],
            "P": [*map(_null_for_zero, self.P)], "first": self.first,
            "frames": [dict(zip(written, row, strict=True)) for row in zip(*written.values(), strict=True)],
        }  # fmt: skip

    def without_negligible(self) -> "LikelihoodRatio":
        """The same ratio without numbers that are negligible, one kind after the other:

            1. the inputs bounded, pace and foreseen, each as a whole
            2. constants; if more than MAX_WRITTEN_CONSTANTS remain, all are merged into one
            3. numbers of Y, then of P and of R

        Each constant, and each number of Y, P and R, is left out by itself to find its effect. All numbers
        that are left out change the score together by less than LOGGED_SCORE_TOLERANCE, which
        `alarm_evidence` checks.
        """
        shortened = self
        for name in ("bounded", "pace", "foreseen"):
            without = replace(shortened, series=shortened.series._replace(**{name: None}))
            shortened = without if shortened._is_as(without) else shortened
        matters = [
            j
            for j, tolerance_j in enumerate(np.diag(self.tolerance))
            if not self._is_as(replace(self, tolerance=self.tolerance - tolerance_j))
        ]
        if len(matters) > MAX_WRITTEN_CONSTANTS:
            shortened = shortened._with_constants_merged()
            matters = [0]
        Y = shortened.Y[:, [0, 1, *(2 + j for j in matters)]]
        series = shortened.series
        if series.known is not None:
            series = series._replace(known=series.known[:, matters])
        shortened = replace(shortened, tolerance=shortened.tolerance[matters], Y=Y, series=series)
        shortened = replace(shortened, Y=shortened._without_negligible_numbers("Y"))
        return replace(
            shortened,
            P=shortened._without_negligible_numbers("P"),
            R=shortened._without_negligible_numbers("R"),
        )

    def _without_negligible_numbers(self, name: str) -> np.ndarray:
        """R, Y or P, with zero for each negligible number; in P, which is symmetric, for both numbers of a
        pair."""
        values = getattr(self, name)
        kept = values.copy()  # a copy, since each change is compared with self
        for place in np.ndindex(values.shape):
            without_one = values.copy()
            without_one[place] = 0.0
            if name == "P":
                without_one[place[::-1]] = 0.0
            if self._is_as(replace(self, **{name: without_one})):
                kept[place] = 0.0
        return kept

    def _is_as(self, other: "LikelihoodRatio") -> bool:
        """Whether evidence and limit of both differ by a negligible share; False if P is no covariance."""
        change = np.abs(np.subtract(self.sides, other.sides))
        return bool((change <= NEGLIGIBLE_SHARE_OF_LIMIT * self.sides[1]).all())

    def _with_constants_merged(self) -> "LikelihoodRatio":
        """The same ratio with one constant instead of many. The sums are linear in the constants, so the
        constants at their worst ends, tolerance sign(sum), act as a single one."""
        # Copies are in C order: the last digits of a product depend on the order in memory.
        worst = self.tolerance * np.sign(self.sums()[0][2:])
        Y = np.column_stack([self.Y[:, :2], [worst @ row for row in self.Y[:, 2:].copy()]])
        known = np.array([[worst @ regressors] for regressors in self.series.known.copy()])
        return replace(self, tolerance=np.ones(1), Y=Y, series=self.series._replace(known=known))

    def sums(self) -> tuple[np.ndarray, float, float]:
        """The sums over the frames of w.g for each column of Y, (2 + m,); N_f, the sum of w.foreseen; and the
        room.

        neutral: the value of each input that the certificate may lack.
        """
        n = len(self.axes)
        # The states of a filter are those of two axes: rate errors, then drifts. Y has n axes, and minus the
        # drifts.
        states = np.zeros((self.Y.shape[1], 4))
        states[:, :n] = self.Y[:n].T
        states[:, 2 : 2 + n] = -self.Y[n:].T
        sums = np.zeros(len(states))
        zeros = np.zeros_like(self.innovation)
        ones = np.ones(len(zeros))
        neutral = {
            "bounded": zeros, "pace": NO_PACE * ones, "keep": ones, "known": zeros[:, None][:, :0],
            "air": zeros, "foreseen": zeros,
        }  # fmt: skip
        replacements = {name: zero for name, zero in neutral.items() if getattr(self.series, name) is None}
        series = self.series._replace(**replacements)
        nu = self.innovation - series.air
        inputs = np.concatenate([nu[:, None], series.signature[:, None], series.known], axis=1)
        Q_x = series.jitter / (self.dt * self.dt)
        of_frames = inputs, series.drift, Q_x, series.bounded, series.foreseen, series.keep, series.pace
        arrays = map(np.ascontiguousarray, of_frames)
        N_f, room = add_whitened_frames(
            new_filter_block(self.P, self.R),
            *arrays,
            states,
            np.zeros((len(states), 2)),
            np.zeros(2),
            sums,
            self.dt,
        )
        return sums, N_f, room

    @property
    def sides(self) -> tuple[float, float]:
        """Evidence, and the limit that it must exceed; with the sense "less", -N - max(0, -N_f) is in place
        of |N|, the sum for the innovation (`sums`)."""
        (N, D, *constants), N_f, room = self.sums()
        root = self.level * sqrt(D) if D >= 0.0 else nan
        evidence = -N - max(0.0, -N_f) if self.sense == "less" else abs(N)
        evidence -= sum(tol * abs(total) for tol, total in zip(self.tolerance, constants, strict=True))
        return float(evidence), float(max(root, room + LEVEL_NOISE_SHARE * root))


def _null_for_zero(values: np.ndarray) -> list[float | None]:
    """The numbers for the certificate, null for zero."""
    return [value or None for value in values.tolist()]


@kernel
def add_whitened_frames(blocks, inputs, drift, jitter, bounded, foreseen, keep, pace, states, g, w, sums, dt):
    """Run a filter, blocks (1,), over the frames of a `LikelihoodRatio`, and add w.g of each frame to `sums`
    (columns,): g (columns, 2), the whitened inputs; w (2,) = S^-1 g of column 1, the signature, zero at
    first. See `likelihood.accumulate_tests`.

    inputs (frames, columns, n); drift (frames, n, n); jitter, bounded, foreseen (frames, n): of n axes; keep,
    pace (frames,). states (columns, 4): advanced in place. Returns N_f, the sum of w.foreseen, and the room
    of the head of this file: e_0 + min(e_tv + last, e_w), with the sums

        e_0 of eta_0 |w|,   e_tv of eta_r |w - w before|,   e_w of pace eta_r |w|

    and last: eta_r |w| of the last frame.
    """
    block = blocks[0]
    e_0 = e_tv = e_w = last = N_f = 0.0
    for k in range(len(inputs)):
        block.a = keep[k]
        for i in range(block.n):
            block.Q_x[i] = jitter[k, i]
            block.eta[i] = bounded[k, i]
            for j in range(block.n):
                block.P_dd[i, j] += drift[k, i, j]
        advance_block(block, dt)
        response_of_block(block, dt)
        for c in range(len(states)):
            whiten_frame(block, states[c], inputs[k, c], dt, g[c])
        last = 0.0
        for i in range(block.n):
            before = w[i]
            w[i] = 0.0
            for j in range(block.n):
                w[i] += block.S_inv[i, j] * g[1, j]
            e_tv += block.eta_r[i] * abs(w[i] - before)
            e_w += pace[k] * block.eta_r[i] * abs(w[i])
            last += block.eta_r[i] * abs(w[i])
            e_0 += block.eta_0[i] * abs(w[i])
            N_f += w[i] * foreseen[k, i]
            for c in range(len(states)):
                sums[c] += w[i] * g[c, i]
    return N_f, min(e_0 + e_tv + last, e_0 + e_w)
