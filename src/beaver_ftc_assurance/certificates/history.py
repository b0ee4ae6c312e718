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

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.diagnosis import ROUNDING_RAD_S2
from beaver_ftc.loop import FrameReadout
from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates.tape import Tape

ROUNDING_SHARE = 4e-15  # a smaller share of a bound is rounding
# Quantities of a tape of which a block has the mean; of all others it has the value of its last frame.
AVERAGED_QUANTITIES = "offset", "slope", "spread"


@dataclass(frozen=True)
class DeclaredErrors:
    """Declared errors that the bound on the model's error contains, by axis (3,).

    inertia_coupling: largest error of the model's coefficient of a product of two rates, 1/rad.
    constant_rad_s2: constant part of the bound. earth_rad_s: rate of the Earth, which the model leaves out.
    earth_gain: bound on the coefficients of products with the Earth's rate, 1/rad, at least 1
    (`declared_errors_of`). The error of a gyro is at most gyro_offset_rad_s + gyro_slope |rate|;
    gyro_constant_rad_s is the part of it that does not change.
    """

    inertia_coupling: np.ndarray
    constant_rad_s2: np.ndarray
    earth_rad_s: float
    earth_gain: np.ndarray
    gyro_offset_rad_s: np.ndarray
    gyro_constant_rad_s: np.ndarray
    gyro_slope: np.ndarray


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
        """n of docs/explanation/detection.md, "Changing error of a gyro", (frames, 3):

            n = offset - constant + slope |largest true rate|

        offset, constant, slope: declared errors of the gyros.
        """
        declared = self.declared
        x = self.rates_rad_s
        changing = declared.gyro_offset_rad_s - declared.gyro_constant_rad_s
        return np.asarray(changing + declared.gyro_slope * self._largest(x))

    def _largest(self, x: np.ndarray) -> np.ndarray:
        """Bound on |true rate| by readings x, (n, 3): |x| + (offset + slope |x|) / (1 - slope)."""
        offset = self.declared.gyro_offset_rad_s
        slope = self.declared.gyro_slope
        return np.asarray(np.abs(x) + (offset + slope * np.abs(x)) / (1.0 - slope))

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
        true rates at the row before, g the earth_gain and Omega the rate of the Earth:

            eta_bar - (inertia_coupling (products of w) + constant
                       + Omega ((1 + g) sum w + g Omega) + ROUNDING_RAD_S2) / instants
        """
        declared = self.declared
        rates = self._largest(self.x)
        earth = declared.earth_rad_s
        gain = declared.earth_gain
        by_earth = earth * ((1.0 + gain) * rates.sum(axis=1, keepdims=True) + gain * earth) + ROUNDING_RAD_S2
        stated = declared.inertia_coupling * self.products() + declared.constant_rad_s2 + by_earth
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
        constant = self.declared.gyro_constant_rad_s * axes
        return replace(self, declared=replace(self.declared, gyro_constant_rad_s=constant))

    def declared_fields(self, rows: np.ndarray | None) -> Document:
        """The field `declared` of a certificate, by letter and axis (docs/explanation/certificates.md, "The
        fields"): the errors that are not zero. c is left out on an axis where it adds nothing to the bounds
        of these rows; c, b and g without rows. rows: those of all terms and bounds, None if there are
        none."""
        errors = self.declared
        gyro = {"o": errors.gyro_offset_rad_s, "B": errors.gyro_constant_rad_s, "m": errors.gyro_slope}
        if rows is None:
            return _by_axis(gyro | dict.fromkeys("cbg", np.zeros(len(AXES))))
        added = errors.inertia_coupling * self.products()[rows - 1] * (1.0 / self.instants)
        decides = (added > ROUNDING_SHARE * self.eta_bar[rows]).any(axis=0)
        gain = errors.earth_gain * (errors.earth_rad_s > 0.0)
        return _by_axis(
            gyro | {"c": errors.inertia_coupling * decides, "b": errors.constant_rad_s2, "g": gain}
        )


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
    and rdot = Rpq p q + Rqr q r. earth_gain is the size of these coefficients in sum, of a square twice:
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
        inertia_coupling=bound.inertia_coupling_error_share * np.abs([inertia.Pqr, inertia.Qpr, inertia.Rpq]),
        constant_rad_s2=bound.constant_error_rad_s2,
        earth_rad_s=bound.earth_rate_rad_s, earth_gain=np.maximum(gains, 1.0),
        gyro_offset_rad_s=bound.gyro_error_bound_at_rest_rad_s,
        gyro_constant_rad_s=bound.constant_gyro_error_bound_rad_s,
        gyro_slope=bound.gyro_error_bound_per_rate,
    )  # fmt: skip


def in_blocks(history: History) -> History:
    """The same history by the blocks by which the diagnosis tested types; itself if it tested them by frames.
    The tape begins with the first whole block in it."""
    tape = history.tape
    diagnosis = tape.alarm.diagnosis
    length = diagnosis.types_config.frames_per_block
    if length == 1:
        return history
    begin = (history.alarm + 1 - diagnosis.n_frames_in_block_so_far) % length
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
