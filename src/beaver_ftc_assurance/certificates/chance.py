"""Evidence of an alarm by the statistical detector: the likelihood ratio of a fault from its onset to the
alarm.

docs/explanation/statistical.md derives it. The log lacks its inputs (signature, regressors of declared
constants, variances); the recorder keeps them frame by frame (tape.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan, sqrt

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import (
    RECORDED_BLOCK_FIELDS,
    DiagnosisReadout,
    StatisticalBlock,
    StatisticalHypothesis,
)
from beaver_ftc.diagnosis.detection import (
    LEVEL_NOISE_SHARE,
    advance_block,
    new_filter_block,
    response_of_block,
    restarting_slot,
    whiten_frame,
)
from beaver_ftc.diagnosis.detection import STEP_HYPOTHESIS as STEP
from beaver_ftc_assurance.certificates.check_certificate import NO_PACE
from beaver_ftc_assurance.certificates.history import Document, History
from beaver_ftc_assurance.certificates.tape import Tape

LOGGED_SCORE_TOLERANCE = 1e-5  # relative; more than all that a certificate leaves out changes the score by
NEGLIGIBLE_SHARE_OF_LIMIT = 1e-7  # what changes evidence and limit by less is left out
MAX_WRITTEN_CONSTANTS = 6  # in each frame: with more a certificate would have over 200 kB
MAX_WRITTEN_FRAMES = 520  # with more a certificate would have over 200 kB
EXCLUSION_NOT_STATED = (
    "chance excluded it, weighing every onset of every fault: more than a certificate can hold"
)
ALARM_NOT_STATED = "chance raised it: an onset long before, a tone, or a force"


def alarm_evidence(
    tape: Tape, history: History, surfaces: Sequence[str], rows: Mapping[str, np.ndarray], k: int
) -> Document | None:
    """The evidence of a statistical alarm at row k; None if its onset is too old, or no single onset explains
    it.

    rows: the log, which has the largest share of the level over all views: at least that of this evidence.
    """
    diagnosis = tape.alarm.diagnosis
    b, h = _largest_score(diagnosis.statistical_filters)
    block = diagnosis.statistical_filters[b]
    hypothesis, slot = block.hypotheses[h], int(np.argmax(block.hypothesis_tests_by_onset.score[h]))
    first = next((r for r in range(k, tape.first, -1) if restarting_slot(r - tape.since) == slot), None)
    if first is None or k - first >= MAX_WRITTEN_FRAMES:
        return None
    score = hypothesis.score_in_std / diagnosis.statistical_alarm_level
    ratio = _likelihood_ratio(tape, history, (b, h, slot), range(first, k + 1))
    if score > 1.0 + LOGGED_SCORE_TOLERANCE:
        ratio = ratio.without_negligible()
    value, limit = ratio.sides
    if not (value > limit and abs(value / limit - score) <= LOGGED_SCORE_TOLERANCE * score):
        return None
    column = _share_column(hypothesis, surfaces)
    logged = float(rows[column][k]) * (1.0 + LOGGED_SCORE_TOLERANCE)
    return {"likelihood": column, **ratio.fields, "sides": [[value, logged], [limit, value / limit]]}


def exclusion_by_alarm(tape: Tape, e: int, alarm: Document) -> Document:
    """The evidence that the statistical alarm came on axes that the fault of estimator e does not move; the
    reason why there is none, if it moves one of them."""
    if "likelihood" in alarm:
        span = slice(alarm["first"] - 1 - tape.first, alarm["frame"] + 1 - tape.first)
        moved = (values[span, e][:, alarm["axes"]] for values in (tape.slope, tape.offset, tape.spread))
        if not any(values.any() for values in moved):
            return {"as": "alarm"}
    return {"because": EXCLUSION_NOT_STATED}


def likelihood_shares(diagnosis: DiagnosisReadout, surfaces: Sequence[str]) -> dict[str, float]:
    """Column, and largest share of the alarm level, of each hypothesis that raises alarms."""
    found: dict[str, float] = {}
    for hypothesis in (
        each for block in diagnosis.statistical_filters for each in block.hypotheses if each.may_raise_alarm
    ):
        column = _share_column(hypothesis, surfaces)
        share = hypothesis.score_in_std / diagnosis.statistical_alarm_level
        found[column] = max(found.get(column, 0.0), share)
    return found


def _share_column(of: StatisticalHypothesis, surfaces: Sequence[str]) -> str:
    name = f"{AXES[of.axis]}_step" if of.hypothesis_kind == STEP else f"{surfaces[of.surface]}_loss"
    return f"{name}_likelihood_share"


def _largest_score(blocks: Sequence[StatisticalBlock]) -> tuple[int, int]:
    """Block and hypothesis of the largest score that raises alarms."""
    places = [(b, h) for b, block in enumerate(blocks) for h, of in enumerate(block.hypotheses)
              if of.may_raise_alarm]  # fmt: skip
    return max(places, key=lambda bh: blocks[bh[0]].hypotheses[bh[1]].score_in_std, default=(0, 0))


@dataclass(frozen=True)
class LikelihoodRatio:
    """A test of n axes from its onset on: the fields of its statement, and the innovation (frames, n) rad/s2.

    Y (2 n, 2 + m): states of the filter before the first frame: a row for the rate error of each axis, rad/s,
    then one for minus the drift of each axis, rad/s2; a column for the innovation, for the signature, and for
    each of m constants. tolerance (m,): largest magnitude of each constant. P (2 n, 2 n): covariance of the
    states before the first frame. R (n,): variance of a reading of each gyro, (rad/s)2. series: the filter's
    inputs in each frame, (frames, ...), under the names and in the units of the fields of a frame
    (docs/explanation/certificate-fields.csv). level: the alarm level, standard deviations. sense: "less" if
    only a negative correlation supports the fault, else "either". first: row of the first frame. dt, s.
    """

    level: float
    axes: list[int]
    sense: str
    tolerance: np.ndarray
    R: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    first: int
    series: dict[str, np.ndarray]
    innovation: np.ndarray
    dt: float

    @property
    def fields(self) -> Document:
        """The fields of the statement, with null for zero."""
        rows = zip(*(values.tolist() for values in self.series.values()), strict=True)
        return {
            "level": self.level, "axes": self.axes, "sense": self.sense, "tolerance": self.tolerance.tolist(),
            "R": _null_for_zero(self.R), "Y": [*map(_null_for_zero, self.Y)],
            "P": [*map(_null_for_zero, self.P)], "first": self.first,
            "frames": [dict(zip(self.series, row, strict=True)) for row in rows],
        }  # fmt: skip

    def without_negligible(self) -> "LikelihoodRatio":
        """The same ratio without the numbers that change evidence and limit by no more than a negligible
        share."""
        short = self
        for name in ("bounded", "pace", "foreseen"):
            without = replace(short, series={key: of for key, of in short.series.items() if key != name})
            short = without if short._is_as(without) else short
        alone = np.diag(self.tolerance)
        matters = [
            j for j, one in enumerate(alone) if not self._is_as(replace(self, tolerance=self.tolerance - one))
        ]
        if len(matters) > MAX_WRITTEN_CONSTANTS:
            short, matters = short._with_constants_merged(), [0]
        Y, series = short.Y[:, [0, 1, *(2 + j for j in matters)]], short.series
        if "known" in series:
            series = series | {"known": series["known"][:, matters]}
        short = replace(short, tolerance=short.tolerance[matters], Y=Y, series=series)
        short = replace(short, Y=short._without_negligible_numbers("Y"))
        return replace(
            short, P=short._without_negligible_numbers("P"), R=short._without_negligible_numbers("R")
        )

    def _without_negligible_numbers(self, name: str) -> np.ndarray:
        """R, Y or P, with zero for each negligible number; in P, which is symmetric, for both of a pair."""
        values = getattr(self, name)
        kept = values.copy()  # self keeps its numbers: each change is compared with it
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
        """The same ratio with one constant instead of many. The sums are linear in the constants, so that all
        of them at their worst act as one."""
        # Copies are in C order: the last digits of a product depend on the order in memory.
        worst = self.tolerance * np.sign(self.sums()[0][2:])
        Y = np.column_stack([self.Y[:, :2], [worst @ row for row in self.Y[:, 2:].copy()]])
        known = np.array([[worst @ of_frame] for of_frame in self.series["known"].copy()])
        return replace(self, tolerance=np.ones(1), Y=Y, series=self.series | {"known": known})

    def sums(self) -> tuple[np.ndarray, float, float]:
        """The sums over the frames of w.g for each column of Y, (2 + m,); N_f, the sum of w.foreseen; and the
        room: the most that a model error within its bound (`bounded`) can add to the first sum.

        room = constant error + min(swings between the ends of the bound, changes at the rate `pace`)
        """
        series, n = self.series, len(self.axes)
        count, none = len(self.innovation), np.zeros_like(self.innovation)
        inputs = [self.innovation - series.get("air", 0.0), series["signature"]]
        inputs += [*np.moveaxis(series["known"], 1, 0)] if "known" in series else []
        states = np.zeros((len(inputs), 4))
        # Y has minus the drift, and no rows of a second axis if there is one axis
        states[:, :n], states[:, 2 : 2 + n] = self.Y[:n].T, -self.Y[n:].T
        sums, parts = np.zeros(len(inputs)), np.zeros(5)
        of_axes = np.stack(inputs, axis=1), series["drift"], series["jitter"] / (self.dt * self.dt)
        bounds = series.get("bounded", none), series.get("foreseen", none)
        shares = series.get("keep", np.ones(count)), series.get("pace", np.full(count, NO_PACE))
        given = map(np.ascontiguousarray, (*of_axes, *bounds, *shares))
        add_whitened_frames(new_filter_block(self.P, self.R), *given, states, sums, parts, self.dt)
        swings, changes, last, constant, N_f = parts.tolist()
        return sums, N_f, min(constant + swings + last, constant + changes)

    @property
    def sides(self) -> tuple[float, float]:
        """Evidence, and the limit that it must exceed."""
        (N, D, *constants), N_f, room = self.sums()
        root = self.level * sqrt(D) if D >= 0.0 else nan
        evidence = -N - max(0.0, -N_f) if self.sense == "less" else abs(N)
        evidence -= sum(tol * abs(total) for tol, total in zip(self.tolerance, constants, strict=True))
        return float(evidence), float(max(root, room + LEVEL_NOISE_SHARE * root))


def _null_for_zero(values: np.ndarray) -> list[float | None]:
    return [value or None for value in values.tolist()]


def _likelihood_ratio(
    tape: Tape, history: History, test: tuple[int, int, int], rows: range
) -> LikelihoodRatio:
    """The ratio of a test (numbers of its block, hypothesis and onset's slot) from its first row to its last.

    recorded: quantities of the block at the end of the row before the first, then of each row. The states are
    those of the row before the first. The detector prepares noise, decay, bound and rate of change of the
    drift at the end of the row before (`previous`); it fills inputs and responses in the row itself
    (`current`). moved: the places in the block of the axes that the fault moves.
    """
    (b, h, slot), dt, diagnosis = test, history.dt, tape.alarm.diagnosis
    block, span = diagnosis.statistical_filters[b], slice(rows[0] - 1 - tape.first, rows[-1] + 1 - tape.first)
    recorded = {name: tape.filters[name][span, b] for name in (*RECORDED_BLOCK_FIELDS, "signature")}
    previous, current = (
        {name: values[part] for name, values in recorded.items()} for part in (np.s_[:-1], np.s_[1:])
    )
    moved = _affected_axes(recorded, current["signature"][:, h], len(block.axis_indices))
    n, states, axes = len(moved), [*moved, *(2 + i for i in moved)], [block.axis_indices[i] for i in moved]
    known = [j for j in np.flatnonzero(block.regressor_coefficient_error_bound > 0.0).tolist()
             if current["g_Z"][:, j][:, moved].any()]  # fmt: skip
    drift = dt * previous["Q_d"][np.ix_(range(len(rows)), moved, moved)]
    # The detector adds Q_d after the decay of the drift, `add_whitened_frames` before it: a frame later.
    drift[1:], drift[0] = drift[:-1], 0.0
    x_Z = previous["x_Z"][:, known][..., states]
    series = {
        "signature": current["signature"][:, h][:, moved],
        "jitter": dt * dt * previous["Q_x"][:, moved],
        "drift": drift, "bounded": tape.filters["bounded"][span][:-1][:, axes],
        "pace": previous["eta_rate"],
    }  # fmt: skip
    if block.drift_correlation_length_m > 0.0:
        series["keep"] = previous["a"]
    if known:  # their filter's g = e + dt (v - d), x_Z = (e, d), solved for the input v
        series["known"] = (current["g_Z"][:, known][..., moved] - x_Z[..., :n]) / dt + x_Z[..., n:]
    if diagnosis.gust.is_turbulence_declared:
        series["air"] = tape.filters["air"][span][1:][:, axes]
        leap = tape.filters["leap"][span][1:][np.ix_(range(len(rows)), axes, axes)]
        series["drift"] = drift + block.factor_on_gust_drift_intensity * leap  # the gust's axes turn
    tests = block.hypothesis_tests_by_onset
    sense = tests.supporting_correlation_sign[h, slot]
    predictable = {
        "p": tests.correlation_predictable_in_calm_air,
        "g_c": tests.correlation_from_coarse_gust,
    }
    supporting = [current[name] for name, values in predictable.items() if sense * values[h, slot] > 0.0]
    if supporting:  # those parts of the innovation whose correlation supports the fault
        series["foreseen"] = np.sum(supporting, axis=0)[:, moved]
    Y = np.array([previous["state"][0, states], np.zeros(2 * n), *x_Z[0]]).T
    xx, xd, dd = (recorded[name][0] for name in ("P_xx", "P_xd", "P_dd"))
    P = np.block([[xx, xd], [xd.T, dd]])[np.ix_(states, states)]
    innovation = history.innovation_rad_s2[rows[0] : rows[-1] + 1, axes]
    return LikelihoodRatio(
        level=diagnosis.statistical_alarm_level, axes=axes, sense="less" if sense else "either",
        tolerance=block.regressor_coefficient_error_bound[known], R=recorded["R_y"][0, moved],
        Y=np.vstack([Y[:n], -Y[n:]]), P=0.5 * (P + P.T),  # the checker refuses rounding
        first=rows[0], series=series, innovation=innovation, dt=dt,
    )  # fmt: skip


def _affected_axes(recorded: dict[str, np.ndarray], signature: np.ndarray, n: int) -> list[int]:
    """Places of the axes of a block of n that the fault moves; both if their covariances are not zero."""
    together = n > 1 and any(recorded[name][..., 0, 1].any() for name in ("P_xx", "P_xd", "P_dd", "Q_d"))
    return [i for i in range(n) if together or signature[:, i].any()]


@kernel
def add_whitened_frames(blocks, inputs, drift, jitter, bounded, foreseen, keep, pace, states, sums, room, dt):
    """Run a filter, blocks (1,), over the frames of a `LikelihoodRatio`, and add w.g of each frame to `sums`
    (columns,): g, the whitened innovation of each column, w = S^-1 g of the second, the signature. See
    `likelihood.accumulate_tests`.

    inputs (frames, columns, n); drift (frames, n, n); jitter, bounded, foreseen (frames, n): of n axes.
    states (columns, 4): advanced in place. room (5,), filled: what a model error within its bound can add to
    the sum of the innovation if it swings between the ends of the bound before the last frame, if it changes
    at its pace, by the swing after the last frame, and if it is constant; and the sum of w.foreseen.
    """
    block, g, w = blocks[0], np.zeros((len(states), 2)), np.zeros(2)
    for k in range(len(inputs)):
        block.a = keep[k]
        for i in range(block.n):
            block.Q_x[i], block.eta[i] = jitter[k, i], bounded[k, i]
            for j in range(block.n):
                block.P_dd[i, j] += drift[k, i, j]
        advance_block(block, dt)
        response_of_block(block, dt)
        for c in range(len(states)):
            whiten_frame(block, states[c], inputs[k, c], dt, g[c])
        room[2] = 0.0
        for i in range(block.n):
            before, w[i] = w[i], 0.0
            for j in range(block.n):
                w[i] += block.S_inv[i, j] * g[1, j]
            room[0] += block.eta_r[i] * abs(w[i] - before)
            room[1] += pace[k] * block.eta_r[i] * abs(w[i])
            room[2] += block.eta_r[i] * abs(w[i])
            room[3] += block.eta_0[i] * abs(w[i])
            room[4] += w[i] * foreseen[k, i]
            for c in range(len(states)):
                sums[c] += w[i] * g[c, i]
