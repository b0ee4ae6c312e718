"""The statistical alarm: a fault's likelihood ratio from its onset to the alarm.

docs/explanation/statistical.md derives it. Columns that the log does not have are kept frame by
frame: signature, regressors of declared constants, variances.
"""

from collections.abc import Mapping, Sequence
from math import nan, sqrt
from typing import NamedTuple

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
from beaver_ftc_assurance.certificates.inequality import Document, History
from beaver_ftc_assurance.certificates.tape import Tape

LOGGED_SCORE_TOLERANCE = 1e-5  # relative; more than all that a certificate leaves out changes the score by
NEGLIGIBLE_SHARE_OF_LIMIT = 1e-7  # what changes evidence and limit by less is left out
MAX_WRITTEN_CONSTANTS = 6  # in each frame: with more a certificate would have over 200 kB
MAX_WRITTEN_FRAMES = 520  # with more a certificate would have over 200 kB
# What the limit on the evidence follows from: noise alone; or noise and a bounded uncertainty, as it swings
# from one end to the other, or as fast as it may change
LIMIT_BY_NOISE, LIMIT_BY_SWINGS, LIMIT_BY_CHANGE_RATE = range(3)
# Columns of `frame_parameters`, two axes each; the last: share of a drift that a frame keeps, rate of change
FRAME_COLUMNS = MODEL_NOISE_COLUMN, CALM_PREDICTION_COLUMN, BOUNDED_ERROR_COLUMN, DRIFT_COLUMN = range(4)
EXCLUSION_NOT_STATED = (
    "chance excluded it, weighing every onset of every fault: more than a certificate can hold"
)
ALARM_NOT_STATED = "chance raised it: an onset long before, a tone, or a force"


def alarm_statement(tape: Tape, history: History, surfaces: Sequence[str], k: int) -> Document | None:
    """The statement that chance raised the alarm at row k; None where it is not one onset's, or too old."""
    diagnosis = tape.alarm.diagnosis
    b, h, slot = _largest_score(diagnosis.statistical_filters)
    first = next((r for r in range(k, tape.first, -1) if restarting_slot(r - tape.since) == slot), None)
    if first is None or k - first > MAX_WRITTEN_FRAMES:
        return None
    hypothesis = diagnosis.statistical_filters[b].hypotheses[h]
    score = hypothesis.score_in_std / diagnosis.statistical_alarm_level
    said = _likelihood_fields(tape, history, (b, h, slot), range(first, k + 1))
    if score > 1.0 + LOGGED_SCORE_TOLERANCE:
        _remove_negligible(said, history)
    value, limit, _ = sides(said, history)
    if not (value > limit and abs(value / limit - score) <= LOGGED_SCORE_TOLERANCE * score):
        return None
    return {"likelihood": _share_column(hypothesis, surfaces), **said, "sides": [[value], [limit]]}


def alarm_excludes(tape: Tape, e: int, alarm: Document) -> bool:
    """Whether chance raised the alarm where the fault of estimator e moves nothing: then it is excluded."""
    if "likelihood" not in alarm:
        return False
    here = slice(alarm["first"] - 1 - tape.first, alarm["frame"] + 1 - tape.first)
    moved = [values[here, e][:, alarm["axes"]].any() for values in (tape.slope, tape.offset, tape.spread)]
    return not any(moved)


def with_logged_share(said: Document, logged: float) -> Document:
    """The statement with the share that the log has: as large, or larger where another view has more."""
    (value,), (limit,) = said["sides"]
    return said | {"sides": [[value, logged * (1.0 + LOGGED_SCORE_TOLERANCE)], [limit, value / limit]]}


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


def _remove_negligible(said: Document, history: History) -> None:
    """Take out what decides nothing: what the filter has forgotten, and of the bounds on what is no noise."""
    sums = _run_filter(said, _filter_inputs(said, history), *_variances(said))
    _, limit, decides = _evidence_and_limit(said, sums)
    for its in said["frames"]:
        if decides == LIMIT_BY_NOISE:
            del its["bounded"]
        if decides != LIMIT_BY_CHANGE_RATE:
            del its["pace"]
    m = len(said["tolerance"])
    matters = [
        j
        for j in range(m)
        if said["tolerance"][j] * abs(sums.totals[2 + j]) > NEGLIGIBLE_SHARE_OF_LIMIT * limit
    ]
    if len(matters) > MAX_WRITTEN_CONSTANTS:
        _merge_constants(said, np.array(said["tolerance"]) * np.sign(sums.totals[2:]))
        matters = [0]
    said["tolerance"] = [said["tolerance"][j] for j in matters]
    said["Y"] = [[row[0], None, *(row[2 + j] for j in matters)] for row in said["Y"]]
    for its in said["frames"]:
        if "known" in its:
            its["known"] = [its["known"][j] for j in matters]
        if "foreseen" in its and sums.calm_prediction >= 0.0:
            del its["foreseen"]
    for row, felt in zip(said["Y"], sums.of_initial_states, strict=True):
        for c, tolerance in ((0, 1.0), *enumerate(said["tolerance"], 2)):
            if abs(felt * row[c]) * tolerance < NEGLIGIBLE_SHARE_OF_LIMIT * limit:
                row[c] = None
    _remove_negligible_variances(said, history)


