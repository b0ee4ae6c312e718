"""Evidence of an alarm by the statistical detector: the likelihood ratio of a fault from its onset to the
alarm, read from the recorded frames. likelihood_ratio.py evaluates and shortens it.

docs/explanation/statistical.md derives it. The log lacks its inputs (signature, regressors of declared
constants, variances); the recorder keeps them frame by frame (tape.py).
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
from beaver_ftc_assurance.certificates.likelihood_ratio import LikelihoodRatio
from beaver_ftc_assurance.certificates.tape import Tape

LOGGED_SCORE_TOLERANCE = 1e-5  # relative; more than all that a certificate leaves out changes the score by
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
    for block in diagnosis.statistical_filters:
        for hypothesis in block.hypotheses:
            if hypothesis.may_raise_alarm:
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


def _likelihood_ratio(
    tape: Tape, history: History, test: tuple[int, int, int], rows: range
) -> LikelihoodRatio:
    """The ratio of a test (numbers of its block, hypothesis and onset's slot) from its first row to its last.

    recorded: quantities of the block at the end of the row before the first, then of each row. The states are
    those of the row before the first. The detector prepares noise, decay, bound and rate of change of the
    drift at the end of the row before (`previous`); it fills inputs and responses in the row itself
    (`current`). moved: the places in the block of the axes that the fault moves.
    """
    b, h, slot = test
    dt = history.dt
    diagnosis = tape.alarm.diagnosis
    block = diagnosis.statistical_filters[b]
    span = slice(rows[0] - 1 - tape.first, rows[-1] + 1 - tape.first)
    recorded = {name: tape.filters[name][span, b] for name in (*RECORDED_BLOCK_FIELDS, "signature")}
    previous, current = (
        {name: values[part] for name, values in recorded.items()} for part in (np.s_[:-1], np.s_[1:])
    )
    moved = _affected_axes(recorded, current["signature"][:, h], len(block.axis_indices))
    n = len(moved)
    states = [*moved, *(2 + i for i in moved)]
    axes = [block.axis_indices[i] for i in moved]
    known = [j for j in np.flatnonzero(block.regressor_coefficient_error_bound > 0.0).tolist()
             if current["g_Z"][:, j][:, moved].any()]  # fmt: skip
    drift = dt * previous["Q_d"][:, moved][:, :, moved]
    # The detector adds Q_d after the decay of the drift, `add_whitened_frames` before it: a frame later.
    drift[1:] = drift[:-1]
    drift[0] = 0.0
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
        leap = tape.filters["leap"][span][1:][:, axes][:, :, axes]
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
