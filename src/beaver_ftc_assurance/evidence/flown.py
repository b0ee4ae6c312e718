"""One flight of a plan, flown and held against each requirement over it: a row."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput, BeaverFtcError
from beaver_ftc.results import Formula, Metrics, faults_of, measure
from beaver_ftc.results import evaluate_expectations as evaluate
from beaver_ftc.results import margin_of_expectation as margin
from beaver_ftc.scenario import Scenario, to_yaml
from beaver_ftc.studies.present import finite
from beaver_ftc.studies.sweep import BAD_INPUT, CRASHED, DEPARTED, FAILED, FLOWN, row_of, row_of_failure
from beaver_ftc_assurance.evidence.plan import EvidencePlan, OfHandling, OfMargins, Requirement

Row = dict[str, Any]
MET, NOT_MET, NOT_SHOWN = "met", "not met", "not shown"
BANDS = 3  # of airspeed
ALTITUDES_M = (1000.0, 2000.0)  # between two bands
_ALWAYS_WATCHED = ("t_s", "airspeed_mps", "altitude_m", "envelope_valid")


class Watched:
    """A log sink that keeps a few columns and the last row, and a digest of all."""

    def __init__(self, columns: Sequence[str]) -> None:
        self._wanted, self._digest = (*_ALWAYS_WATCHED, *columns), hashlib.sha256()
        self._places: list[int] = []
        self._kept: list[np.ndarray] = []
        self._names: tuple[str, ...] = ()
        self._last = np.empty(0)

    def open(self, columns: Sequence[str]) -> None:
        """Start; `columns` name the log's columns in order."""
        self._names, self._kept = tuple(columns), []
        self._places = [self._names.index(name) for name in self._wanted if name in self._names]
        self._digest.update(" ".join(columns).encode())

    def write(self, rows: np.ndarray) -> None:
        """Take rows (n, columns)."""
        self._digest.update(np.ascontiguousarray(rows).tobytes())
        self._kept.append(rows[:, self._places])
        self._last = rows[-1].copy()

    def close(self) -> None:
        """Nothing is left to be done."""

    @property
    def sha256(self) -> str:
        """Of the columns' names and every number."""
        return self._digest.hexdigest()

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """What was kept, (frames,) each."""
        kept = np.concatenate(self._kept)
        return {self._names[place]: kept[:, k] for k, place in enumerate(self._places)}

    @property
    def end(self) -> dict[str, float]:
        """The last row, by column."""
        return dict(zip(self._names, self._last.tolist(), strict=True))


def fly_flight(plan: EvidencePlan, case: tuple[str, int]) -> Row:
    """Fly one flight; whatever goes wrong with it is in its row."""
    try:
        return _flown(plan, *case)
    except BadInput as error:
        return failed(plan, case, str(error), BAD_INPUT)
    except BeaverFtcError as error:
        return failed(plan, case, str(error), FAILED)
    except Exception as error:  # a plug-in may raise anything: one flight's end, not the plan's
        return failed(plan, case, f"{type(error).__name__}: {error}", FAILED)


def failed(plan: EvidencePlan, case: tuple[str, int], why: str, status: str = CRASHED) -> Row:
    """The row of a flight that shows nothing."""
    name, run = case
    source = plan.sources[name]
    found = {each.id: [part("flight", None, None, NOT_SHOWN, says=why)] for each in plan.of(name)}
    assigned = source.assignment(run)
    of_sweep = assigned and row_of_failure(source.what, assigned, status, why)  # type: ignore[arg-type]
    row = _row(plan, case, status, why, found, of_sweep)
    return {**row, "scenario": None, "log": None, "aircraft": None, "faults": [], "cells": []}


def _flown(plan: EvidencePlan, name: str, run: int) -> Row:
    from beaver_ftc.loop import fly

    source = plan.sources[name]
    scenario = source.scenario(run)
    log = Watched(sorted({c for each in plan.of(name) for c in _columns(plan, each)}))
    flight = fly(scenario, log)
    amounts = measure(flight)
    found = {each.id: _judged(plan, each, scenario, amounts, log) for each in plan.of(name)}
    assigned, lost = source.assignment(run), amounts.departure
    why = f"lost: {lost.signal} at {lost.time_s:g} s" if lost else ""
    of_sweep = assigned and row_of(assigned, amounts, flight)
    return {
        **_row(plan, (name, run), DEPARTED if lost else FLOWN, why, found, of_sweep),
        "scenario": hashlib.sha256(to_yaml(scenario).encode()).hexdigest(),
        "log": log.sha256,
        "aircraft": scenario.airframe.name,
        "faults": [[each.get("actuator"), each["type"]] for each in faults_of(scenario)],
        "cells": cells(log.columns, scenario),
    }


def _row(
    plan: EvidencePlan, case: tuple[str, int], status: str, why: str, found: Row, of_sweep: Row | None
) -> Row:
    name, run = case
    flight = plan.sources[name].flight(run)
    return {"flight": flight, "source": name, "run": run, "status": status, "why": why, "found": found,
            "row": of_sweep}  # fmt: skip


