"""Fly one flight of a plan: its row has the result of each requirement of the plan.

A requirement has one or several *parts* (`part`), each with an expected and an actual value, a verdict and a
margin.
"""

import hashlib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput, BeaverFtcError
from beaver_ftc.results import Columns, Formula, Metrics, faults_of, measure
from beaver_ftc.results import evaluate_expectations as evaluate
from beaver_ftc.results import margin_of_expectation as margin
from beaver_ftc.scenario import Scenario, to_yaml
from beaver_ftc.studies.present import finite
from beaver_ftc.studies.sweep import BAD_INPUT, CRASHED, DEPARTED, FAILED, FLOWN, row_of, row_of_failure
from beaver_ftc_assurance.evidence.plan import EvidencePlan
from beaver_ftc_assurance.evidence.plan_file import OfHandling, OfMargins, Requirement

Row = dict[str, Any]
MET = "met"
NOT_MET = "not met"
NOT_SHOWN = "not shown"
WORST_FIRST = NOT_MET, NOT_SHOWN, MET
BANDS = 3  # number of equal bands of airspeed over the envelope
ALTITUDES_M = (1000.0, 2000.0)  # limits between the altitude bands
# Columns of the log that are kept in every flight.
_ALWAYS_WATCHED = ("t_s", "airspeed_mps", "altitude_m", "envelope_valid")


class Watched(Columns):
    """A log sink that keeps the columns of `_ALWAYS_WATCHED` and some more, the last row (`end`), and a
    digest of all columns.
    """

    def __init__(self, columns: Iterable[str]) -> None:
        super().__init__()
        self._asked = {*_ALWAYS_WATCHED, *columns}
        self._digest = hashlib.sha256()

    def open(self, columns: Sequence[str]) -> None:
        """Start; `columns` name the log's columns in order."""
        self._wanted = tuple(name for name in columns if name in self._asked)
        self._all = tuple(columns)
        self._digest.update(" ".join(columns).encode())
        super().open(columns)

    def write(self, rows: np.ndarray) -> None:
        """Add rows (n, columns)."""
        self._digest.update(np.ascontiguousarray(rows).tobytes())
        self.end = dict(zip(self._all, rows[-1].tolist(), strict=True))
        super().write(rows)

    @property
    def sha256(self) -> str:
        """SHA-256 of the names of the columns and of every number."""
        return self._digest.hexdigest()


def fly_flight(plan: EvidencePlan, case: tuple[str, int]) -> Row:
    """The row of one flight; if the flight fails, the row has the reason. case: source, and number of the
    flight."""
    try:
        return _flown(plan, *case)
    except BadInput as error:
        return failed(plan, case, str(error), BAD_INPUT)
    except Exception as error:  # a plug-in may raise any error, which must end one flight and not the plan
        ours = isinstance(error, BeaverFtcError)
        return failed(plan, case, str(error) if ours else f"{type(error).__name__}: {error}", FAILED)


def failed(plan: EvidencePlan, case: tuple[str, int], why: str, status: str = CRASHED) -> Row:
    """The row of a flight that failed: each requirement is not shown. why: the reason."""
    name, run = case
    source = plan.sources[name]
    none = part("flight", None, None, NOT_SHOWN, says=why)
    assigned = source.assignment(run)
    of_sweep = assigned and row_of_failure(source.content, assigned, status, why)
    return {
        "flight": source.flight(run), "source": name, "run": run, "status": status, "why": why,
        "found": {requirement.id: [none] for requirement in plan.of(name)}, "row": of_sweep,
        "scenario": None, "log": None, "aircraft": None, "faults": [], "cells": [],
    }  # fmt: skip


def _flown(plan: EvidencePlan, name: str, run: int) -> Row:
    """The row of a flight that is flown and measured. name, run: source, and number of the flight."""
    from beaver_ftc.loop import fly

    source = plan.sources[name]
    scenario = source.scenario(run)
    formulas = [plan.formulas.get(requirement.id) for requirement in plan.of(name)]
    log = Watched(column for formula in formulas if formula for column in formula.columns)
    flight = fly(scenario, log)
    metrics = measure(flight)
    assigned = source.assignment(run)
    departure = metrics.departure
    return {
        "flight": source.flight(run), "source": name, "run": run,
        "status": DEPARTED if departure else FLOWN,
        "why": f"lost: {departure.signal} at {departure.time_s:g} s" if departure else "",
        "found": {
            requirement.id: _judged(plan, requirement, scenario, metrics, log)
            for requirement in plan.of(name)
        },
        "row": assigned and row_of(assigned, metrics, flight),
        "scenario": hashlib.sha256(to_yaml(scenario).encode()).hexdigest(),
        "log": log.sha256,
        "aircraft": scenario.airframe.name,
        "faults": [[fault.get("actuator"), fault["type"]] for fault in faults_of(scenario)],
        "cells": cells(log, scenario),
    }  # fmt: skip


def part(
    name: str, expected: Any, actual: Any, verdict: str, inside: float | None = None, says: str = ""
) -> Row:
    """One condition of a requirement on a flight. inside: margin, negative if the condition is not met. says:
    remark."""
    return {"name": name, "expected": expected, "actual": actual, "verdict": verdict, "margin": inside,
            "says": says}  # fmt: skip


