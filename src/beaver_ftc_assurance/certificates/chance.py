"""The alarm of chance: a fault's likelihood ratio from its onset to the alarm (theory.md, section 7).

What the log does not hold is kept frame by frame: signature, what declared constants multiply, variances.
"""

from collections.abc import Mapping, Sequence
from math import nan, sqrt
from typing import NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import OF_BLOCK, DiagnosisReadout, StatisticalBlock, StatisticalHypothesis
from beaver_ftc.diagnosis.detection import (
    CHANCE,
    advance_block,
    filter_block,
    response_of_block,
    slot_to_reset,
    whiten_frame,
)
from beaver_ftc.diagnosis.detection import STEP_HYPOTHESIS as STEP
from beaver_ftc_assurance.certificates.inequality import Document, History
from beaver_ftc_assurance.certificates.tape import Tape

_AS_LOGGED = 1e-5  # of the alarm's score: more than all that is left out makes
_FORGOTTEN = 1e-7  # of the limit
_CONSTANTS = 6  # of more in each frame a certificate would have over 200 kB too
_LONGEST = 520  # frames: of more a certificate would have over 200 kB
NOISE, SWINGS, PACE = range(3)  # what the evidence must exceed: chance alone, or bounded uncertainty besides
OF_FRAME = JITTER, FORESEEN, BOUNDED, COURSE = range(4)  # the last: keep, and pace
NOT_EXCLUDED = "chance excluded it, weighing every onset of every fault: more than a certificate can hold"
NOT_STATED = "chance raised it: an onset long before, a tone, or a force"


def of_alarm(tape: Tape, history: History, surfaces: Sequence[str], k: int) -> Document | None:
    """The statement that chance raised the alarm at row k; None where it is not one onset's, or too old."""
    diagnosis = tape.alarm.diagnosis
    b, h, slot = _loudest(diagnosis.blocks)
    first = next((r for r in range(k, tape.first, -1) if slot_to_reset(r - tape.since) == slot), None)
    if first is None or k - first > _LONGEST:
        return None
    hypothesis = diagnosis.blocks[b].hypotheses[h]
    score = hypothesis.score / diagnosis.alarm_level
    said = _written(tape, history, (b, h, slot), range(first, k + 1))
    if score > 1.0 + _AS_LOGGED:
        _leave_out(said, history)
    value, limit, _ = sides(said, history)
    if not (value > limit and abs(value / limit - score) <= _AS_LOGGED * score):
        return None
    return {"likelihood": _column(hypothesis, surfaces), **said, "sides": [[value], [limit]]}


def says_nothing_of(tape: Tape, e: int, alarm: Document) -> bool:
    """Whether chance raised the alarm where the fault of estimator e moves nothing: then it is excluded."""
    if "likelihood" not in alarm:
        return False
    here = slice(alarm["first"] - 1 - tape.first, alarm["frame"] + 1 - tape.first)
    moved = [values[here, e][:, alarm["axes"]].any() for values in (tape.slope, tape.offset, tape.spread)]
    return not any(moved)


def with_share(said: Document, logged: float) -> Document:
    """The statement with the share that the log has: as large, or larger where another view has more."""
    (value,), (limit,) = said["sides"]
    return said | {"sides": [[value, logged * (1.0 + _AS_LOGGED)], [limit, value / limit]]}


def shares(diagnosis: DiagnosisReadout, surfaces: Sequence[str]) -> dict[str, float]:
    """Column, and largest share of the alarm level, of each hypothesis that raises alarms."""
    found: dict[str, float] = {}
    for hypothesis in (each for block in diagnosis.blocks for each in block.hypotheses if each.raises_alarm):
        column, share = _column(hypothesis, surfaces), hypothesis.score / diagnosis.alarm_level
        found[column] = max(found.get(column, 0.0), share)
    return found


def _column(of: StatisticalHypothesis, surfaces: Sequence[str]) -> str:
    name = f"{AXES[of.axis]}_step" if of.kind == STEP else f"{surfaces[of.surface]}_loss"
    return f"{name}_likelihood_share"


