"""The flights with errors larger than declared, and their summary.

A flight is the scenario with its own faults, which begin later by a random time, and with errors that are
multiples of the errors in `fdi.bounds` (errors.py). Errors are enlarged one at a time, while the other
declared errors stay at their limit, and all together. The summary counts false alarms, detections, right and
wrong names and lost aircraft, and has medians of delay and tracking error.
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
from beaver_ftc.studies.present.tables import grouped, sum_of, values_of
from beaver_ftc.studies.sensitivity.errors import Error, changes_of, errors_of

FACTORS = (1.0, 1.5, 2.0, 4.0)  # size of an error over the declared size
TOGETHER = "all together"
COUNTED = ("false_alarm", "detected", "named", "misnamed", "lost")
MEASURED = ("delay_s", "tracking_deg_s", "bound_used")
FAILED = {"failed": True}  # the row of a flight that cannot be flown to its end
FLIGHTS = 40  # of a row; if none has an event, its probability is below 9 % (95 % confidence)
LATER_S = 4.0  # largest delay of the begin of the faults
LEFT_S = 5.0  # shortest time that a delay leaves from the begin of the last fault to the end
Errors = Sequence[Error]  # the errors of a scenario


class Flight(NamedTuple):
    """One flight: the enlarged error, its factor, and the number of the draw."""

    error: str
    factor: float
    run: int


def cases_of(errors: Errors, flights: int) -> list[Flight]:
    """All flights. Declared errors share the flights with the factor 1, which are flown once, under
    TOGETHER."""
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
    """The factor of each error in a flight. An error that is not declared has one only if it is the enlarged
    error."""
    factors = {error.name: FACTORS[0] for error in errors if error.declared}
    if flight.error == TOGETHER:
        return dict.fromkeys(factors, flight.factor)
    return factors | {flight.error: flight.factor}


def scenario_of(scenario: Scenario, errors: Errors, seed: int, flight: Flight) -> Scenario:
    """The scenario of a flight. Random draws depend on seed and number alone, so that rows differ only by the
    error. The law always assumes the sensors of the scenario, also if the flight has larger errors."""
    draws = np.random.default_rng([seed, flight.run])
    changes: Document = {"seed": int(draws.integers(2**31)), "expect": {}}
    later = float(draws.uniform())
    changes |= changes_of(errors, factors_of(errors, flight), draws)
    changes["design_model.sensors"] = scenario.known_sensors.model_dump()
    begins_s = [fault.at_s for fault in scenario.faults]
    room = min(LATER_S, scenario.duration_s - LEFT_S - max(begins_s, default=0.0))
    later_s = round(later * max(room, 0.0) * scenario.rate_hz) / scenario.rate_hz
    for i, fault in enumerate(scenario.faults):
        changes[f"faults[{i}].at_s"] = fault.at_s + later_s
        if fault.end_s is not None:
            changes[f"faults[{i}].end_s"] = fault.end_s + later_s
    return scenario.with_(changes)


def fly_one(scenario: Scenario, seed: int, flight: Flight) -> Document:
    """The row of a flight."""
    with_errors = scenario_of(scenario, errors_of(scenario), seed, flight)
    try:
        landing = fly(with_errors)
    except BeaverFtcError:
        return FAILED
    return row_of(measure(landing), max(landing.closest_approach, default=0.0))


def row_of(metrics: Metrics, bound_used: float) -> Document:
    """The row of a completed flight. bound_used: largest share of the detection bound that its healthy part
    used. The tracking error is that of the worst axis after the first fault, or of the whole flight in a
    scenario without a fault; None if the aircraft is lost."""
    isolation = metrics.isolation
    tracking = metrics.tracking
    rms = tracking.post_fault_rms_deg_s if metrics.fault else tracking.pre_fault_rms_deg_s
    return {
        "failed": False,
        "false_alarm": metrics.false_alarm,
        "detected": metrics.fault_found_s is not None,
        "named": bool(isolation.correct),
        "misnamed": isolation.isolated and not isolation.correct,
        "lost": metrics.departure is not None,
        "delay_s": metrics.fault_found_s,
        "tracking_deg_s": None
        if metrics.departure or rms is None
        else max(rms.p or 0, rms.q or 0, rms.r or 0),
        "bound_used": bound_used,
    }


def document_of(
    scenario: Scenario, errors: Errors, cases: Sequence[Flight], seed: int, rows: Sequence[Document]
) -> Document:
    """The document: a row for each error and factor. rows: of all flights, in the order of the cases."""
    flights = (case._asdict() | row for case, row in zip(cases, rows, strict=True))
    rows_of = grouped(flights, "error", "factor")
    as_declared = rows_of[TOGETHER, FACTORS[0]]
    size_of_error = {error.name: error.says for error in errors} | {TOGETHER: "all that are declared"}
    return {
        "scenario": scenario.name,
        "faults": len(scenario.faults),
        "seed": seed,
        "flights": len(as_declared),
        "confidence": CONFIDENCE,
        "factors": list(FACTORS),
        "errors": [{"error": e.name, "declared": e.says, "is_declared": e.declared} for e in errors],
        "rows": [
            {"error": name, "declared": size, "factor": factor}
            | summary(rows_of.get((name, factor), as_declared))
            for name, size in size_of_error.items()
            for factor in FACTORS
        ],
        "versions": dict(versions()),
    }


def summary(rows: Sequence[Document]) -> Document:
    """Counts and medians with their intervals, of the completed flights. A number that is None, such as the
    tracking error of a lost aircraft or the delay without a detection, counts as infinite."""
    completed = [row for row in rows if not row["failed"]]
    counts = {name: sum_of(completed, name) for name in COUNTED}
    return {
        "flights": len(completed),
        "failed": len(rows) - len(completed),
        **{name: counted(count, len(completed)) for name, count in counts.items()},
        **{name: median(values_of(completed, name)) for name in MEASURED},
    }