def _judged(
    plan: EvidencePlan, requirement: Requirement, scenario: Scenario, metrics: Metrics, log: Watched
) -> list[Row]:
    """The parts of a requirement on a flight; none if the requirement is on the statistics of a sweep."""
    bar = requirement.bar
    formula = plan.formulas.get(requirement.id)
    if formula is not None:
        return [_of_formula(requirement.formula or "", formula, scenario.rate_hz, metrics, log)]
    try:
        if isinstance(bar, OfHandling):
            return _of_handling(bar, scenario, metrics, log)
        if isinstance(bar, OfMargins):
            return _of_margins(bar, scenario)
    except BeaverFtcError as error:  # the study does not cover the flight, for example because of its law
        return [part("the study", None, None, NOT_SHOWN, says=str(error))]
    if requirement.expect is None:
        return []
    return [
        part(bound.name, bound.expected, bound.actual, MET if bound.passed else NOT_MET, margin(bound))
        for bound in evaluate(plan.expect[requirement.id], metrics)
    ]


def _of_formula(text: str, formula: Formula, rate_hz: float, metrics: Metrics, log: Watched) -> Row:
    """The part of a formula of signal temporal logic. r: its robustness, at least 0 if the formula holds. The
    first of these rows that applies gives the verdict:

        r is not a number, or infinite                                   not shown
        r >= 0, but the formula looks beyond the loss of the aircraft    not shown
        r >= 0                                                           met
        r < 0                                                            not met
    """
    r = formula.robustness(log, rate_hz)
    departure = metrics.departure
    if not math.isfinite(r):
        nan = "a column is not a number where it asks"
        far = "it looks beyond the log, or at what is infinite"
        why = nan if math.isnan(r) else far
        return part("robustness", text, None, NOT_SHOWN, says=why)
    if r >= 0.0 and departure and formula.looks_ahead_s > departure.time_s:
        return part("robustness", text, r, NOT_SHOWN, says=f"the aircraft was lost at {departure.time_s:g} s")
    return part("robustness", text, r, MET if r >= 0.0 else NOT_MET, r)


def _of_handling(bar: OfHandling, scenario: Scenario, metrics: Metrics, log: Watched) -> list[Row]:
    """A part for each limit on a mode of motion: whether its level of handling qualities is good enough; one
    part, not shown, if the aircraft was lost."""
    from beaver_ftc.studies import HANDLING_LIMITS as LIMITS
    from beaver_ftc.studies import where_ended, where_trimmed

    if metrics.departure:
        return [part("handling qualities", bar.level, None, NOT_SHOWN, says="the aircraft was lost")]
    qualities = where_ended(scenario, log.end) if scenario.faults else where_trimmed(scenario)
    parts = []
    for limit, quality in zip(LIMITS, qualities, strict=True):
        ends = zip(("at_least", "at_most"), limit.levels[bar.level - 1], strict=True)
        limits = {side: end for side, end in ends if not math.isinf(end)} | {"level": bar.level}
        verdict = MET if quality.level <= bar.level else NOT_MET
        inside = finite(limit.margin(quality.value, bar.level))
        remark = f"level {quality.level}" if quality.level <= 3 else "no level"
        parts.append(
            part(f"{limit.mode} {limit.quantity}", limits, finite(quality.value), verdict, inside, remark)
        )
    return parts


def _of_margins(bar: OfMargins, scenario: Scenario) -> list[Row]:
    """The least gain margin and the least phase margin over all surfaces and losses, a part each; one part,
    not shown, without a loop."""
    from beaver_ftc.studies import margins_at as at
    from beaver_ftc.studies import refuse_laws_without_margins as refuse_other_laws

    refuse_other_laws(scenario)
    loops = list(at(scenario))
    if not loops:
        return [part("margins", None, None, NOT_SHOWN, says="no surface has a loop to speak of")]
    parts = []
    for name, bound, margins in (
        ("gain margin, dB", bar.gain_db, [(min(loop.up_db, loop.down_db), loop.fault) for loop in loops]),
        ("phase margin, deg", bar.phase_deg, [(loop.phase_deg, loop.fault) for loop in loops]),
    ):
        smallest, fault = min(margins)
        verdict = MET if smallest >= bound else NOT_MET
        inside = finite(smallest - bound)
        parts.append(part(name, {"at_least": bound}, finite(smallest), verdict, inside, f"fault: {fault}"))
    return parts


def cells(columns: Mapping[str, np.ndarray], scenario: Scenario) -> list[int]:
    """Numbers of the cells of the envelope in which the flight was, inside the envelope, from its first fault
    on; without a fault, from its start on. The number of a cell is (number of altitude bands) * (airspeed
    band) + (altitude band)."""
    slowest, fastest = scenario.airframe.envelope.airspeed_mps
    since = min((fault.at_s for fault in scenario.faults), default=0.0)
    counted = (columns["t_s"] >= since) & (columns["envelope_valid"] > 0.5)
    V = columns["airspeed_mps"][counted]
    h = columns["altitude_m"][counted]
    band = np.floor(BANDS * (V - slowest) / (fastest - slowest)).astype(int)
    inside = (band >= 0) & (band < BANDS)
    cell_numbers = band[inside] * (len(ALTITUDES_M) + 1) + np.searchsorted(
        ALTITUDES_M, h[inside], side="right"
    )
    return [int(cell) for cell in np.unique(cell_numbers)]
