"""The log of a flight by frames, or by blocks of frames: innovation, its bound, and the declared errors.

x (3,) rad/s: measured body rates; F (3,) rad/s2: angular acceleration by the design model; eta_bar (3,)
rad/s2: bound on the error of F; nu (3,) rad/s2: innovation; n (3,) rad/s: bound on the changing error of the
gyros. Without a fault

    nu[k] = (x[k] - x[k-1]) / dt - F[k],    |nu[k]| <= eta_bar[k] + (n[k] + n[k-1]) / dt
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, nan
from typing import NamedTuple

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.diagnosis import ROUNDING_RAD_S2
from beaver_ftc.loop import FrameReadout
from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates.tape import Tape

ROUNDING_SHARE = 4e-15  # a smaller share of a bound is rounding
# Quantities of a tape of which a block has the mean; of all others it has the value of its last frame.
AVERAGED_QUANTITIES = "offset", "slope", "spread"


class DeclaredErrors(NamedTuple):
    """Declared errors that the bound on the model's error contains, by axis (3,), under their letters in the
    certificate (docs/explanation/certificates.md, "The fields").

    c        1/rad    largest error of the model's coefficient of a product of two rates
    b        rad/s2   constant part of the bound
    g        1/rad    bound on the coefficients of products with the Earth's rate (`declared_errors_of`)
    o, m     rad/s, 1 the error of a gyro is at most o + m |rate|
    B        rad/s    the part of o that does not change
    omega_E  rad/s    rate of the Earth, which the model leaves out; a scalar
    """

    c: np.ndarray
    b: np.ndarray
    g: np.ndarray
    o: np.ndarray
    B: np.ndarray
    m: np.ndarray
    omega_E: float


@dataclass(frozen=True)
class History:
    """Columns of a log, (rows, 3) by axis: measured body rates x rad/s; acceleration F of the design model
    and bound eta_bar on its error, rad/s2, of the frame that ends with the row; and what was recorded beside
    the log.

    row_dt: time between two rows, s. instants: number of JSBSim frames in this time. alarm: frame of the
    alarm. tape: recorded quantities of the frames around it. If gyros are noisy, types are tested by blocks
    of `length` rows (diagnosis/types/records.py); the first block begins with row `begin`. A block counts as
    one frame of several instants. Its bound has the noise of the gyros at its two ends only.
    """

    row_dt: float
    instants: int
    x: np.ndarray
    F: np.ndarray
    eta_bar: np.ndarray
    declared: DeclaredErrors
    tape: Tape
    alarm: int
    length: int = 1
    begin: int = 0

    @property
    def dt(self) -> float:
        """Length of a frame, s."""
        return self.length * self.row_dt

    @property
    def has_single_instants(self) -> bool:
        """Whether a frame is one JSBSim frame."""
        return self.instants == 1 and self.length == 1

    @property
    def statement_fields(self) -> Document:
        """The field `block` of a statement: rows in a block, first row, and the row after the last; without
        blocks, no field."""
        if self.length == 1:
            return {}
        return {"block": [self.length, self.begin, self.begin + self.length * len(self.rates_rad_s)]}

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Mean (frames, ...) of values (rows, ...) over each whole block."""
        n = len(values) // self.length
        blocks = values[: n * self.length].reshape(n, self.length, *values.shape[1:])
        return np.asarray(blocks.mean(axis=1))

    @cached_property
    def rates_rad_s(self) -> np.ndarray:
        """x at the end of each frame, (frames, 3)."""
        return self.x[self.begin + self.length - 1 :: self.length]

    @cached_property
    def model_rad_s2(self) -> np.ndarray:
        """F of each frame, (frames, 3)."""
        return self.mean(self.F[self.begin :])

    @cached_property
    def eta_bar_rad_s2(self) -> np.ndarray:
        """eta_bar of each frame, (frames, 3)."""
        return self.mean(self.eta_bar[self.begin :])

    @cached_property
    def gyro_error_change_rad_s(self) -> np.ndarray:
        """n of docs/explanation/detection.md, "Changing error of a gyro", (frames, 3): n = o - B + m w, with
        the largest true rates w."""
        errors = self.declared
        return np.asarray(errors.o - errors.B + errors.m * self._largest(self.rates_rad_s))

    def _largest(self, x: np.ndarray) -> np.ndarray:
        """w, bound on |true rate| by readings x, (n, 3): |x| + (o + m |x|) / (1 - m)."""
        o = self.declared.o
        m = self.declared.m
        return np.asarray(np.abs(x) + (o + m * np.abs(x)) / (1.0 - m))

    @cached_property
    def innovation_rad_s2(self) -> np.ndarray:
        """nu, (frames, 3); not a number in the first frame."""
        return np.asarray((self.rates_rad_s - _row_before(self.rates_rad_s)) / self.dt - self.model_rad_s2)

    def innovation_bound(self, rows: slice) -> np.ndarray:
        """Bound on |nu| without a fault, (n, 3) rad/s2; not a number in the first frame."""
        change = self.gyro_error_change_rad_s
        return np.asarray(self.eta_bar_rad_s2[rows] + (change + _row_before(change))[rows] / self.dt)

    def products(self) -> np.ndarray:
        """q r, p r, p q (rows, 3), as large as the true rates can be."""
        p, q, r = self._largest(self.x).T
        return np.column_stack((q * r, p * r, p * q))

    @cached_property
    def unstated_bound_rad_s2(self) -> np.ndarray:
        """The part of eta_bar that does not follow from the declared errors, (frames, 3), with w the largest
        true rates at the row before:

            eta_bar - (c (products of w) + b + omega_E ((1 + g) sum w + g omega_E) + rounding) / instants
        """
        errors = self.declared
        g = errors.g
        omega_E = errors.omega_E
        w = self._largest(self.x)
        by_earth = omega_E * ((1.0 + g) * w.sum(axis=1, keepdims=True) + g * omega_E) + ROUNDING_RAD_S2
        stated = errors.c * self.products() + errors.b + by_earth
        unstated = self.eta_bar - _row_before(stated) * (1.0 / self.instants)
        return self.mean(unstated[self.begin :])

    def is_unexplained(self, frames: np.ndarray) -> np.ndarray:
        """Whether health does not explain each of the given consecutive frames >= 1, (frames,): |nu| exceeds
        its bound on an axis. If a frame has several instants, this must hold for the frames before and after,
        too, because a fault may begin within a frame; it does not hold for a frame after the last one."""
        rows = slice(int(frames[0]) - 1, min(int(frames[-1]) + 2, len(self.rates_rad_s)))
        exceeds = (np.abs(self.innovation_rad_s2[rows]) > self.innovation_bound(rows)).any(axis=1)
        padded = np.r_[exceeds, np.zeros(len(frames) + 2 - len(exceeds), bool)]
        if self.has_single_instants:
            return np.asarray(padded[1:-1])
        return np.asarray(padded[:-2] & padded[1:-1] & padded[2:])

    def with_constant_gyro_errors_on(self, axes: np.ndarray) -> "History":
        """The same history, but with a constant part of the gyro error only on the axes where `axes` (3,) is
        1; on the other axes, the whole error may change."""
        return replace(self, declared=self.declared._replace(B=self.declared.B * axes))

    def declared_fields(self, rows: np.ndarray | None) -> Document:
        """The field `declared` of a certificate, by letter and axis (docs/explanation/certificates.md, "The
        fields"): the errors that are not zero. c is left out on an axis where it adds nothing to the bounds
        of these rows; c, b and g without rows. rows: those of all terms and bounds, None if there are
        none."""
        errors = self.declared
        gyro = {name: getattr(errors, name) for name in "oBm"}
        if rows is None:
            return _by_axis(gyro | dict.fromkeys("cbg", np.zeros(len(AXES))))
        added = errors.c * self.products()[rows - 1] * (1.0 / self.instants)
        decides = (added > ROUNDING_SHARE * self.eta_bar[rows]).any(axis=0)
        return _by_axis(gyro | {"c": errors.c * decides, "b": errors.b, "g": errors.g * (errors.omega_E > 0)})