def _columns(plan: EvidencePlan, requirement: Requirement) -> frozenset[str]:
    formula = plan.formulas.get(requirement.id)
    return formula.columns if formula else frozenset()


def part(
    name: str, expected: Any, actual: Any, verdict: str, inside: float | None = None, says: str = ""
) -> Row:
    """One thing that was asked of a flight. inside: its margin, below 0 where it is not met."""
    return {"name": name, "expected": expected, "actual": actual, "verdict": verdict, "margin": inside,
            "says": says}  # fmt: skip


def _judged(
    plan: EvidencePlan, requirement: Requirement, scenario: Scenario, found: Metrics, log: Watched
) -> list[Row]:
    """What a flight says of a requirement, part by part; of a sweep's statistics nothing."""
    bar, formula = requirement.bar, plan.formulas.get(requirement.id)
    if formula is not None:
        return [_of_formula(requirement.formula or "", formula, scenario.rate_hz, found, log)]
    try:
        if isinstance(bar, OfHandling):
            return _of_handling(bar, scenario, found, log)
        if isinstance(bar, OfMargins):
            return _of_margins(bar, scenario)
    except BeaverFtcError as error:  # the study has nothing to say of it, such as of another law
        return [part("the study", None, None, NOT_SHOWN, says=str(error))]
    if requirement.expect is None:
        return []
    return [
        part(one.name, one.expected, one.actual, MET if one.passed else NOT_MET, margin(one))
        for one in evaluate(plan.expect[requirement.id], found)
    ]


def _of_formula(text: str, formula: Formula, rate_hz: float, found: Metrics, log: Watched) -> Row:
    r = formula.robustness(log.columns, rate_hz)
    lost = found.departure
    if not math.isfinite(r):
        nan, far = "a column is not a number where it asks", "it looks beyond the log, or at what is infinite"
        why = nan if math.isnan(r) else far
        return part("robustness", text, None, NOT_SHOWN, says=why)
    if r >= 0.0 and lost and formula.looks_ahead_s > lost.time_s:
        return part("robustness", text, r, NOT_SHOWN, says=f"the aircraft was lost at {lost.time_s:g} s")
    return part("robustness", text, r, MET if r >= 0.0 else NOT_MET, r)


def _of_handling(bar: OfHandling, scenario: Scenario, found: Metrics, log: Watched) -> list[Row]:
    from beaver_ftc.studies import HANDLING_LIMITS as LIMITS
    from beaver_ftc.studies import where_ended, where_trimmed

    if found.departure:
        return [part("handling qualities", bar.level, None, NOT_SHOWN, says="the aircraft was lost")]
    qualities = where_ended(scenario, log.end) if scenario.faults else where_trimmed(scenario)
    parts = []
    for limit, each in zip(LIMITS, qualities, strict=True):
        least, most = (None if math.isinf(end) else end for end in limit.levels[bar.level - 1])
        asked = {"at_least": least, "at_most": most, "level": bar.level}
        inside = limit.margin(each.value, bar.level)
        parts.append(part(
            f"{limit.mode} {limit.quantity}", {key: v for key, v in asked.items() if v is not None},
            finite(each.value), MET if each.level <= bar.level else NOT_MET,
            finite(inside), f"level {each.level}" if each.level <= 3 else "no level",
        ))  # fmt: skip
    return parts


def _of_margins(bar: OfMargins, scenario: Scenario) -> list[Row]:
    from beaver_ftc.studies import margins_at as at
    from beaver_ftc.studies import refuse_laws_without_margins as refuse_other_laws

    refuse_other_laws(scenario)
    found = list(at(scenario))
    if not found:
        return [part("margins", None, None, NOT_SHOWN, says="no surface has a loop to speak of")]
    asked = (
        ("gain margin, dB", bar.gain_db, min((min(each.up_db, each.down_db), each.fault) for each in found)),
        ("phase margin, deg", bar.phase_deg, min((each.phase_deg, each.fault) for each in found)),
    )
    return [
        part(name, {"at_least": bound}, finite(least), MET if least >= bound else NOT_MET,
             finite(least - bound), f"fault: {fault}")
        for name, bound, (least, fault) in asked
    ]  # fmt: skip


def cells(columns: dict[str, np.ndarray], scenario: Scenario) -> list[int]:
    """The cells of the envelope that a flight was in, once its first fault had struck: airspeed band after
    airspeed band, in each by altitude."""
    slowest, fastest = scenario.airframe.envelope.airspeed_mps
    since = min((fault.at_s for fault in scenario.faults), default=0.0)
    there = (columns["t_s"] >= since) & (columns["envelope_valid"] > 0.5)
    V, h = columns["airspeed_mps"][there], columns["altitude_m"][there]
    band = np.floor(BANDS * (V - slowest) / (fastest - slowest)).astype(int)
    inside = (band >= 0) & (band < BANDS)
    of_all = band[inside] * (len(ALTITUDES_M) + 1) + np.searchsorted(ALTITUDES_M, h[inside], side="right")
    return [int(cell) for cell in np.unique(of_all)]