def _merge_constants(said: Document, worst: np.ndarray) -> None:
    """Put one constant in the place of many: all at their `worst`, which is linear in them."""
    said["tolerance"] = [1.0]
    said["Y"] = [[*row[:2], float(worst @ row[2:])] for row in said["Y"]]
    for its in said["frames"]:
        its["known"] = [(worst @ np.array(its["known"])).tolist()]


def _remove_negligible_variances(said: Document, history: History) -> None:
    """The same of R, and of P with what stands opposite."""
    frames, (P, R) = _filter_inputs(said, history), _variances(said)
    value, limit, _ = _evidence_and_limit(said, _run_filter(said, frames, P, R))

    def decides(P: np.ndarray, R: np.ndarray) -> bool:
        value_without, limit_without, _ = _evidence_and_limit(
            said, _run_filter(said, frames, P, R)
        )  # nan: no covariance without it
        return (
            not max(abs(value_without - value), abs(limit_without - limit))
            <= NEGLIGIBLE_SHARE_OF_LIMIT * limit
        )

    for i in range(len(P)):
        for j in range(i, len(P)):
            left = P.copy()
            left[i, j] = left[j, i] = 0.0
            if not decides(left, R):
                said["P"][i][j] = said["P"][j][i] = None
    for i in range(len(R)):
        if not decides(P, np.where(np.arange(len(R)) == i, 0.0, R)):
            said["R"][i] = None


def _largest_score(blocks: Sequence[StatisticalBlock]) -> tuple[int, int, int]:
    """Block, hypothesis and slot of the largest score that raises alarms."""
    best, found = -1.0, (0, 0, 0)
    for b, block in enumerate(blocks):
        for h, hypothesis in enumerate(block.hypotheses):
            if hypothesis.may_raise_alarm and hypothesis.score_in_std > best:
                best = hypothesis.score_in_std
                found = (b, h, int(np.argmax(block.hypothesis_tests_by_onset.score[h])))
    return found


