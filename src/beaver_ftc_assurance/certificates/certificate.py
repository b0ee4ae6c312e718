"""certificate.json: for the alarm and for each exclusion a *statement*, i.e. the inequality that the data
violated, with every number it needs. `check_certificate.py` recomputes it from the log, with the columns of
`evidence_columns`.

An *event* is the alarm or an exclusion that is in force at the end of the flight. Its row is that in which it
was set.
"""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.diagnosis import LOSS, scheme_number
from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis.detection import filter_poles
from beaver_ftc.documents import BadInput
from beaver_ftc.results import Log, StoredLog
from beaver_ftc.scenario import Declared, Scenario, to_yaml
from beaver_ftc_assurance.certificates import chance, courses, instruments_say, kinds, search
from beaver_ftc_assurance.certificates.certified import LOG_NAME, Certified, with_digest
from beaver_ftc_assurance.certificates.check_certificate import FORMAT_VERSION
from beaver_ftc_assurance.certificates.evidence_columns import evidence_columns
from beaver_ftc_assurance.certificates.history import (
    Document,
    History,
    declared_errors_of,
    in_blocks,
    log_rows_of,
)
from beaver_ftc_assurance.certificates.inequality import (
    ANY,
    CONSTANT,
    Hypothesis,
    first_violated,
    no_fault,
)
from beaver_ftc_assurance.certificates.tape import Recorder, Tape, tape_of_flight_again

Columns = dict[str, np.ndarray]
# Ends of the names of columns by axis.
MEASURED_MODEL_BOUND = "measured_rad_s", "design_rad_s2", "eta_bar_rad_s2"
_LOGGED_COLUMNS = {"watch_missing"} | {f"{axis}_{end}" for axis in AXES for end in MEASURED_MODEL_BOUND}
_EVENT_COLUMN = re.compile("detected|fie_.*_excluded")  # columns of the alarm and of exclusions
_SHARE_SUFFIX = "_likelihood_share"  # end of the name of a column with a share of the alarm level


def certificate(
    scenario: Scenario, log: Log, recorder: Recorder | None = None, text: str | None = None
) -> Certified:
    """The certificate of a flight.

    recorder: has the quantities that the log lacks; without it, the scenario is flown again. text: content of
    the file scenario.yaml beside the log, if it differs from `to_yaml(scenario)`.

    Raises BadInput if the scheme of the scenario is not ours.
    """
    check_scheme(scenario)
    rows = logged_columns(log)
    n = len(rows["detected"])
    scenario_text = to_yaml(scenario) if text is None else text
    document: Document = {
        "format": FORMAT_VERSION, "scenario": scenario.name,
        "scenario_sha256": hashlib.sha256(scenario_text.encode()).hexdigest(),
        "rows": n, "statements": [], "without": [],
    }  # fmt: skip
    if not (events := event_rows(rows)):
        return Certified(with_digest(document), log, {}, scenario_text)
    frames_of_events = [*events.values()]
    tape = (
        recorder.tape(frames_of_events, n)
        if recorder
        else tape_of_flight_again(scenario, frames_of_events, n)
    )
    flight = _Flight(scenario, rows, history_of(scenario, rows, tape))
    for statement in flight.statements(events):
        if "because" in statement:  # not certified: without a row, since nothing can prove it
            statement.pop("frame", None)
        document["without" if "because" in statement else "statements"].append(statement)
    if document["statements"]:
        document |= flight.declared_fields(document["statements"])
    columns = evidence_columns(tape, scenario.airframe.surfaces, document["statements"])
    return Certified(with_digest(document), log, columns, scenario_text)


def logged_columns(log: Log) -> Columns:
    """The columns of a log that a certificate needs, each (rows,)."""
    return log.read([
        name for name in log.columns
        if name in _LOGGED_COLUMNS or _EVENT_COLUMN.fullmatch(name) or name.endswith(_SHARE_SUFFIX)
    ])  # fmt: skip


def event_rows(rows: Columns) -> dict[str, int]:
    """Column of the log -> row of the event, for the alarm and each exclusion that are in force at the
    end."""
    return {
        name: row_set_to_end(flags) for name, flags in rows.items()
        if _EVENT_COLUMN.fullmatch(name) and flags[-1] > 0.0
    }  # fmt: skip


def row_set_to_end(flags: np.ndarray) -> int:
    """The row at which a flag that is set at the end was set."""
    clear = np.flatnonzero(~(flags > 0.0))
    return int(clear[-1]) + 1 if len(clear) else 0


def check_scheme(scenario: Scenario) -> None:
    """Raise BadInput if the scheme of the scenario is not ours."""
    if not scenario.fdi.is_ours:
        says = f"{scenario.fdi.scheme!r} states no bounds that can be recomputed"
        raise BadInput(
            f"{scenario.name}: fdi.scheme: {says}, allowed with a certificate: adaptive-estimators"
        )


