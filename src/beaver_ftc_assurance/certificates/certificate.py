"""certificate.json: for the alarm and for each exclusion the inequality that the data violated, with every
number it takes. `check_certificate.py` recomputes it from the log, with the columns of `evidence_columns`.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.diagnosis import LOSS, scheme_number
from beaver_ftc.diagnosis import TYPE_ROWS as TYPES
from beaver_ftc.diagnosis.detection import filter_poles
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import LogSink
from beaver_ftc.results import Log, ParquetLog, StoredLog
from beaver_ftc.scenario import Declared, Scenario, to_yaml
from beaver_ftc_assurance.certificates import chance, courses, instruments_say, kinds
from beaver_ftc_assurance.certificates.blocks import Blocks, by_blocks, in_blocks, log_rows_of
from beaver_ftc_assurance.certificates.inequality import (
    Document,
    History,
    Hypothesis,
    Term,
    axis_directions,
    constant_theta_tests,
    declared_errors_of,
    declared_fields,
    inequality_fields,
    is_violated,
    no_fault,
    single_frame_tests,
)
from beaver_ftc_assurance.certificates.tape import (
    MAX_FRAMES_AFTER_ALARM,
    Recorder,
    Tape,
    tape_of_flight_again,
)

Found = tuple[list[Term], Hypothesis] | None
EvidenceColumns = dict[str, "PartialColumn"]  # column of the log -> what stands in it
Columns = dict[str, np.ndarray]
FILE_NAME, FORMAT_VERSION = "certificate.json", 5
MEASURED_MODEL_BOUND = "measured_rad_s", "design_rad_s2", "eta_bar_rad_s2"  # columns of each axis
_LOGGED_COLUMNS = {"watch_missing"} | {f"{axis}_{of}" for axis in AXES for of in MEASURED_MODEL_BOUND}
_EVENT_COLUMN = re.compile("detected|fie_.*_excluded")  # columns of the alarm and of exclusions
_SHARE_SUFFIX = "_likelihood_share"  # of columns: share of the alarm level
TOO_LATE = f"more than {MAX_FRAMES_AFTER_ALARM} frames after the alarm, or with another diagnosis restarted"


def certificate(
    scenario: Scenario, log: Log, recorder: Recorder | None = None, text: str | None = None
) -> tuple[Document, EvidenceColumns]:
    """The certificate of a flight, and the columns that its log needs to prove it.

    recorder: has kept what the log does not hold; without one the flight is flown again. text: of the file
    scenario.yaml beside the log, if it is not the scenario's own.

    Raises BadInput where another scheme diagnosed.
    """
    check_scheme(scenario)
    rows = logged_columns(log)
    if not (events := event_rows(rows)):
        return certificate_document(scenario, rows, events, None, text), {}
    known, n = [events["detected"], *events.values()], len(rows["detected"])
    tape = recorder.tape(known, n) if recorder else tape_of_flight_again(scenario, known, n)
    document = certificate_document(scenario, rows, events, tape, text)
    return document, evidence_columns(scenario, tape, document["statements"])


def logged_columns(log: Log) -> Columns:
    """The columns of a log that certificates take, (rows,)."""
    taken = _LOGGED_COLUMNS.union(
        name for name in log.columns if _EVENT_COLUMN.fullmatch(name) or name.endswith(_SHARE_SUFFIX)
    )
    columns = [name for name in log.columns if name in taken]
    chunks = list(log.read_chunks(columns))
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in columns}


def event_rows(rows: Columns) -> dict[str, int]:
    """Of the alarm and of each exclusion that stands at the end: column of the log, and row."""
    events = filter(_EVENT_COLUMN.fullmatch, rows)
    return {name: k for name in events if (k := _row_set_to_end(rows[name])) is not None}


def certificate_document(
    scenario: Scenario, rows: Columns, events: dict[str, int], tape: Tape | None, text: str | None = None
) -> Document:
    """The certificate of a flight with these events; rows: of `logged_columns`, tape: what was kept of it."""
    declares = hashlib.sha256((to_yaml(scenario) if text is None else text).encode()).hexdigest()
    document: Document = {
        "format": FORMAT_VERSION, "scenario": scenario.name, "scenario_sha256": declares,
        "rows": len(rows["detected"]), "statements": [], "without": [],
    }  # fmt: skip
    if tape is not None:
        history = history_of(scenario, rows, tape)
        for found in statements(scenario, tape, history, events):
            said = _with_logged_numbers(found, rows)
            certain = "sides" in said or "as" in said
            document["statements" if certain else "without"].append(
                said if certain else _uncertified_fields(said)
            )
        if document["statements"]:
            document |= _declared_fields(scenario, history, document["statements"])
    return with_digest(document)


def _with_logged_numbers(said: Document, rows: Columns) -> Document:
    """The statement; one of chance, or of a missing reading, with what the log has of it."""
    if "missing" in said:
        return instruments_say.with_missing_column(said, rows)
    if "likelihood" not in said:
        return said
    return chance.with_logged_share(said, float(rows[said["likelihood"]][said["frame"]]))


def _uncertified_fields(said: Document) -> Document:
    """What is not certified; no number stands there, since nothing could prove it."""
    return {name: said[name] for name in ("what", "column", "because")}


def _declared_fields(scenario: Scenario, history: History, said: list[Document]) -> Document:
    """What all these statements go by."""
    of = [(one, span) for one in said for span in (*one.get("terms", ()), *one.get("bounds", ()))]
    frames, asked = [log_rows_of(one, span) for one, span in of], np.zeros(3, bool)
    for _, span in of:
        asked |= np.array(span["d"]) != 0.0
    if not _is_unexplained(history.with_constant_gyro_errors_on(asked), of):
        asked[:] = True
    about: Document = {"declared": declared_fields(history, frames, asked)}
    if not all("looks" in one or "missing" in one for one in said):
        about["dt_s"] = history.dt
    if frames:
        about |= {"instants": scenario.substeps, "omega_E": history.declared.earth_rad_s}
    return about


def _is_unexplained(history: History, of: list[tuple[Document, Document]]) -> bool:
    """Whether health explains none of the frames of statements, and their terms, that say so."""
    for one, span in of:
        if "shows" in one["theta"] or "bounds" in one:
            seen = by_blocks(history, *one["block"][:2]) if "block" in one else history
            if not kinds.is_unexplained_by_health(seen, np.arange(span["first"], span["frame"] + 1)).all():
                return False
    return True


class OfRun:
    """The certificate of a flight that is about to be flown: `watch` keeps what it needs."""

    def __init__(self, scenario: Scenario) -> None:
        """Raises BadInput for a flight whose alarm is not our scheme's."""
        check_scheme(scenario)
        self._scenario, self._recorder = scenario, Recorder(scenario)
        self.watch = self._recorder.watch

    def write(self, folder: Path) -> None:
        """Write it into the flight's result folder, which has log and scenario."""
        write(self._scenario, self._recorder, folder)