def _likelihood_fields(tape: Tape, history: History, test: tuple[int, int, int], rows: range) -> Document:
    """The statement of a test, block, hypothesis and onset's slot, with these frames."""
    (b, h, slot), dt, diagnosis = test, history.dt, tape.alarm.diagnosis
    block, here = diagnosis.statistical_filters[b], slice(rows[0] - 1 - tape.first, rows[-1] + 1 - tape.first)
    of = {name: tape.filters[name][here, b] for name in (*RECORDED_BLOCK_FIELDS, "signature")}
    then, now = ({name: values[part] for name, values in of.items()} for part in (np.s_[:-1], np.s_[1:]))
    felt = _affected_axes(of, now["signature"][:, h], len(block.axis_indices))
    n, states, axes = len(felt), [*felt, *(2 + i for i in felt)], [block.axis_indices[i] for i in felt]
    square = np.ix_(range(len(rows)), felt, felt)
    known = [j for j in np.flatnonzero(block.regressor_coefficient_error_bound > 0.0).tolist()
             if now["g_Z"][:, j][:, felt].any()]  # fmt: skip
    drift = dt * then["Q_d"][square]  # which is felt a frame later
    drift[1:], drift[0] = drift[:-1].copy(), 0.0
    before = then["x_Z"][:, known][..., states]
    response = now["g_Z"][:, known][..., felt]
    its = {
        "signature": now["signature"][:, h][:, felt],
        "jitter": dt * dt * then["Q_x"][:, felt],
        "drift": drift, "bounded": tape.filters["bounded"][here][:-1][:, axes],
        "pace": then["eta_rate"],
    }  # fmt: skip
    if block.drift_correlation_length_m > 0.0:
        its["keep"] = then["a"]
    if known:
        its["known"] = (response - before[..., :n]) / dt + before[..., n:]  # that gave this response
    if diagnosis.gust.is_turbulence_declared:
        its["air"] = tape.filters["air"][here][1:][:, axes]
        drift += (
            block.factor_on_gust_drift_intensity
            * tape.filters["leap"][here][1:][np.ix_(range(len(rows)), axes, axes)]
        )
    tests_by_onset = block.hypothesis_tests_by_onset
    sense, explained = tests_by_onset.supporting_correlation_sign[h, slot], {
        "p": tests_by_onset.correlation_predictable_in_calm_air,
        "g_c": tests_by_onset.correlation_from_coarse_gust,
    }  # fmt: skip
    taken = [name for name, values in explained.items() if sense * values[h, slot] > 0.0]
    if taken:  # each of them where it speaks for the loss
        its["foreseen"] = np.sum([now[name] for name in taken], axis=0)[:, felt]
    state = then["state"][0, states]
    Y = np.array([state, np.zeros(2 * n), *before[0]]).T
    xx, xd, dd = (of[name][0][np.ix_(felt, felt)] for name in ("P_xx", "P_xd", "P_dd"))
    Y, P = np.vstack([Y[:n], -Y[n:]]), np.block([[xx, xd], [xd.T, dd]])
    lists = zip(*(values.tolist() for values in its.values()), strict=True)
    frames = [dict(zip(its, row, strict=True)) for row in lists]
    return {
        "level": diagnosis.statistical_alarm_level, "axes": axes, "sense": "less" if sense else "either",
        "tolerance": [float(block.regressor_coefficient_error_bound[j]) for j in known],
        "R": of["R_y"][0, felt].tolist(), "Y": Y.tolist(),
        "P": (0.5 * (P + P.T)).tolist(),  # else rounding sets both sides apart
        "first": rows[0], "frames": frames,
    }  # fmt: skip


def _affected_axes(of: Mapping[str, np.ndarray], signature: np.ndarray, n: int) -> list[int]:
    """The axes of a block of n that the fault moves; both where what is not known moves them together."""
    together = n > 1 and any(of[name][..., 0, 1].any() for name in ("P_xx", "P_xd", "P_dd", "Q_d"))
    return [i for i in range(n) if together or signature[:, i].any()]


def sides(said: Document, history: History) -> tuple[float, float, int]:
    """Evidence; the limit that it must exceed; and what the limit follows from: LIMIT_BY_NOISE or another."""
    return _evidence_and_limit(said, _run_filter(said, _filter_inputs(said, history), *_variances(said)))


def _variances(said: Document) -> tuple[np.ndarray, np.ndarray]:
    """P (2 n, 2 n) and R (n,), zero where nothing stands."""
    P, R = (np.nan_to_num(np.array(said[name], float)) for name in "PR")
    return P, R


class _FilterInputs(NamedTuple):
    """Inputs of the filter in each of n frames; of two axes, the second zero where there is one.

    inputs (n, columns, 2): one column for each column of Y, and one for each state before the first frame.
    drift (n, 2, 2): variance that a frame adds to the drift. frame_parameters (n, 4, 2): FRAME_COLUMNS. dt s.
    """

    inputs: np.ndarray
    drift: np.ndarray
    frame_parameters: np.ndarray
    dt: float


class _WhitenedSums(NamedTuple):
    """Sums over the frames of w.g for each column: totals (2 + constants,) of Y; of_initial_states (2 n,), by
    which each state before the first frame enters the first total; calm_prediction: the part of the first
    total that calm air predicts; room_by_swings, room_by_change_rate: effect of a bounded uncertainty."""

    totals: np.ndarray
    of_initial_states: np.ndarray
    calm_prediction: float
    room_by_swings: float
    room_by_change_rate: float


