"""Evidence of an alarm by the statistical detector: the likelihood ratio of a fault from its onset to the
alarm.

docs/explanation/statistical.md derives the ratio, and likelihood_ratio.py evaluates and shortens it. Here its
inputs (signature, regressors of declared constants, variances) are read from the recorded frames (tape.py),
since the log lacks them. Numbers: b of a block of filters, h of a hypothesis in it, slot of an onset.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.diagnosis import (
    RECORDED_BLOCK_FIELDS,
    DiagnosisReadout,
    StatisticalBlock,
    StatisticalHypothesis,
)
from beaver_ftc.diagnosis.detection import STEP_HYPOTHESIS as STEP
from beaver_ftc.diagnosis.detection import restarting_slot
from beaver_ftc_assurance.certificates.history import Document, History
from beaver_ftc_assurance.certificates.likelihood_ratio import Inputs, LikelihoodRatio
from beaver_ftc_assurance.certificates.tape import Tape

LOGGED_SCORE_TOLERANCE = 1e-5  # relative; the numbers that a certificate leaves out change the score by less
MAX_WRITTEN_FRAMES = 520  # with more frames, a certificate would exceed 200 kB
EXCLUSION_NOT_STATED = (
    "chance excluded it, weighing every onset of every fault: more than a certificate can hold"
)
ALARM_NOT_STATED = "chance raised it: an onset long before, a tone, or a force"


def alarm_evidence(
    history: History, surfaces: Sequence[str], rows: Mapping[str, np.ndarray], k: int
) -> Document | None:
    """The evidence of a statistical alarm at row k; None if its onset is too old, or if the ratio from the
    frames does not exceed 1, or differs from the score of the detector.

    rows: the log, whose column has the largest share of the alarm level over all blocks of a hypothesis, so
    at least the share of this evidence. first: the last row at which the slot of the largest score restarted.
    """
    tape = history.tape
    diagnosis = tape.alarm.diagnosis
    b, h = _largest_score(diagnosis.statistical_filters)
    block = diagnosis.statistical_filters[b]
    hypothesis = block.hypotheses[h]
    slot = int(np.argmax(block.onset_tests.score[h]))
    first = next((r for r in range(k, tape.first, -1) if restarting_slot(r - tape.since) == slot), None)
    if first is None or k - first >= MAX_WRITTEN_FRAMES:
        return None
    score = hypothesis.score_in_std / diagnosis.statistical_alarm_level
    ratio = _likelihood_ratio(history, (b, h, slot), range(first, k + 1))
    if score > 1.0 + LOGGED_SCORE_TOLERANCE:
        ratio = ratio.without_negligible()
    value, limit = ratio.sides
    if not (value > limit and abs(value / limit - score) <= LOGGED_SCORE_TOLERANCE * score):
        return None
    column = _share_column(hypothesis, surfaces)
    logged = float(rows[column][k]) * (1.0 + LOGGED_SCORE_TOLERANCE)
    return {"likelihood": column, **ratio.fields, "sides": [[value, logged], [limit, value / limit]]}


def exclusion_by_alarm(tape: Tape, e: int, alarm: Document) -> Document:
    """The evidence that the statistical alarm was on axes that the fault of estimator e does not move; if it
    moves one of them, the reason why there is no evidence."""
    if "likelihood" in alarm:
        span = slice(alarm["first"] - 1 - tape.first, alarm["frame"] + 1 - tape.first)
        moved = (values[span, e][:, alarm["axes"]] for values in (tape.slope, tape.offset, tape.spread))
        if not any(values.any() for values in moved):
            return {"as": "alarm"}
    return {"because": EXCLUSION_NOT_STATED}


def likelihood_shares(diagnosis: DiagnosisReadout, surfaces: Sequence[str]) -> dict[str, float]:
    """Column of the log -> largest share of the alarm level, for the hypotheses that may raise alarms."""
    shares: dict[str, float] = {}
    for block in diagnosis.statistical_filters:
        for hypothesis in block.hypotheses:
            if hypothesis.may_raise_alarm:
                column = _share_column(hypothesis, surfaces)
                share = hypothesis.score_in_std / diagnosis.statistical_alarm_level
                shares[column] = max(shares.get(column, 0.0), share)
    return shares


def _share_column(hypothesis: StatisticalHypothesis, surfaces: Sequence[str]) -> str:
    """The column of the log for a hypothesis."""
    name = (
        f"{AXES[hypothesis.axis]}_step" if hypothesis.kind == STEP else f"{surfaces[hypothesis.surface]}_loss"
    )
    return f"{name}_likelihood_share"


def _largest_score(blocks: Sequence[StatisticalBlock]) -> tuple[int, int]:
    """Block and hypothesis of the largest score, out of those that may raise alarms."""
    places = [(b, h) for b, block in enumerate(blocks) for h, hypothesis in enumerate(block.hypotheses)
              if hypothesis.may_raise_alarm]  # fmt: skip
    return max(places, key=lambda bh: blocks[bh[0]].hypotheses[bh[1]].score_in_std, default=(0, 0))


def _likelihood_ratio(history: History, test: tuple[int, int, int], rows: range) -> LikelihoodRatio:
    """The ratio of a test (b, h, slot) over the given rows.

    moved: positions in the block of the axes (`_affected_axes`). states: positions of their rate errors, then
    of their drifts, in the states of the block. known: numbers of the declared constants that act on these
    axes.
    """
    b, h, slot = test
    tape = history.tape
    dt = history.dt
    diagnosis = tape.alarm.diagnosis
    block = diagnosis.statistical_filters[b]
    before, now = _before_and_now(tape, b, h, rows)
    moved = _affected_axes(before, now, len(block.axes))
    states = [*moved, *(2 + i for i in moved)]
    axes = [block.axes[i] for i in moved]
    tolerance = block.tolerance
    known = [j for j in np.flatnonzero(tolerance > 0.0).tolist() if now["g_Z"][:, j][:, moved].any()]
    regressors = air = None
    drift = _a_frame_later(dt * before["Q_d"][:, moved][:, :, moved])
    if known:  # their filter's g = e + dt (v - d), x_Z = (e, d), solved for the input v
        e, d = np.split(before["x_Z"][:, known][..., states], 2, axis=2)
        regressors = (now["g_Z"][:, known][..., moved] - e) / dt + d
    if diagnosis.gust.is_turbulence_declared:
        air = now["air"][:, axes]
        leap = now["leap"][:, axes][:, :, axes]  # the gust's axes turn
        drift += block.gust_drift_factor * leap
    sense = block.onset_tests.sign[h, slot]
    supporting = [now[name] for name in _supporting_parts(block, h, slot)]
    series = Inputs(
        signature=now["signature"][:, moved], jitter=dt * dt * before["Q_x"][:, moved], drift=drift,
        bounded=before["bounded"][:, axes], pace=before["eta_rate"], known=regressors, air=air,
        keep=before["a"] if block.drift_length_m > 0.0 else None,
        foreseen=np.sum(supporting, axis=0)[:, moved] if supporting else None,
    )  # fmt: skip
    Y, P = _states_of({name: values[0] for name, values in before.items()}, states, known)
    return LikelihoodRatio(
        level=diagnosis.statistical_alarm_level, axes=axes, sense="less" if sense else "either",
        tolerance=tolerance[known], R=before["R_y"][0, moved], Y=Y, P=P, first=rows[0], series=series,
        innovation=history.innovation_rad_s2[rows[0] : rows[-1] + 1, axes], dt=dt,
    )  # fmt: skip


Quantities = dict[str, np.ndarray]


def _before_and_now(tape: Tape, b: int, h: int, rows: range) -> tuple[Quantities, Quantities]:
    """Recorded quantities of hypothesis h of block b: at the end of the row before each row, and of the row
    itself, (rows, ...). The detector prepares noise, decay, bound and rate of change of the drift at the end
    of the row before; it fills inputs and responses in the row itself."""
    span = slice(rows[0] - 1 - tape.first, rows[-1] + 1 - tape.first)
    recorded = {name: tape.filters[name][span] for name in ("bounded", "air", "leap")}
    recorded |= {name: tape.filters[name][span, b] for name in RECORDED_BLOCK_FIELDS}
    recorded["signature"] = tape.filters["signature"][span, b, h]
    before, now = ({name: x[part] for name, x in recorded.items()} for part in (np.s_[:-1], np.s_[1:]))
    return before, now


def _a_frame_later(drift: np.ndarray) -> np.ndarray:
    """Covariances drift (frames, n, n) one frame later, because the detector adds them after the decay of the
    drift, and `add_whitened_frames` before it."""
    return np.concatenate([np.zeros_like(drift[:1]), drift[:-1]])


def _supporting_parts(block: StatisticalBlock, h: int, slot: int) -> list[str]:
    """The recorded quantities of the predictable parts of the innovation whose correlation has the sign that
    supports the fault; none if either sign does."""
    tests = block.onset_tests
    predictable = {
        "p": tests.calm_part,
        "g_c": tests.coarse_part,
    }
    sense = tests.sign[h, slot]
    return [name for name, values in predictable.items() if sense * values[h, slot] > 0.0]


def _states_of(
    quantities: Mapping[str, np.ndarray], states: list[int], known: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Y and P of `LikelihoodRatio` from the quantities of one row. Y has minus the drifts."""
    Y = np.array([quantities["state"][states], np.zeros(len(states)), *quantities["x_Z"][known][:, states]]).T
    Y[len(states) // 2 :] *= -1.0
    P = np.block([[quantities["P_xx"], quantities["P_xd"]], [quantities["P_xd"].T, quantities["P_dd"]]])[
        np.ix_(states, states)
    ]
    return Y, 0.5 * (P + P.T)  # exactly symmetric, as the checker requires


def _affected_axes(before: Quantities, now: Quantities, n: int) -> list[int]:
    """Positions, in a block of n axes, of the axes that the fault moves; both if the axes are correlated."""
    covariances = ("P_xx", "P_xd", "P_dd", "Q_d")
    together = n > 1 and any(part[name][..., 0, 1].any() for part in (before, now) for name in covariances)
    return [i for i in range(n) if together or now["signature"][:, i].any()]