class OfRun:
    """The certificate of a flight before it is flown. The flight calls `watch`, which records the quantities
    that the log lacks."""

    def __init__(self, scenario: Scenario) -> None:
        """Raises BadInput if the scheme of the scenario is not ours."""
        check_scheme(scenario)
        self._scenario = scenario
        self._recorder = Recorder(scenario)
        self.watch = self._recorder.watch

    def write(self, folder: Path) -> None:
        """Write the certificate into the flight's result folder, which has log and scenario, and add the
        columns that prove it to the log."""
        text = (folder / "scenario.yaml").read_text(encoding="utf-8")
        certificate(self._scenario, StoredLog(folder / LOG_NAME), self._recorder, text).write(folder)


def history_of(scenario: Scenario, rows: Columns, tape: Tape) -> History:
    """Rates, model and bound from the log, and the declared errors from the tape."""
    x, F, eta_bar = (
        np.column_stack([rows[f"{axis}_{end}"] for axis in AXES]) for end in MEASURED_MODEL_BOUND
    )
    return History(
        1.0 / scenario.rate_hz, scenario.substeps, x, F, eta_bar, declared_errors_of(tape.alarm), tape,
        row_set_to_end(rows["detected"]),
    )  # fmt: skip


@dataclass(frozen=True)
class _Flight:
    """A flight with events: columns of its log, and its history. Letters: e number of an isolation estimator,
    s of a surface, k of a frame."""

    scenario: Scenario
    rows: Columns
    history: History

    @property
    def tape(self) -> Tape:
        """The recorded quantities."""
        return self.history.tape

    def statements(self, events: dict[str, int]) -> Iterator[Document]:
        """A statement for each event and, with the fault class `all`, for each excluded type; for the alarm
        alone, if another scheme than ours was in charge at the alarm. If an event cannot be certified, its
        statement has no sides, and the reason in `because`."""
        alarm = events["detected"]
        diagnosis = self.tape.alarm.diagnosis
        tape = self.tape
        alarm_fields: Document = {"what": None, "column": "detected", "frame": alarm}
        ours = scheme_number("adaptive-estimators")
        is_ours = diagnosis.estimators and diagnosis.enabled and diagnosis.scheme_number == ours
        of_alarm = alarm_fields | self._alarm(alarm, bool(is_ours))
        yield of_alarm
        if not is_ours:
            return
        for e, name in enumerate(tape.names):
            column = f"fie_{name}_excluded"
            if column not in events:
                continue
            k = events[column]
            evidence: Document = {"because": kinds.TOO_LATE}
            if k < tape.end:
                evidence = self._exclusion(e, k) or chance.exclusion_by_alarm(tape, e, of_alarm)
            yield {"what": name, "column": column, "frame": k} | evidence
        if self.scenario.fdi.fault_class == "all":
            yield from self._types()

    def _alarm(self, k: int, is_ours: bool) -> Document:
        """Evidence of the alarm at row k. is_ours: whether our scheme was in charge. The first source that
        has evidence:

            a detection filter beyond its bound, if is_ours
            the sensor monitor, if it raised the alarm; it may have a reason instead
            the statistical detector, if is_ours and the scenario declares this detector

        If none has, the reason.
        """
        monitor = self.tape.alarm.diagnosis.sensor_monitor
        evidence = self._filter_alarm(k) if is_ours else None
        if evidence is not None:
            return evidence
        if monitor.has_raised_alarm:
            return instruments_say.alarm_evidence(monitor, self.rows, k)
        if not is_ours:
            return {"because": "another scheme was in charge"}
        by_chance = self.scenario.fdi.statistical and chance.alarm_evidence(
            self.history, self.scenario.airframe.surfaces, self.rows, k
        )
        return by_chance or {"because": chance.ALARM_NOT_STATED}

    def _filter_alarm(self, k: int) -> Document | None:
        """Evidence that the innovation of frame k, or a detection filter at frame k, exceeds its bound; None
        if none does, or if the diagnosis had not begun before frame k."""
        if k <= self.tape.since:
            return None
        tests = search.of_alarm(self.history, self._detection_poles, k)
        return first_violated(tests, no_fault(self.history))

    @property
    def _detection_poles(self) -> list[float]:
        """Poles of the detection filters, 1/s (docs/explanation/detection.md, "A bank of poles")."""
        return list(filter_poles(self.scenario.fdi, Declared.of(self.scenario)))

    def _exclusion(self, e: int, k: int) -> Document | None:
        """Evidence against the fault of estimator e at frame k, the first of these inequalities that is
        violated; None if none is:

            theta may change in each frame   of frame k, the detection filters, the isolation filter
            theta is constant                of two frames, for a loss and `fault_profile: abrupt`;
                                             otherwise of the isolation filter, for `thresholds: published`

        The isolation filter starts at the alarm, and the two frames are not before it.
        """
        tape = self.tape
        alarm = self.history.alarm
        config = self.scenario.fdi
        estimator = tape.alarm.diagnosis.estimators[e]
        if k == 0:  # the first row has no innovation
            return None
        varying = Hypothesis(
            self.history, tape.offset[:, e], tape.slope[:, e], tape.spread[:, e], estimator.theta_min,
            estimator.theta_max, axes=estimator.active_axes,
        )  # fmt: skip
        constant = replace(varying, theta=CONSTANT)
        since_alarm = (
            [*search.filters(config.isolation_pole_per_s, alarm, k, varying.axes)] if k > alarm else []
        )
        by_filters = search.of_detection_filters(
            varying, self._detection_poles, e, estimator.parity_direction, k
        )
        evidence = first_violated(chain(search.of_one_frame(varying, k), by_filters, since_alarm), varying)
        if evidence is None and estimator.hypothesis_kind == LOSS and config.fault_profile == "abrupt":
            evidence = first_violated([search.of_constant_theta(constant, np.arange(alarm, k + 1))], constant)
        elif evidence is None and config.thresholds == "published":
            evidence = first_violated(since_alarm, constant)
        return evidence

    def _types(self) -> Iterator[Document]:
        """A statement for each type that is excluded at the end of the flight, surface by surface. Its column
        is one of `evidence_columns`; a type that was excluded after the tape has none. If types are tested by
        blocks of frames, the history is that by blocks; without a complete block, no type is certified."""
        # the first row has no innovation
        history = in_blocks(replace(self.history, alarm=max(self.history.alarm, 1)))
        any_block = len(history.tape.types) > 0
        with_flags = history.tape if any_block else self.tape
        for s, kind, k in kinds.excluded_types(with_flags):
            surface = self.scenario.airframe.surfaces[s]
            if k == with_flags.end:
                yield {"what": kinds.exclusion_name(surface, kind), "because": kinds.TYPE_TOO_LATE}
                continue
            row = self.tape.first + row_set_to_end(self.tape.types[:, s, kind])
            evidence = None
            reason = kinds.reason_not_certified(history.tape, kind) if any_block else None
            if any_block and reason is None:
                evidence = self._type(history, s, kind, k)
            yield {
                "what": kinds.exclusion_name(surface, kind),
                "column": kinds.exclusion_column(surface, kind), "frame": row,
            } | (evidence or {"because": reason or kinds.EXCLUDED_BY_MANY_FRAMES})  # fmt: skip

    def _type(self, history: History, s: int, kind: int, k: int) -> Document | None:
        """Evidence against a type on surface s at frame k; None if there is none. history, k: by frames or,
        if types are tested by blocks, by blocks."""
        if TYPES[kind].frames_test:
            return courses.evidence(self.scenario, history, s, kind)
        hypothesis = kinds.hypothesis_of_type(history, s, kind)
        if history.length == 1 or hypothesis.theta != ANY:
            return first_violated(search.of_type(hypothesis, k), hypothesis)
        by_frames = kinds.hypothesis_of_type(self.history, s, kind)
        return first_violated(search.of_block(by_frames, history, k), by_frames)

    def declared_fields(self, statements: list[Document]) -> Document:
        """The fields of the certificate that all statements share: declared errors, times, Earth's rate. The
        constant part of a gyro's error is stated only on axes that a statement uses, if with it health
        explains no frame that must be unexplained; otherwise on all axes.

        spans: each term or bound of a statement, with the statement. on_axes (3,): whether a span uses the
        axis.
        """
        spans = [
            (statement, span)
            for statement in statements
            for span in (*statement.get("terms", ()), *statement.get("bounds", ()))
        ]
        on_axes = (
            np.any([np.array(span["d"]) != 0.0 for _, span in spans], axis=0) if spans else np.zeros(3, bool)
        )
        history = self.history.with_constant_gyro_errors_on(on_axes)
        if not all(_is_unexplained(history, statement, span) for statement, span in spans):
            history = self.history
        rows = np.concatenate([log_rows_of(statement, span) for statement, span in spans]) if spans else None
        fields: Document = {"declared": history.declared_fields(rows)}
        if not all("looks" in statement or "missing" in statement for statement in statements):
            fields["dt_s"] = self.history.dt
        if spans:
            fields |= {"instants": self.scenario.substeps, "omega_E": self.history.declared.omega_E}
        return fields


def _is_unexplained(history: History, statement: Document, span: Document) -> bool:
    """Whether health explains none of the frames of a span, i.e. a term or bound of a statement; true if the
    statement does not require it. history: by frames; the statement's block makes it one by blocks."""
    if "shows" not in statement["theta"] and "bounds" not in statement:
        return True
    length, begin, _ = statement.get("block", (1, 0, 0))
    blocks = replace(history, length=length, begin=begin)
    return bool(blocks.is_unexplained(np.arange(span["first"], span["frame"] + 1)).all())