def _leave_out(said: Document, history: History) -> None:
    """Take out what decides nothing: what the filter has forgotten, and of the bounds on what is no noise."""
    sums = _followed(said, _frames(said, history), *_variances(said))
    _, limit, decides = _weighed(said, sums)
    for its in said["frames"]:
        if decides == NOISE:
            del its["bounded"]
        if decides != PACE:
            del its["pace"]
    m = len(said["tolerance"])
    matters = [j for j in range(m) if said["tolerance"][j] * abs(sums.of[2 + j]) > _FORGOTTEN * limit]
    if len(matters) > _CONSTANTS:
        _add_up(said, np.array(said["tolerance"]) * np.sign(sums.of[2:]))
        matters = [0]
    said["tolerance"] = [said["tolerance"][j] for j in matters]
    said["Y"] = [[row[0], None, *(row[2 + j] for j in matters)] for row in said["Y"]]
    for its in said["frames"]:
        if "known" in its:
            its["known"] = [its["known"][j] for j in matters]
        if "foreseen" in its and sums.foreseen >= 0.0:
            del its["foreseen"]
    for row, felt in zip(said["Y"], sums.owed, strict=True):
        for c, tolerance in ((0, 1.0), *enumerate(said["tolerance"], 2)):
            if abs(felt * row[c]) * tolerance < _FORGOTTEN * limit:
                row[c] = None
    _leave_out_variances(said, history)


def _add_up(said: Document, worst: np.ndarray) -> None:
    """Put one constant in the place of many: all at their `worst`, which is linear in them."""
    said["tolerance"] = [1.0]
    said["Y"] = [[*row[:2], float(worst @ row[2:])] for row in said["Y"]]
    for its in said["frames"]:
        its["known"] = [(worst @ np.array(its["known"])).tolist()]


def _leave_out_variances(said: Document, history: History) -> None:
    """The same of R, and of P with what stands opposite."""
    frames, (P, R) = _frames(said, history), _variances(said)
    value, limit, _ = _weighed(said, _followed(said, frames, P, R))

    def decides(P: np.ndarray, R: np.ndarray) -> bool:
        without, least, _ = _weighed(said, _followed(said, frames, P, R))  # nan: no covariance without it
        return not max(abs(without - value), abs(least - limit)) <= _FORGOTTEN * limit

    for i in range(len(P)):
        for j in range(i, len(P)):
            left = P.copy()
            left[i, j] = left[j, i] = 0.0
            if not decides(left, R):
                said["P"][i][j] = said["P"][j][i] = None
    for i in range(len(R)):
        if not decides(P, np.where(np.arange(len(R)) == i, 0.0, R)):
            said["R"][i] = None


def _loudest(blocks: Sequence[StatisticalBlock]) -> tuple[int, int, int]:
    """Block, hypothesis and slot of the largest score that raises alarms."""
    best, found = -1.0, (0, 0, 0)
    for b, block in enumerate(blocks):
        for h, hypothesis in enumerate(block.hypotheses):
            if hypothesis.raises_alarm and hypothesis.score > best:
                best, found = hypothesis.score, (b, h, int(np.argmax(block.lanes.score[h])))
    return found


