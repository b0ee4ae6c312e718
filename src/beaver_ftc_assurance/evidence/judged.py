"""The document evidence.json: for each requirement its verdict, margin and worst flight; the coverage of the
envelope by flights; sources and versions.

A *part* is one condition of a requirement with its result (`flown.part`). A requirement on each flight has
parts of each flight. A requirement on a sweep (`bar` of type sweep) has a part for each limit on a statistic
of the sweep, which counts as a part of the flight that contributes the worst value. The worst part decides
the verdict and the margin.
"""

import io
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.results import Document, versions
from beaver_ftc.scenario import SweepExpect
from beaver_ftc.scenario.faults import DAMAGE, TYPES, UNANTICIPATED
from beaver_ftc.studies.engine import fingerprint, plug_ins
from beaver_ftc.studies.sweep import RESULTS, Flights
from beaver_ftc.studies.sweep import evaluate_summary as evaluate
from beaver_ftc_assurance.evidence.flown import (
    ALTITUDES_M,
    BANDS,
    MET,
    NOT_MET,
    NOT_SHOWN,
    WORST_FIRST,
    Row,
    part,
)
from beaver_ftc_assurance.evidence.plan import EvidencePlan
from beaver_ftc_assurance.evidence.plan_file import OfSweep, Requirement

MOST_NAMED = 50  # largest number of flights that are listed as not meeting a requirement
JudgedFlight = tuple[str, Row]  # name of a flight, and one `part` of its result


def document_of(plan: EvidencePlan, rows: Sequence[Row], date: str) -> Document:
    """The document evidence.json. Two documents of the same plan differ only in their date."""
    requirements = [_requirement(plan, requirement, rows) for requirement in plan.file.requirements]
    aircraft = {source.aircraft.name: source.aircraft for source in plan.sources.values()}
    counts = _counts(requirement["verdict"] for requirement in requirements)
    return {
        "plan": plan.file.name,
        "description": plan.file.description,
        "date": date,
        "passed": counts[MET] == len(requirements),
        "counts": counts,
        "requirements": requirements,
        "coverage": [_coverage(flown, rows) for flown in aircraft.values()],
        "sources": [
            {"name": source.name, "given": source.given, "flights": source.flights, "sha256": source.sha256}
            for source in plan.sources.values()
        ],
        "flights": [
            {key: row[key] for key in ("flight", "status", "why", "scenario", "log")} for row in rows
        ],
        "hashes": {"plan": plan.sha256, "flight code": fingerprint()},
        "versions": {**versions(), **plug_ins()},
    }


def command(plan: EvidencePlan, flight: str) -> str:
    """The command line that flies a flight of a plan again and judges it."""
    return shlex.join(["beaver-ftc", "evidence", plan.given, "--replay", flight])


def _requirement(plan: EvidencePlan, requirement: Requirement, rows: Sequence[Row]) -> Document:
    """A requirement with its verdict and margin, its worst flight, and the first MOST_NAMED flights that do
    not meet it."""
    sources = plan.over[requirement.id]
    if isinstance(requirement.bar, OfSweep):
        results = [result for name in sources for result in _of_sweep(plan, requirement.bar, name, rows)]
    else:
        results = [(row["flight"], result) for row in rows for result in row["found"].get(requirement.id, ())]
    verdicts: dict[str, str] = {}
    for flight, result in results:
        verdicts[flight] = _worst_of([verdicts.get(flight, MET), result["verdict"]])
    flight, worst = min(
        results,
        key=lambda flight_and_part: _rank(flight_and_part[1]),
        default=("", part("", None, None, NOT_SHOWN)),
    )
    return {
        "id": requirement.id,
        "text": requirement.text,
        "clause": requirement.clause,
        "asked": requirement.model_dump(mode="json", include={"expect", "formula", "bar"}, exclude_none=True),
        "verdict": _worst_of(verdicts.values()),
        "margin": worst["margin"],
        "margin_of": worst["name"],
        "worst": {"flight": flight, "command": command(plan, flight) if flight else None, **worst},
        "over": [plan.sources[name].given for name in sources],
        "flights": sum(row["source"] in sources for row in rows),
        "counts": {} if isinstance(requirement.bar, OfSweep) else _counts(verdicts.values()),
        "failing": [
            {"flight": name, "verdict": verdict, "command": command(plan, name)}
            for name, verdict in verdicts.items() if verdict != MET
        ][:MOST_NAMED],
    }  # fmt: skip


def _counts(verdicts: Iterable[str]) -> dict[str, int]:
    """How often each verdict occurs."""
    return dict.fromkeys((MET, NOT_MET, NOT_SHOWN), 0) | Counter(verdicts)


def _worst_of(verdicts: Iterable[str]) -> str:
    """The worst of some verdicts; not shown, if there is none."""
    return min(verdicts, key=WORST_FIRST.index, default=NOT_SHOWN)


def _rank(result: Row) -> tuple[int, float]:
    """Key that sorts parts, the worst first: by verdict, then by margin over the size of the limit.

    margin      verdict     second key
    known       any         margin / size of the limit
    unknown     not met     -inf, the worst of this verdict
    unknown     another     inf, the best of this verdict
    """
    order = WORST_FIRST.index(result["verdict"])
    if result["margin"] is None:
        return order, -inf if result["verdict"] == NOT_MET else inf
    return order, result["margin"] / _size(result["expected"])


def _size(expected: Any) -> float:
    """Magnitude of the limit by which a margin is divided; 1 if there is no limit, or if it is 0."""
    if isinstance(expected, dict):
        expected = next((abs(expected[side]) for side in ("at_least", "at_most") if expected.get(side)), 1.0)
    number = isinstance(expected, int | float) and not isinstance(expected, bool)
    return abs(float(expected)) or 1.0 if number else 1.0


