"""The document evidence.json: for each requirement its verdict, margin and worst flight; the coverage of the
envelope by flights; sources and versions.
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
from beaver_ftc.scenario import Sweep, SweepExpect
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

MOST_NAMED = 50  # flights that are listed as not meeting a requirement
Judged = tuple[str, Row]  # name of a flight, and one `part` of its result


def document_of(plan: EvidencePlan, rows: Sequence[Row], date: str) -> Document:
    """The document evidence.json. date: the only difference between two documents of the same plan."""
    requirements = [_requirement(plan, each, rows) for each in plan.file.requirements]
    aircraft = {source.aircraft.name: source.aircraft for source in plan.sources.values()}
    counts = _counts(each["verdict"] for each in requirements)
    return {
        "plan": plan.file.name,
        "description": plan.file.description,
        "date": date,
        "passed": counts[MET] == len(requirements),
        "counts": counts,
        "requirements": requirements,
        "coverage": [_coverage(each, rows) for each in aircraft.values()],
        "sources": [
            {"name": each.name, "given": each.given, "flights": each.flights, "sha256": each.sha256}
            for each in plan.sources.values()
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
    """A requirement with its verdict and margin, its worst flight, and the flights that do not meet it."""
    over = plan.over[requirement.id]
    of_sweep = isinstance(requirement.bar, OfSweep)
    if isinstance(requirement.bar, OfSweep):
        judged = [one for name in over for one in _of_sweep(plan, requirement.bar, name, rows)]
    else:
        judged = [(row["flight"], one) for row in rows for one in row["found"].get(requirement.id, ())]
    verdicts: dict[str, str] = {}
    for flight, one in judged:
        verdicts[flight] = _worst_of([verdicts.get(flight, MET), one["verdict"]])
    flight, least = min(judged, key=lambda one: _rank(one[1]), default=("", part("", None, None, NOT_SHOWN)))
    return {
        "id": requirement.id,
        "text": requirement.text,
        "clause": requirement.clause,
        "asked": requirement.model_dump(mode="json", include={"expect", "formula", "bar"}, exclude_none=True),
        "verdict": _worst_of(verdicts.values()),
        "margin": least["margin"],
        "margin_of": least["name"],
        "worst": {"flight": flight, "command": command(plan, flight) if flight else None, **least},
        "over": [plan.sources[name].given for name in over],
        "flights": sum(row["source"] in over for row in rows),
        "counts": {} if of_sweep else _counts(verdicts.values()),
        "failing": [
            {"flight": name, "verdict": verdict, "command": command(plan, name)}
            for name, verdict in verdicts.items() if verdict != MET
        ][:MOST_NAMED],
    }  # fmt: skip


def _counts(verdicts: Iterable[str]) -> dict[str, int]:
    """How often each verdict is among these."""
    return dict.fromkeys((MET, NOT_MET, NOT_SHOWN), 0) | Counter(verdicts)


def _worst_of(verdicts: Iterable[str]) -> str:
    """The worst of these verdicts; not shown, of none."""
    return min(verdicts, key=WORST_FIRST.index, default=NOT_SHOWN)


def _rank(one: Row) -> tuple[int, float]:
    """The worst first: by verdict, then by margin over the limit's size."""
    order = WORST_FIRST.index(one["verdict"])
    if one["margin"] is None:
        return order, -inf if one["verdict"] == NOT_MET else inf
    return order, one["margin"] / _size(one["expected"])


def _size(expected: Any) -> float:
    """The size of the limit by which a margin is divided; 1 if there is none."""
    if isinstance(expected, dict):
        expected = next((abs(expected[side]) for side in ("at_least", "at_most") if expected.get(side)), 1.0)
    number = isinstance(expected, int | float) and not isinstance(expected, bool)
    return abs(float(expected)) or 1.0 if number else 1.0


def _of_sweep(plan: EvidencePlan, bar: OfSweep, name: str, rows: Sequence[Row]) -> list[Judged]:
    """The statistics of a sweep, compared with a bar. One is not shown if no flight gives it, or if, with a
    confidence, its estimate keeps the limit and the bound of the estimate does not."""
    from beaver_ftc.studies.sweep import schema_of, table_of, write_tables

    source = plan.sources[name]
    sweep = source.what
    assert isinstance(sweep, Sweep)
    schema = schema_of(sweep)
    table = table_of(sweep, schema, [row["row"] for row in rows if row["source"] == name])
    file = io.BytesIO()
    write_tables(file, [table], schema)
    flights = Flights(file, sweep)
    found = evaluate(_levels(bar), flights)
    plain = evaluate(_levels(bar, "confidence"), flights)
    return [
        (source.flight(_worst(flights, one["name"])), _of_bound(one, other))
        for one, other in zip(found, plain, strict=True)
    ]


def _worst(flights: Flights, name: str) -> int:
    """Number of the flight with the worst contribution to a statistic, such as `tracking_ratio.p`.

    bad (flights,): a number for each flight, the larger the worse; a flag counts 1.
    """
    quantity, _, axis = name.partition(".")
    against: dict[str, Callable[[], np.ndarray]] = {
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
        bad = against[quantity]().astype(float)
    bad = np.nan_to_num(bad, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
    return int(flights["run"][np.argmax(bad)])


def _levels(bar: OfSweep, but: str = "type") -> SweepExpect:
    """The conditions of a bar, without the key `but` at any level."""

    def less(said: Any) -> Any:
        """The same without the keys, at any level."""
        if not isinstance(said, dict):
            return said
        return {key: less(value) for key, value in said.items() if key not in ("type", but)}

    return SweepExpect.model_validate(less(bar.model_dump(exclude_none=True)))


def _of_bound(found: Document, plain: Document) -> Row:
    """A statistic as a part. plain: the same without the confidence that the bar asks for."""
    verdict = MET
    says = f"{found['of']} flights tell"
    if not found["passed"]:
        verdict = NOT_SHOWN if not found["of"] or plain["passed"] else NOT_MET
    expected = found["expected"]
    actual = found["actual"]
    inside = None
    if actual is not None:
        inside = actual - expected["at_least"] if "at_least" in expected else expected["at_most"] - actual
    return part(found["name"], expected, actual, verdict, inside, says)


def _coverage(aircraft: Aircraft, rows: Sequence[Row]) -> Document:
    """For one aircraft: the number of flights with each fault on each surface, by cell of the envelope."""
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