def _written(tape: Tape, history: History, test: tuple[int, int, int], rows: range) -> Document:
    """The statement of a test, block, hypothesis and onset's slot, with these frames."""
    (b, h, slot), dt, diagnosis = test, history.dt, tape.alarm.diagnosis
    block, here = diagnosis.blocks[b], slice(rows[0] - 1 - tape.first, rows[-1] + 1 - tape.first)
    of = {name: tape.filters[name][here, b] for name in (*OF_BLOCK, "signature")}
    then, now = ({name: values[part] for name, values in of.items()} for part in (np.s_[:-1], np.s_[1:]))
    felt = _felt(of, now["signature"][:, h], len(block.axes))
    n, states, axes = len(felt), [*felt, *(2 + i for i in felt)], [block.axes[i] for i in felt]
    square = np.ix_(range(len(rows)), felt, felt)
    known = [j for j in np.flatnonzero(block.tolerance > 0.0).tolist()
             if now["regressor_response"][:, j][:, felt].any()]  # fmt: skip
    drift = dt * then["drift"][square]  # which is felt a frame later
    drift[1:], drift[0] = drift[:-1].copy(), 0.0
    before, response = (
        then["regressor_state"][:, known][..., states],
        now["regressor_response"][:, known][..., felt],
    )
    its = {
        "signature": now["signature"][:, h][:, felt], "jitter": dt * dt * then["jitter"][:, felt],
        "drift": drift, "bounded": tape.filters["bounded"][here][:-1][:, axes], "pace": then["pace"],
    }  # fmt: skip
    if block.return_length > 0.0:
        its["keep"] = then["keep"]
    if known:
        its["known"] = (response - before[..., :n]) / dt + before[..., n:]  # that gave this response
    if diagnosis.air.moving:
        its["air"] = tape.filters["air"][here][1:][:, axes]
        drift += block.drift_scale * tape.filters["leap"][here][1:][np.ix_(range(len(rows)), axes, axes)]
    lanes = block.lanes
    sense, explained = lanes.sense[h, slot], {
        "calm_prediction": lanes.calm_prediction, "gust_response": lanes.gust_response,
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
        "level": diagnosis.alarm_level, "axes": axes, "sense": "less" if sense else "either",
        "tolerance": [float(block.tolerance[j]) for j in known],
        "R": of["noise"][0, felt].tolist(), "Y": Y.tolist(),
        "P": (0.5 * (P + P.T)).tolist(),  # else rounding sets both sides apart
        "first": rows[0], "frames": frames,
    }  # fmt: skip


def _felt(of: Mapping[str, np.ndarray], signature: np.ndarray, n: int) -> list[int]:
    """The axes of a block of n that the fault moves; both where what is not known moves them together."""
    together = n > 1 and any(of[name][..., 0, 1].any() for name in ("P_xx", "P_xd", "P_dd", "drift"))
    return [i for i in range(n) if together or signature[:, i].any()]


def sides(said: Document, history: History) -> tuple[float, float, int]:
    """Evidence, what it must exceed, and which of NOISE, SWINGS, PACE that follows from."""
    return _weighed(said, _followed(said, _frames(said, history), *_variances(said)))


def _variances(said: Document) -> tuple[np.ndarray, np.ndarray]:
    """P (2 n, 2 n) and R (n,), zero where nothing stands."""
    P, R = (np.nan_to_num(np.array(said[name], float)) for name in "PR")
    return P, R


class _Frames(NamedTuple):
    """What the filter takes, of two axes, the second zero where there is one: of each frame inputs, columns
    as of Y and one for each state before the first; the drift's variance; and OF_FRAME."""

    inputs: np.ndarray
    drift: np.ndarray
    of_frame: np.ndarray
    dt: float


class _Sums(NamedTuple):
    """N, D, each R (2 + constants,); what N owes to each state before the first frame (2 n,); of N what calm
    air predicts; what a bounded uncertainty adds as it swings, and at its pace."""

    of: np.ndarray
    owed: np.ndarray
    foreseen: float
    swings: float
    drifts: float