def _row_before(values: np.ndarray) -> np.ndarray:
    """Values (rows, 3) one row later: each row has those of the row before, NaN in the first."""
    return np.concatenate([np.full_like(values[:1], nan), values[:-1]])


def _by_axis(numbers: Mapping[str, np.ndarray]) -> Document:
    """Name -> axis -> number, without the numbers that are zero."""
    return {
        name: {axis: float(v) for axis, v in zip(AXES, values, strict=True) if v}
        for name, values in numbers.items()
    }


def declared_errors_of(frame: FrameReadout) -> DeclaredErrors:
    """The declared errors in a flight's record, with the coefficients of inertia that they multiply.

    The Earth's rate adds to the body rates in pdot = Ppq p q + Pqr q r, qdot = Qpp p^2 + Qpr p r + Qrr r^2
    and rdot = Rpq p q + Rqr q r. g is the size of these coefficients in sum, of a square twice:
    |Ppq| + |Pqr|, |Qpr| + 2 max(|Qpp|, |Qrr|), |Rpq| + |Rqr|, at least 1.
    """
    bound = frame.diagnosis.declared_bounds
    inertia = frame.inertia
    size = {name: abs(value) for name, value in inertia._asdict().items()}
    gains = (
        size["Ppq"] + size["Pqr"],
        size["Qpr"] + 2.0 * max(size["Qpp"], size["Qrr"]),
        size["Rpq"] + size["Rqr"],
    )
    return DeclaredErrors(
        c=bound.coupling_share * np.abs([inertia.Pqr, inertia.Qpr, inertia.Rpq]),
        b=bound.constant_rad_s2, g=np.maximum(gains, 1.0), o=bound.gyro_error_rad_s,
        B=bound.gyro_constant_rad_s, m=bound.gyro_slope,
        omega_E=bound.earth_rate_rad_s,
    )  # fmt: skip


def in_blocks(history: History) -> History:
    """The same history by the blocks by which the diagnosis tested types; itself if it tested them by frames.
    The tape begins with the first whole block in it."""
    tape = history.tape
    diagnosis = tape.alarm.diagnosis
    length = diagnosis.types_config.frames_per_block
    if length == 1:
        return history
    begin = (history.alarm + 1 - diagnosis.frames_so_far) % length
    blocks = replace(history, length=length, begin=begin)
    first_block = ceil((tape.first - begin) / length)
    skipped = begin + first_block * length - tape.first
    kept = {
        name: blocks.mean(values[skipped:])
        if name in AVERAGED_QUANTITIES
        else values[skipped + length - 1 :: length]
        for name, values in tape.kept.items()
    }
    block_tape = replace(tape, first=first_block, frames=(tape.frames - skipped) // length, kept=kept)
    alarm_block = max(ceil((history.alarm - begin) / length), 1)  # block 0 has no rates from before it
    return replace(blocks, tape=block_tape, alarm=alarm_block)


def log_rows_of(statement: Document, span: Document) -> np.ndarray:
    """The rows of the log in a span, i.e. a term or a bound, of a statement."""
    length, begin, _ = statement.get("block", (1, 0, 0))
    return np.arange(begin + span["first"] * length, begin + (span["frame"] + 1) * length)