def _of_sweep(plan: EvidencePlan, bar: OfSweep, name: str, rows: Sequence[Row]) -> list[JudgedFlight]:
    """The statistics of a sweep as parts, each with its worst flight. name: of the sweep among the sources.

    The limits are compared twice: `bounded`, with the bound at the confidence of the bar, and `estimated`,
    with the estimate itself. If the bar has no confidence, both are the same. `_of_statistic` takes the
    verdict from the two.
    """
    from beaver_ftc.studies.sweep import schema_of, table_of, write_tables

    source = plan.sources[name]
    sweep = source.content
    schema = schema_of(sweep)
    table = table_of(sweep, schema, [row["row"] for row in rows if row["source"] == name])
    file = io.BytesIO()  # `Flights` reads the file of a sweep, whose columns differ from those of the rows
    write_tables(file, [table], schema)
    flights = Flights(file, sweep)
    bounded = evaluate(_conditions(bar, "type"), flights)
    estimated = evaluate(_conditions(bar, "type", "confidence"), flights)
    return [
        (source.flight(_worst(flights, bound["name"])), _of_statistic(bound, estimate))
        for bound, estimate in zip(bounded, estimated, strict=True)
    ]


def _worst(flights: Flights, name: str) -> int:
    """Number of the flight with the worst contribution to a statistic, such as `tracking_ratio.p`; that of
    the first flight if none contributes.

    bad (flights,): contribution of each flight, the larger the worse; a flag counts 1, an unknown number
    -inf.
    """
    quantity, _, axis = name.partition(".")
    contributions: dict[str, Callable[[], np.ndarray]] = {
        "detection_rate": lambda: flights.faulted & ~flights.detected,
        "isolation_rate": lambda: flights.faulted & ~flights.isolated,
        "false_alarms_per_hour": lambda: flights["false_alarm"],
        "departure_rate": lambda: flights.departed,
        "failure_rate": lambda: ~flights.measured,
        "pass_rate": lambda: ~flights["passed"],
        "post_fault_rms_deg_s": lambda: flights.post_fault_rms_deg_s(axis),
        "tracking_ratio": lambda: flights.tracking_ratio(axis),
    }
    if quantity.endswith("_delay_s"):
        bad = np.where(flights.faulted, getattr(flights, quantity), -np.inf)
    else:
        bad = contributions[quantity]().astype(float)
    bad = np.nan_to_num(bad, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    return int(flights["run"][np.argmax(bad)])


def _conditions(bar: OfSweep, *without: str) -> SweepExpect:
    """The conditions of a bar, without the keys `without` at any level."""

    def reduced(section: Any) -> Any:
        """The section without the keys; a value that is no section, as it is."""
        if not isinstance(section, dict):
            return section
        return {key: reduced(value) for key, value in section.items() if key not in without}

    return SweepExpect.model_validate(reduced(bar.model_dump(exclude_none=True)))


def _of_statistic(bound: Document, estimate: Document) -> Row:
    """The part of a statistic.

        bound keeps the limit    estimate keeps it    verdict
        yes                      any                  met
        no                       yes, or no flight    not shown
        no                       no                   not met

    bound, estimate: `evaluate` with and without the confidence of the bar.
    """
    verdict = MET
    remark = f"{bound['of']} flights tell"
    if not bound["passed"]:
        verdict = NOT_SHOWN if not bound["of"] or estimate["passed"] else NOT_MET
    expected = bound["expected"]
    actual = bound["actual"]
    margin = None
    if actual is not None:
        margin = actual - expected["at_least"] if "at_least" in expected else expected["at_most"] - actual
    return part(bound["name"], expected, actual, verdict, margin, remark)


def _coverage(aircraft: Aircraft, rows: Sequence[Row]) -> Document:
    """For one aircraft: the number of flights with each fault on each surface, by cell of the envelope;
    failed flights do not count. Cell k has the airspeed band k // (number of altitude bands) and the altitude
    band k % (number of altitude bands), as in `flown.cells`.

    counts: (surface, fault type, cell) -> number of flights; surface and type of a flight without a fault of
    a surface are `none`.
    """
    slowest, fastest = aircraft.envelope.airspeed_mps
    width = (fastest - slowest) / BANDS
    ends_m = (None, *ALTITUDES_M, None)
    bands = [
        {"airspeed_mps": [slowest + k * width, slowest + (k + 1) * width], "altitude_m": [low, high]}
        for k in range(BANDS) for low, high in pairwise(ends_m)
    ]  # fmt: skip
    counts: Counter[tuple[str, str, int]] = Counter()
    for row in rows:
        if row["aircraft"] == aircraft.name and row["status"] in RESULTS:
            kinds = {(surface, kind) for surface, kind in row["faults"] if surface} or {("none", "none")}
            counts.update((*kind, cell) for kind in kinds for cell in row["cells"])
    flown = [
        {"surface": surface, "type": kind, "flights": [counts[surface, kind, k] for k in range(len(bands))]}
        for surface, kind in sorted({key[:2] for key in counts})
    ]
    types = [kind for kind in TYPES if kind not in (DAMAGE, UNANTICIPATED)]
    surfaces = list(aircraft.surfaces)
    with_fault = sum(n > 0 and key[0] != "none" for key, n in counts.items())
    return {
        "aircraft": aircraft.name, "cells": bands, "flown": flown, "combinations": with_fault,
        "of": len(types) * len(surfaces) * len(bands),
        "never": [[s, t] for s in surfaces for t in types if not any(key[:2] == (s, t) for key in counts)],
    }  # fmt: skip