def _filter_inputs(said: Document, history: History) -> _FilterInputs:
    """The frames of a statement."""
    frames, axes, dt = said["frames"], said["axes"], history.dt
    n, m, k = len(axes), 2 + len(said["tolerance"]), len(frames)
    found = _FilterInputs(
        np.zeros((k, m + 2 * n, 2)), np.zeros((k, 2, 2)), np.zeros((k, len(FRAME_COLUMNS), 2)), dt
    )
    first = said["first"]
    found.inputs[:, 0, :n] = history.innovation(slice(first, first + k))[:, axes]
    found.inputs[:, 1, :n] = [its["signature"] for its in frames]
    found.drift[:, :n, :n] = [its["drift"] for its in frames]
    found.frame_parameters[:, DRIFT_COLUMN] = [(its.get("keep", 1.0), its.get("pace", 1e9)) for its in frames]
    if "air" in frames[0]:
        found.inputs[:, 0, :n] -= [its["air"] for its in frames]
    if "known" in frames[0] and m > 2:
        found.inputs[:, 2:m, :n] = [its["known"] for its in frames]
    for place, name in (
        (MODEL_NOISE_COLUMN, "jitter"),
        (CALM_PREDICTION_COLUMN, "foreseen"),
        (BOUNDED_ERROR_COLUMN, "bounded"),
    ):
        if name in frames[0]:
            found.frame_parameters[:, place, :n] = [its[name] for its in frames]
    found.frame_parameters[:, MODEL_NOISE_COLUMN] /= dt * dt
    return found


def _run_filter(said: Document, frames: _FilterInputs, P: np.ndarray, R: np.ndarray) -> _WhitenedSums:
    """Run the filter; P, R: variances before the first frame, and of gyros."""
    n, m = len(R), 2 + len(said["tolerance"])
    block, states = new_filter_block(P, R), np.zeros((m + 2 * n, 4))
    Y = np.column_stack([np.nan_to_num(np.array(said["Y"], float)), np.eye(2 * n)]).T
    states[:, :n], states[:, 2 : 2 + n] = Y[:, :n], -Y[:, n:]
    sums, room = np.zeros(m + 2 * n), np.zeros(5)
    add_whitened_frames(block, *frames[:3], states, sums, room, frames.dt)
    swings, drifts, last, stays, foreseen = room.tolist()
    return _WhitenedSums(sums[:m], sums[m:], foreseen, stays + swings + last, stays + drifts)


@kernel
def add_whitened_frames(blocks, inputs, drift, frame_parameters, states, sums, room, dt):
    """Run a filter, blocks (1,), over `_FilterInputs`, and add w.g of each frame to `sums` (columns,): g, the
    whitened innovation of each column, w = S^-1 g of the second, the signature. See
    `likelihood.accumulate_tests`.

    states (columns, 4): advanced in place. room (5,): what a bounded uncertainty can add as it swings, at its
    pace, in the last frame, as it stays; and of the first of `sums` the prediction for calm air.
    """
    block, g, w = blocks[0], np.zeros((len(states), 2)), np.zeros(2)
    for k in range(len(inputs)):
        given = frame_parameters[k]
        block.a = given[DRIFT_COLUMN, 0]
        for i in range(block.n):
            block.Q_x[i] = given[MODEL_NOISE_COLUMN, i]
            for j in range(block.n):
                block.P_dd[i, j] += drift[k, i, j]
        advance_block(block, dt)
        response_of_block(block, given[BOUNDED_ERROR_COLUMN], dt)
        for c in range(len(states)):
            whiten_frame(block, states[c], inputs[k, c], dt, g[c])
        room[2] = 0.0
        for i in range(block.n):
            before, w[i] = w[i], 0.0
            for j in range(block.n):
                w[i] += block.S_inv[i, j] * g[1, j]
            room[0] += block.eta_r[i] * abs(w[i] - before)
            room[1] += given[DRIFT_COLUMN, 1] * block.eta_r[i] * abs(w[i])
            room[2] += block.eta_r[i] * abs(w[i])
            room[3] += block.eta_0[i] * abs(w[i])
            room[4] += w[i] * given[CALM_PREDICTION_COLUMN, i]
            for c in range(len(states)):
                sums[c] += w[i] * g[c, i]


def _evidence_and_limit(said: Document, sums: _WhitenedSums) -> tuple[float, float, int]:
    """As of `sides`."""
    N, D, *R = sums.totals.tolist()
    root = said["level"] * sqrt(D) if D >= 0.0 else nan
    of_swings, of_pace = (
        room + LEVEL_NOISE_SHARE * root for room in (sums.room_by_swings, sums.room_by_change_rate)
    )
    decides = (
        LIMIT_BY_NOISE
        if root >= min(of_swings, of_pace)
        else (LIMIT_BY_SWINGS if of_swings <= of_pace else LIMIT_BY_CHANGE_RATE)
    )
    evidence = -N - max(0.0, -sums.calm_prediction) if said["sense"] == "less" else abs(N)
    evidence -= sum(tol * abs(total) for tol, total in zip(said["tolerance"], R, strict=True))
    return evidence, max(root, min(of_swings, of_pace)), decides