def check_scheme(scenario: Scenario) -> None:
    """Refuse flights whose alarm is not our scheme's."""
    if not scenario.fdi.is_ours:
        says = f"{scenario.fdi.scheme!r} states no bounds that can be recomputed"
        raise BadInput(
            f"{scenario.name}: fdi.scheme: {says}, allowed with a certificate: adaptive-estimators"
        )


def with_digest(document: Document) -> Document:
    """The same with the digest of all that is in it."""
    return document | {"digest": digest(document)}


def digest(document: Document) -> str:
    """SHA-256 of the document in JSON, keys in order, without spaces, its `digest` empty."""
    text = json.dumps(document | {"digest": ""}, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def write(scenario: Scenario, recorder: Recorder, folder: Path) -> None:
    """Write the certificate of a flight into its result folder, which has log and scenario; the log gets the
    columns that prove it."""
    path, text = folder / "log.parquet", (folder / "scenario.yaml").read_text(encoding="utf-8")
    log = StoredLog(path)
    document, columns = certificate(scenario, log, recorder, text)
    if columns:
        extended = folder / ".log.parquet"
        with ParquetLog(extended) as further:
            copy_with_columns(log, columns, further)
        extended.replace(path)
    (folder / FILE_NAME).write_text(as_text(document), encoding="utf-8")


def copy_with_columns(log: Log, columns: EvidenceColumns, to: LogSink) -> None:
    """Copy a log and these columns."""
    to.open([*log.columns, *columns])
    first = 0
    for chunk in log.read_chunks():
        n = len(chunk["t_s"])
        to.write(np.column_stack([*chunk.values(), *(one.rows(first, n) for one in columns.values())]))
        first += n


def evidence_columns(scenario: Scenario, tape: Tape, said: list[Document]) -> EvidenceColumns:
    """The columns of the log by which these statements are checked: for each estimator that they speak of
    offset, slope and spread of its fault's effect and the range of its parameter; for each fault type on a
    surface whether it is excluded, and what the type is where the checker does not define it. The effects are
    known in the frames of the tape only."""
    found: EvidenceColumns = {}
    surfaces, diagnosis = scenario.airframe.surfaces, tape.alarm.diagnosis
    of_types = [one["what"].partition(" ")[0] for one in said if one["what"] and " " in one["what"]]
    wanted = {one["what"] for one in said} | {f"{surface}_position" for surface in of_types}
    for e, name in enumerate(tape.names):
        if name not in wanted:
            continue
        for quantity, unit in (("offset", "_rad_s2"), ("slope", ""), ("spread", "_rad_s2")):
            for axis, values in zip(AXES, getattr(tape, quantity)[:, e].T, strict=True):
                found[f"fie_{name}_{axis}_{quantity}{unit}"] = PartialColumn(tape.first, values)
        estimator = diagnosis.estimators[e]
        for end, theta in (("low", estimator.theta_min), ("high", estimator.theta_max)):
            found[f"fie_{name}_theta_{end}"] = PartialColumn.constant(theta)
    for surface in dict.fromkeys(of_types):
        actuator = diagnosis.surface_fault_types[surfaces.index(surface)].actuator
        for end, stop_rad in (("low", actuator.travel_low_rad), ("high", actuator.travel_high_rad)):
            found[f"{surface}_travel_{end}_rad"] = PartialColumn.constant(stop_rad)
    for s, kind, _ in kinds.excluded_types(tape):
        if surfaces[s] in of_types:
            flags = (tape.types[:, s, kind] > 0).astype(float)
            found[kinds.exclusion_column(surfaces[s], kind)] = PartialColumn(
                tape.first, flags, 0.0, flags[-1]
            )
            definition = kinds.type_definition_columns(tape, surfaces[s], s, kind)
            found |= {column: PartialColumn.constant(value) for column, value in definition.items()}
    return found


@dataclass(frozen=True)
class PartialColumn:
    """A column of which a part is known: `values` from row `first` on, and what stands before and after."""

    first: int
    values: np.ndarray
    before: float = np.nan
    after: float = np.nan

    @classmethod
    def constant(cls, value: float) -> "PartialColumn":
        """The same value in every row."""
        return cls(0, np.empty(0), value, value)

    def rows(self, first: int, n: int) -> np.ndarray:
        """The rows from `first` on, (n,)."""
        places = np.arange(first, first + n) - self.first
        found = np.where(places < 0, self.before, self.after)
        inside = (places >= 0) & (places < len(self.values))
        found[inside] = self.values[places[inside]]
        return found


def as_text(document: Document) -> str:
    """The file's content."""
    return json.dumps(document, separators=(",", ":")) + "\n"


def _row_set_to_end(flags: np.ndarray) -> int | None:
    """The row at which a flag that is set at the end was set, None if it is not."""
    if not flags[-1] > 0.0:
        return None
    clear = np.flatnonzero(~(flags > 0.0))
    return int(clear[-1]) + 1 if len(clear) else 0


def history_of(scenario: Scenario, rows: Columns, tape: Tape) -> History:
    """What the log says of rates, model and bound, and what was declared."""
    x, model, eta_bar = (
        np.column_stack([rows[f"{axis}_{of}"] for axis in AXES]) for of in MEASURED_MODEL_BOUND
    )
    return History(
        1.0 / scenario.rate_hz, 1.0 / scenario.substeps, x, model, eta_bar, declared_errors_of(tape.alarm)
    )


def statements(
    scenario: Scenario, tape: Tape, history: History, events: dict[str, int]
) -> Iterator[Document]:
    """What can be said of each event; one without a `value` says why it cannot be certified."""
    alarm, diagnosis = events["detected"], tape.alarm.diagnosis
    about: Document = {"what": None, "column": "detected", "frame": alarm}
    monitor, ours = diagnosis.sensor_monitor, scheme_number("adaptive-estimators")
    watch = instruments_say.instrument_alarm_statement(monitor) if monitor.has_raised_alarm else None
    if not diagnosis.estimators or not diagnosis.enabled or diagnosis.scheme_number != ours:
        yield about | (watch or {"because": "another scheme was in charge"})
        return
    said = _statement(
        _alarm_inequality(scenario, tape, history, alarm), history, chance.ALARM_NOT_STATED, **about
    )
    if "because" in said and watch is not None:
        said = about | watch
    elif "because" in said and scenario.fdi.statistical:
        by_chance = chance.alarm_statement(tape, history, scenario.airframe.surfaces, alarm)
        said = said if by_chance is None else about | by_chance
    yield said
    for e, name in enumerate(tape.names):
        column = f"fie_{name}_excluded"
        if column in events:
            k = events[column]
            because = chance.EXCLUSION_NOT_STATED if events[column] < tape.end else TOO_LATE
            known = because != TOO_LATE and k > 0  # the first row has no innovation
            found = _exclusion_inequality(scenario, tape, history, e, alarm, k) if known else None
            about = {"what": name, "column": column, "frame": k}
            if found is None and because != TOO_LATE and chance.alarm_excludes(tape, e, said):
                yield about | {"as": "alarm"}
                continue
            yield _statement(found, history, because, **about)
    if scenario.fdi.fault_class == "all":
        yield from _type_statements(scenario, tape, history, max(alarm, 1))  # the first row has no innovation


def _type_statements(scenario: Scenario, tape: Tape, history: History, alarm: int) -> Iterator[Document]:
    """Of each type excluded, surface by surface; the log has a column for it only with a certificate."""
    frames = tape, history
    if tape.alarm.diagnosis.types_config.frames_per_block > 1:
        tape, history, alarm = in_blocks(tape, history, alarm)
    any_block = len(tape.types) > 0
    for s, kind, k in kinds.excluded_types(tape if any_block else frames[0]):
        because = kinds.reason_not_certified(tape, kind) if any_block else kinds.EXCLUDED_BY_MANY_FRAMES
        surface = scenario.airframe.surfaces[s]
        about: Document = {
            "what": kinds.exclusion_name(surface, kind), "column": kinds.exclusion_column(surface, kind),
            "frame": kinds.exclusion_row(frames[0], s, kind),
        }  # fmt: skip
        followed = bool(TYPES[kind].frames_test)
        if because is None and not followed and TYPES[kind].deflection_relation is None:
            because = kinds.UNKNOWN_TYPE
        if because is not None:
            yield about | {"because": because}
            continue
        of = kinds.hypothesis_held_anywhere(tape, s) if followed else kinds.hypothesis_of_type(tape, s, kind)
        if followed:
            said = courses.statement_by_course(scenario, tape, history, of, s, kind, alarm)
            yield about | (
                history.statement_fields | said if said else {"because": kinds.EXCLUDED_BY_MANY_FRAMES}
            )
        elif isinstance(history, Blocks) and not of.theta_is_constant:
            own = kinds.hypothesis_of_type(frames[0], s, kind)
            of_tape, of_log = frames
            sums = history.summed_frame_tests(k, own.axes, of_tape.first)
            found = _first_violated(sums, own, of_log, of_tape)
            yield _statement(found, of_log, kinds.EXCLUDED_BY_MANY_FRAMES, **about)
        else:
            found = _first_violated(kinds.candidate_inequalities(of, history, alarm, k), of, history, tape)
            yield _statement(found, history, kinds.EXCLUDED_BY_MANY_FRAMES, **about)


def _statement(found: Found, history: History, because: str, **about: Any) -> Document:
    """A statement, or why there is none."""
    if found is None:
        return about | {"because": because}
    return about | history.statement_fields | inequality_fields(*found, history)


def _detection_poles(scenario: Scenario) -> list[float]:
    """Poles of the detection filters, 1/s (docs/explanation/detection.md, "A bank of poles")."""
    return list(filter_poles(scenario.fdi, Declared.of(scenario)))


def _alarm_inequality(scenario: Scenario, tape: Tape, history: History, k: int) -> Found:
    """A filter that left its bound at frame k."""
    if k <= tape.since:
        return None
    health = no_fault(tape.first, tape.end - tape.first)
    of_frame = ([Term(d, inf, k - 1, k)] for d in axis_directions((0, 1, 2)))
    filters = ((pole, d) for pole in _detection_poles(scenario) for d in axis_directions((0, 1, 2)))
    filtered = ([Term(d, pole, tape.since, k)] for pole, d in filters)
    return _first_violated(chain(of_frame, filtered), health, history, tape)


def _first_violated(candidates: Iterable[list[Term]], of: Hypothesis, history: History, tape: Tape) -> Found:
    """The first inequality that the data violate."""
    for terms in filter(None, candidates):
        known = [replace(term, first_kept_frame=tape.first) for term in terms]
        if is_violated(known, of, history):
            return known, of
    return None


def _exclusion_inequality(
    scenario: Scenario, tape: Tape, history: History, e: int, alarm: int, k: int
) -> Found:
    """The test that the fault of estimator e failed at frame k."""
    estimator, config = tape.alarm.diagnosis.estimators[e], scenario.fdi
    asked = estimator.active_axes
    of = Hypothesis(
        tape.first, tape.offset[:, e], tape.slope[:, e], tape.spread[:, e], estimator.theta_min,
        estimator.theta_max,
        axes=asked,
    )  # fmt: skip
    since_alarm = (
        [Term(d, config.isolation_pole_per_s, alarm, k)] for d in axis_directions(asked) if k > alarm
    )
    filtered = _filter_tests(scenario, tape, e, estimator.parity_direction, asked, k)
    found = _first_violated(chain(single_frame_tests(k, of), filtered, since_alarm), of, history, tape)
    if found is not None:
        return found
    lasting = replace(of, theta_is_constant=True)
    candidates: list[list[Term]] = []
    if estimator.hypothesis_kind == LOSS and config.fault_profile == "abrupt":
        candidates.append(constant_theta_tests(lasting, history, np.arange(alarm, k + 1)))
    elif config.thresholds == "published" and k > alarm:
        candidates += [[Term(d, config.isolation_pole_per_s, alarm, k)] for d in axis_directions(asked)]
    return _first_violated(candidates, lasting, history, tape)


def _filter_tests(
    scenario: Scenario, tape: Tape, e: int, across: np.ndarray, asked: tuple[int, ...], k: int
) -> Iterator[list[Term]]:
    """The detection filters, and the memory of what the fault can have done to them."""
    for m, pole in enumerate(_detection_poles(scenario)):
        for i in asked:
            for sign, reach in ((1.0, tape.reach_high), (-1.0, -tape.reach_low)):
                d = np.zeros(3)
                d[i] = sign
                yield [Term(d, pole, tape.since, k, effect_before=float(reach[e, m, i]))]
        if across.any() and len(asked) == 3:
            for sign, reach in ((1.0, tape.reach_high), (-1.0, -tape.reach_low)):
                yield [Term(sign * across, pole, tape.since, k, effect_before=float(reach[e, m, 3]))]
