"""The flights that show how a verdict decays, and their summary.

A flight is the scenario with its own faults, later by a draw, and a truth whose errors are multiples of what
`fdi.bounds` declares (`errors.py`). Errors are raised one at a time while the others that are declared stay
at their limit, and all together. What is counted is what a user of the verdict relies on: alarms before a
fault, detection, right and wrong names, and how the aircraft is flown.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beaver_ftc.documents.errors import BeaverFtcError
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import measure, versions
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import CONFIDENCE, counted, median
from beaver_ftc.studies.present.tables import grouped
from beaver_ftc.studies.sensitivity.errors import Error, changes_of, errors_of

FACTORS = (1.0, 1.5, 2.0, 4.0)
TOGETHER = "all together"
COUNTED = ("false_alarm", "detected", "named", "misnamed", "lost")
MEASURED = ("delay_s", "tracking_deg_s", "bound_used")
FAILED = {"failed": True}  # the row of a flight that cannot be flown to its end
FLIGHTS = 40  # of a row: an event that none of them has is rarer than 9 % (95 %)
LATER_S = 4.0  # the faults come so much later at most
LEFT_S = 5.0  # and so long before the end


Errors = Sequence[Error]  # of a scenario


class Flight(NamedTuple):
    """One flight: which error is how many times as large as declared, and its number."""

    error: str
    factor: float
    run: int


def cases_of(errors: Errors, flights: int) -> list[Flight]:
    """Every flight; where each error is as declared, all rows share the same ones."""
    declared = {error.name: error.declared for error in errors} | {TOGETHER: True}
    rows = [(TOGETHER, FACTORS[0])]
    rows += [
        (name, factor)
        for name, is_declared in declared.items()
        for factor in FACTORS
        if not (is_declared and factor == FACTORS[0])
    ]
    return [Flight(*row, run) for row in rows for run in range(flights)]


def factors_of(errors: Errors, flight: Flight) -> dict[str, float]:
    """By error: how many times as large as declared it is in a flight."""
    of = {error.name: FACTORS[0] for error in errors if error.declared}
    if flight.error == TOGETHER:
        return dict.fromkeys(of, flight.factor)
    return of | {flight.error: flight.factor}


def scenario_of(scenario: Scenario, errors: Errors, seed: int, flight: Flight) -> Scenario:
    """The scenario of a flight: draws depend on its number alone, so that rows differ by the error. The law
    knows the sensors of the scenario, whatever theirs are in the flight."""
    draws = np.random.default_rng([seed, flight.run])
    changes: Document = {"seed": int(draws.integers(2**31)), "expect": {}}
    later = float(draws.uniform())
    changes |= changes_of(errors, factors_of(errors, flight), draws)
    changes["design_model.sensors"] = scenario.known_sensors.model_dump()
    times = [fault.at_s for fault in scenario.faults]
    room = min(LATER_S, scenario.duration_s - LEFT_S - max(times, default=0.0))
    later_s = round(later * max(room, 0.0) * scenario.rate_hz) / scenario.rate_hz
    for i, fault in enumerate(scenario.faults):
        changes[f"faults[{i}].at_s"] = fault.at_s + later_s
        if fault.end_s is not None:
            changes[f"faults[{i}].end_s"] = fault.end_s + later_s
    return scenario.with_(changes)


def fly_one(scenario: Scenario, seed: int, flight: Flight) -> Document:
    """The row of a flight."""
    flown = scenario_of(scenario, errors_of(scenario), seed, flight)
    try:
        landing = fly(flown)
    except BeaverFtcError:
        return FAILED
    return row_of(measure(landing), max(landing.closest_approach, default=0.0))


def row_of(found: Metrics, bound_used: float) -> Document:
    """The row of a flight that was flown."""
    isolation = found.isolation
    tracked = found.tracking
    rms = tracked.post_fault_rms_deg_s if found.fault else tracked.pre_fault_rms_deg_s
    return {
        "failed": False,
        "false_alarm": found.false_alarm,
        "detected": found.fault_found_s is not None,
        "named": bool(isolation.correct),
        "misnamed": isolation.isolated and not isolation.correct,
        "lost": found.departure is not None,
        "delay_s": found.fault_found_s,
        "tracking_deg_s": None if found.departure or rms is None else max(rms.p or 0, rms.q or 0, rms.r or 0),
        "bound_used": bound_used,
    }


def document_of(
    scenario: Scenario, errors: Errors, cases: Sequence[Flight], seed: int, rows: Sequence[Document]
) -> Document:
    """A row an error and factor, of the rows of all flights."""
    flights = (case._asdict() | row for case, row in zip(cases, rows, strict=True))
    flown = grouped(flights, "error", "factor")
    shared = flown[TOGETHER, FACTORS[0]]
    says = {error.name: error.says for error in errors} | {TOGETHER: "all that are declared"}
    return {
        "scenario": scenario.name,
        "faults": len(scenario.faults),
        "seed": seed,
        "flights": len(shared),
        "confidence": CONFIDENCE,
        "factors": list(FACTORS),
        "errors": [{"error": e.name, "declared": e.says, "is_declared": e.declared} for e in errors],
        "rows": [
            {"error": name, "declared": said, "factor": factor} | summary(flown.get((name, factor), shared))
            for name, said in says.items()
            for factor in FACTORS
        ],
        "versions": dict(versions()),
    }


def summary(rows: Sequence[Document]) -> Document:
    """Counts with their intervals; medians with theirs: of flights whose aircraft is lost, infinite."""
    flown = [row for row in rows if not row["failed"]]
    counts = {name: sum(row[name] for row in flown) for name in COUNTED}
    return {
        "flights": len(flown),
        "failed": len(rows) - len(flown),
        **{name: counted(count, len(flown)) for name, count in counts.items()},
        **{name: median(row[name] for row in flown) for name in MEASURED},
    }