def _frames(said: Document, history: History) -> _Frames:
    """The frames of a statement."""
    frames, axes, dt = said["frames"], said["axes"], history.dt
    n, m, k = len(axes), 2 + len(said["tolerance"]), len(frames)
    found = _Frames(np.zeros((k, m + 2 * n, 2)), np.zeros((k, 2, 2)), np.zeros((k, len(OF_FRAME), 2)), dt)
    first = said["first"]
    found.inputs[:, 0, :n] = history.innovation(slice(first, first + k))[:, axes]
    found.inputs[:, 1, :n] = [its["signature"] for its in frames]
    found.drift[:, :n, :n] = [its["drift"] for its in frames]
    found.of_frame[:, COURSE] = [(its.get("keep", 1.0), its.get("pace", 1e9)) for its in frames]
    if "air" in frames[0]:
        found.inputs[:, 0, :n] -= [its["air"] for its in frames]
    if "known" in frames[0] and m > 2:
        found.inputs[:, 2:m, :n] = [its["known"] for its in frames]
    for place, name in ((JITTER, "jitter"), (FORESEEN, "foreseen"), (BOUNDED, "bounded")):
        if name in frames[0]:
            found.of_frame[:, place, :n] = [its[name] for its in frames]
    found.of_frame[:, JITTER] /= dt * dt
    return found


def _followed(said: Document, frames: _Frames, P: np.ndarray, R: np.ndarray) -> _Sums:
    """Run the filter; P, R: variances before the first frame, and of gyros."""
    n, m = len(R), 2 + len(said["tolerance"])
    block, states = filter_block(P, R), np.zeros((m + 2 * n, 4))
    Y = np.column_stack([np.nan_to_num(np.array(said["Y"], float)), np.eye(2 * n)]).T
    states[:, :n], states[:, 2 : 2 + n] = Y[:, :n], -Y[:, n:]
    sums, room = np.zeros(m + 2 * n), np.zeros(5)
    follow(block, *frames[:3], states, sums, room, frames.dt)
    swings, drifts, last, stays, foreseen = room.tolist()
    return _Sums(sums[:m], sums[m:], foreseen, stays + swings + last, stays + drifts)


@kernel
def follow(blocks, inputs, drift, of_frame, states, sums, room, dt):
    """Run a filter, blocks (1,), over `_Frames`, and add what it makes of each input to `sums`, weighed by
    what it makes of the second, as `likelihood.accumulate_correlations` does.

    states (columns, 4): advanced in place. room (5,): what a bounded uncertainty can add as it swings, at its
    pace, in the last frame, as it stays; and of the first of `sums` the prediction for calm air.
    """
    block, g, w = blocks[0], np.zeros((len(states), 2)), np.zeros(2)
    for k in range(len(inputs)):
        given = of_frame[k]
        block.keep = given[COURSE, 0]
        for i in range(block.n):
            block.jitter[i] = given[JITTER, i]
            for j in range(block.n):
                block.P_dd[i, j] += drift[k, i, j]
        advance_block(block, dt)
        response_of_block(block, given[BOUNDED], dt)
        for c in range(len(states)):
            whiten_frame(block, states[c], inputs[k, c], dt, g[c])
        room[2] = 0.0
        for i in range(block.n):
            before, w[i] = w[i], 0.0
            for j in range(block.n):
                w[i] += block.S_inverse[i, j] * g[1, j]
            room[0] += block.transient_response[i] * abs(w[i] - before)
            room[1] += given[COURSE, 1] * block.transient_response[i] * abs(w[i])
            room[2] += block.transient_response[i] * abs(w[i])
            room[3] += block.constant_response[i] * abs(w[i])
            room[4] += w[i] * given[FORESEEN, i]
            for c in range(len(states)):
                sums[c] += w[i] * g[c, i]


def _weighed(said: Document, sums: _Sums) -> tuple[float, float, int]:
    """As of `sides`."""
    N, D, *R = sums.of.tolist()
    root = said["level"] * sqrt(D) if D >= 0.0 else nan
    of_swings, of_pace = (room + CHANCE * root for room in (sums.swings, sums.drifts))
    decides = NOISE if root >= min(of_swings, of_pace) else (SWINGS if of_swings <= of_pace else PACE)
    evidence = -N - max(0.0, -sums.foreseen) if said["sense"] == "less" else abs(N)
    evidence -= sum(tol * abs(total) for tol, total in zip(said["tolerance"], R, strict=True))
    return evidence, max(root, min(of_swings, of_pace)), decides
