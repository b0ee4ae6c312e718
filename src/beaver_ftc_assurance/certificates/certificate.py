"""certificate.json: for the alarm and for each exclusion the inequality that the data violated, with every
number it takes. `check_certificate.py` recomputes it from the log, which has the columns of `evidence`.
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
from beaver_ftc.diagnosis.detection import poles_of
from beaver_ftc.diagnosis.types import TYPE_WORDS as WORDS
from beaver_ftc.documents import BadInput
from beaver_ftc.loop import LogSink
from beaver_ftc.results import Log, ParquetLog, StoredLog
from beaver_ftc.scenario import Declared, Scenario, to_yaml
from beaver_ftc_assurance.certificates import chance, courses, instruments_say, kinds
from beaver_ftc_assurance.certificates.blocks import Blocks, by_blocks, in_blocks, rows_of
from beaver_ftc_assurance.certificates.inequality import (
    Document,
    History,
    Hypothesis,
    Term,
    constant_pair,
    declaration,
    declared_of,
    directions,
    is_violated,
    nothing,
    of_one_frame,
    written,
)
from beaver_ftc_assurance.certificates.tape import MOST_AFTER, Recorder, Tape, recorded

Found = tuple[list[Term], Hypothesis] | None
Evidence = dict[str, "Part"]  # column of the log -> what stands in it
Columns = dict[str, np.ndarray]
FILE, FORMAT = "certificate.json", 5
MEASURED_MODEL_BOUND = "measured_rad_s", "design_rad_s2", "eta_bar_rad_s2"  # columns of each axis
_OF_LOG = {"watch_missing"} | {f"{axis}_{of}" for axis in AXES for of in MEASURED_MODEL_BOUND}
_EVENT, _SHARE = re.compile("detected|fie_.*_excluded"), "_likelihood_share"  # columns of events, of shares
LATE = f"more than {MOST_AFTER} frames after the alarm, or with another diagnosis restarted"


def certificate(
    scenario: Scenario, log: Log, recorder: Recorder | None = None, text: str | None = None
) -> tuple[Document, Evidence]:
    """The certificate of a flight, and the columns that its log needs to prove it.

    recorder: has kept what the log does not hold; without one the flight is flown again. text: of the file
    scenario.yaml beside the log, if it is not the scenario's own.

    Raises BadInput where another scheme diagnosed.
    """
    check_scheme(scenario)
    rows = logged(log)
    if not (events := events_of(rows)):
        return certificate_of(scenario, rows, events, None, text), {}
    known, n = [events["detected"], *events.values()], len(rows["detected"])
    tape = recorder.tape(known, n) if recorder else recorded(scenario, known, n)
    document = certificate_of(scenario, rows, events, tape, text)
    return document, evidence(scenario, tape, document["statements"])


def logged(log: Log) -> Columns:
    """The columns of a log that certificates take, (rows,)."""
    taken = _OF_LOG.union(name for name in log.columns if _EVENT.fullmatch(name) or name.endswith(_SHARE))
    columns = [name for name in log.columns if name in taken]
    chunks = list(log.read_chunks(columns))
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in columns}


def events_of(rows: Columns) -> dict[str, int]:
    """Of the alarm and of each exclusion that stands at the end: column of the log, and row."""
    events = filter(_EVENT.fullmatch, rows)
    return {name: k for name in events if (k := _rise(rows[name])) is not None}


def certificate_of(
    scenario: Scenario, rows: Columns, events: dict[str, int], tape: Tape | None, text: str | None = None
) -> Document:
    """The certificate of a flight with these events; rows: as of `logged`, tape: what was kept of it."""
    declares = hashlib.sha256((to_yaml(scenario) if text is None else text).encode()).hexdigest()
    document: Document = {
        "format": FORMAT, "scenario": scenario.name, "scenario_sha256": declares,
        "rows": len(rows["detected"]), "statements": [], "without": [],
    }  # fmt: skip
    if tape is not None:
        history = history_of(scenario, rows, tape)
        for found in statements(scenario, tape, history, events):
            said = _beside_the_log(found, rows)
            certain = "sides" in said or "as" in said
            document["statements" if certain else "without"].append(said if certain else _without(said))
        if document["statements"]:
            document |= _declared(scenario, history, document["statements"])
    return sealed(document)


def _beside_the_log(said: Document, rows: Columns) -> Document:
    """The statement; one of chance, or of a missing reading, with what the log has of it."""
    if "missing" in said:
        return instruments_say.as_logged(said, rows)
    if "likelihood" not in said:
        return said
    return chance.with_share(said, float(rows[said["likelihood"]][said["frame"]]))


def _without(said: Document) -> Document:
    """What is not certified; no number stands there, since nothing could prove it."""
    return {name: said[name] for name in ("what", "column", "because")}


def _declared(scenario: Scenario, history: History, said: list[Document]) -> Document:
    """What all these statements go by."""
    of = [(one, span) for one in said for span in (*one.get("terms", ()), *one.get("bounds", ()))]
    frames, asked = [rows_of(one, span) for one, span in of], np.zeros(3, bool)
    for _, span in of:
        asked |= np.array(span["d"]) != 0.0
    if not _shows(history.asking(asked), of):
        asked[:] = True
    about: Document = {"declared": declaration(history, frames, asked)}
    if not all("looks" in one or "missing" in one for one in said):
        about["dt_s"] = history.dt
    if frames:
        about |= {"instants": scenario.substeps, "omega_E": history.declared.earth_rad_s}
    return about


def _shows(history: History, of: list[tuple[Document, Document]]) -> bool:
    """Whether health explains none of the frames of statements, and their terms, that say so."""
    for one, span in of:
        if "shows" in one["theta"] or "bounds" in one:
            seen = by_blocks(history, *one["block"][:2]) if "block" in one else history
            if not kinds.wrong(seen, np.arange(span["first"], span["frame"] + 1)).all():
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


def sealed(document: Document) -> Document:
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
            copy_with(log, columns, further)
        extended.replace(path)
    (folder / FILE).write_text(as_text(document), encoding="utf-8")


def copy_with(log: Log, columns: Evidence, to: LogSink) -> None:
    """Copy a log and these columns."""
    to.open([*log.columns, *columns])
    first = 0
    for chunk in log.read_chunks():
        n = len(chunk["t_s"])
        to.write(np.column_stack([*chunk.values(), *(one.rows(first, n) for one in columns.values())]))
        first += n


def evidence(scenario: Scenario, tape: Tape, said: list[Document]) -> Evidence:
    """The columns of the log by which these statements are checked: for each estimator that they speak of
    offset, slope and spread of its fault's effect and the range of its parameter; for each fault type on a
    surface whether it is excluded. The effects are known in the frames of the tape only."""
    found: Evidence = {}
    surfaces, diagnosis = scenario.airframe.surfaces, tape.alarm.diagnosis
    of_types = [one["what"].partition(" ")[0] for one in said if one["what"] and " " in one["what"]]
    wanted = {one["what"] for one in said} | {f"{surface}_position" for surface in of_types}
    for e, name in enumerate(tape.names):
        if name not in wanted:
            continue
        for quantity, unit in (("offset", "_rad_s2"), ("slope", ""), ("spread", "_rad_s2")):
            for axis, values in zip(AXES, getattr(tape, quantity)[:, e].T, strict=True):
                found[f"fie_{name}_{axis}_{quantity}{unit}"] = Part(tape.first, values)
        estimator = diagnosis.estimators[e]
        for end, theta in (("low", estimator.low), ("high", estimator.high)):
            found[f"fie_{name}_theta_{end}"] = Part.constant(theta)
    for surface in dict.fromkeys(of_types):
        actuator = diagnosis.surfaces[surfaces.index(surface)].actuator
        for end, stop_rad in (("low", actuator.travel_low_rad), ("high", actuator.travel_high_rad)):
            found[f"{surface}_travel_{end}_rad"] = Part.constant(stop_rad)
    for s, kind, _ in kinds.excluded_types(tape):
        if surfaces[s] in of_types:
            flags = (tape.types[:, s, kind] > 0).astype(float)
            found[kinds.column_of(surfaces[s], kind)] = Part(tape.first, flags, 0.0, flags[-1])
    return found


@dataclass(frozen=True)
class Part:
    """A column of which a part is known: `values` from row `first` on, and what stands before and after."""

    first: int
    values: np.ndarray
    before: float = np.nan
    after: float = np.nan

    @classmethod
    def constant(cls, value: float) -> "Part":
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


def _rise(flags: np.ndarray) -> int | None:
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
        1.0 / scenario.rate_hz, 1.0 / scenario.substeps, x, model, eta_bar, declared_of(tape.alarm)
    )


def statements(
    scenario: Scenario, tape: Tape, history: History, events: dict[str, int]
) -> Iterator[Document]:
    """What can be said of each event; one without a `value` says why it cannot be certified."""
    alarm, diagnosis = events["detected"], tape.alarm.diagnosis
    about: Document = {"what": None, "column": "detected", "frame": alarm}
    monitor, ours = diagnosis.sensor_monitor, scheme_number("adaptive-estimators")
    watch = instruments_say.of_alarm(monitor) if monitor.alarmed else None
    if not diagnosis.estimators or not diagnosis.enabled or diagnosis.scheme != ours:
        yield about | (watch or {"because": "another scheme was in charge"})
        return
    said = _stated(_of_alarm(scenario, tape, history, alarm), history, chance.NOT_STATED, **about)
    if "because" in said and watch is not None:
        said = about | watch
    elif "because" in said and scenario.fdi.statistical:
        by_chance = chance.of_alarm(tape, history, scenario.airframe.surfaces, alarm)
        said = said if by_chance is None else about | by_chance
    yield said
    for e, name in enumerate(tape.names):
        column = f"fie_{name}_excluded"
        if column in events:
            k, because = events[column], chance.NOT_EXCLUDED if events[column] < tape.end else LATE
            known = because != LATE and k > 0  # the first row has no innovation
            found = _of_exclusion(scenario, tape, history, e, alarm, k) if known else None
            about = {"what": name, "column": column, "frame": k}
            if found is None and because != LATE and chance.says_nothing_of(tape, e, said):
                yield about | {"as": "alarm"}
                continue
            yield _stated(found, history, because, **about)
    if scenario.fdi.fault_class == "all":
        yield from _of_types(scenario, tape, history, max(alarm, 1))  # the first row has no innovation


def _of_types(scenario: Scenario, tape: Tape, history: History, alarm: int) -> Iterator[Document]:
    """Of each type excluded, surface by surface; the log has a column for it only with a certificate."""
    frames = tape, history
    if tape.alarm.diagnosis.types_config.block_frames > 1:
        tape, history, alarm = in_blocks(tape, history, alarm)
    any_block = len(tape.types) > 0
    for s, kind, k in kinds.excluded_types(tape if any_block else frames[0]):
        because = kinds.why_not(tape, kind) if any_block else kinds.COURSE
        surface = scenario.airframe.surfaces[s]
        about: Document = {
            "what": kinds.name_of(surface, kind), "column": kinds.column_of(surface, kind),
            "frame": kinds.row_of(frames[0], s, kind),
        }  # fmt: skip
        followed = WORDS[kind] in courses.RULES
        if because is None and not followed and kind not in kinds.BY_FRAMES:
            because = kinds.UNKNOWN
        if because is not None:
            yield about | {"because": because}
            continue
        # by its course: of where the surface was, as if it were held there
        of = kinds.hypothesis(tape, s, kinds.STUCK if followed else kind)
        if followed:
            said = courses.excludes(scenario, tape, history, of, s, kind, alarm)
            yield about | (history.said | said if said else {"because": kinds.COURSE})
        elif isinstance(history, Blocks) and not of.constant:
            own = kinds.hypothesis(frames[0], s, kind)
            found = _first_violated(history.added_up(k, own.asked), own, frames[1], tape)
            yield _stated(found, frames[1], kinds.COURSE, **about)
        else:
            found = _first_violated(kinds.candidates(of, history, alarm, k), of, history, tape)
            yield _stated(found, history, kinds.COURSE, **about)


def _stated(found: Found, history: History, because: str, **about: Any) -> Document:
    """A statement, or why there is none."""
    if found is None:
        return about | {"because": because}
    return about | history.said | written(*found, history)


def _poles(scenario: Scenario) -> list[float]:
    """Of the detection filters (theory, section 3)."""
    return list(poles_of(scenario.fdi, Declared.of(scenario)))


def _of_alarm(scenario: Scenario, tape: Tape, history: History, k: int) -> Found:
    """A filter that left its bound at frame k."""
    if k <= tape.since:
        return None
    health = nothing(tape.first, tape.end - tape.first)
    of_frame = ([Term(d, inf, k - 1, k)] for d in directions((0, 1, 2)))
    filters = ((pole, d) for pole in _poles(scenario) for d in directions((0, 1, 2)))
    filtered = ([Term(d, pole, tape.since, k)] for pole, d in filters)
    return _first_violated(chain(of_frame, filtered), health, history, tape)


def _first_violated(candidates: Iterable[list[Term]], of: Hypothesis, history: History, tape: Tape) -> Found:
    """The first inequality that the data violate."""
    for terms in filter(None, candidates):
        known = [replace(term, known_from=tape.first) for term in terms]
        if is_violated(known, of, history):
            return known, of
    return None


def _of_exclusion(scenario: Scenario, tape: Tape, history: History, e: int, alarm: int, k: int) -> Found:
    """The test that the fault of estimator e failed at frame k."""
    estimator, config = tape.alarm.diagnosis.estimators[e], scenario.fdi
    asked = estimator.axes
    of = Hypothesis(
        tape.first, tape.offset[:, e], tape.slope[:, e], tape.spread[:, e], estimator.low, estimator.high,
        asked=asked,
    )  # fmt: skip
    since_alarm = ([Term(d, config.isolation_pole_per_s, alarm, k)] for d in directions(asked) if k > alarm)
    filtered = _filtered(scenario, tape, e, estimator.parity_direction, asked, k)
    found = _first_violated(chain(of_one_frame(k, of), filtered, since_alarm), of, history, tape)
    if found is not None:
        return found
    lasting = replace(of, constant=True)
    candidates: list[list[Term]] = []
    if estimator.kind == LOSS and config.fault_profile == "abrupt":
        candidates.append(constant_pair(lasting, history, np.arange(alarm, k + 1)))
    elif config.thresholds == "published" and k > alarm:
        candidates += [[Term(d, config.isolation_pole_per_s, alarm, k)] for d in directions(asked)]
    return _first_violated(candidates, lasting, history, tape)


def _filtered(
    scenario: Scenario, tape: Tape, e: int, across: np.ndarray, asked: tuple[int, ...], k: int
) -> Iterator[list[Term]]:
    """The detection filters, and the memory of what the fault can have done to them."""
    for m, pole in enumerate(_poles(scenario)):
        for i in asked:
            for sign, reach in ((1.0, tape.reach_high), (-1.0, -tape.reach_low)):
                d = np.zeros(3)
                d[i] = sign
                yield [Term(d, pole, tape.since, k, before=float(reach[e, m, i]))]
        if across.any() and len(asked) == 3:
            for sign, reach in ((1.0, tape.reach_high), (-1.0, -tape.reach_low)):
                yield [Term(sign * across, pole, tape.since, k, before=float(reach[e, m, 3]))]
