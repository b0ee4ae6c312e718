"""A flight beside its reference: each column, the alarm, and the names."""

from typing import Any

import numpy as np

import beaver_ftc as bf
from reference.diagnosis import Result, diagnose
from reference.flights import declared, read
from reference.naming import Withdrawn

RTOL, ATOL = 1e-9, 1e-12
OF_SUMS = 1e-6  # of what is a sum over a flight, and a share of it


def differences(document: dict[str, Any]) -> list[str]:
    """Where log and metrics of a scenario's flight differ from the reference; a line each."""
    flight = bf.fly(document)
    declaration = declared(document)
    reference = diagnose(declaration, read(document, flight.log, declaration))
    log = flight.log.iloc[: len(reference.columns["p_design_rad_s2"])]
    log.attrs = {}  # which pandas would copy for each column
    found = [line for name in reference.columns if (line := _column(name, log, reference, document))]
    return [*found, *_verdict(flight.metrics, reference, document)]


def _column(name: str, log: Any, reference: Result, document: dict[str, Any]) -> str:
    ours, theirs = reference.columns[name][1:], log[name].to_numpy()[1:]
    compared = _judged(name, reference, document)[1:]
    tie = "alarm" in name and np.isclose(*_nearest(name, log, reference), rtol=RTOL, atol=ATOL)[1:]
    sums = "likelihood" in name or name.endswith("estimate")
    rtol, atol = (OF_SUMS, OF_SUMS) if sums else (RTOL, ATOL)
    close = np.isclose(ours, theirs, rtol=rtol, atol=atol, equal_nan=True) | ~compared | tie
    if close.all():
        return ""
    k = int(np.flatnonzero(~close)[0])
    return f"{name}: {(~close).sum()} rows, first {k + 1}: page {ours[k]!r}, log {theirs[k]!r}"


def _nearest(name: str, log: Any, reference: Result) -> tuple[np.ndarray, np.ndarray]:
    """The largest ratio of residual to threshold: two filters that tie are both the nearest."""
    columns = [f"{name[0]}_alarm_{what}_rad_s" for what in ("residual", "threshold")]
    with np.errstate(divide="ignore", invalid="ignore"):
        ours, theirs = (np.abs(of[columns[0]]) / of[columns[1]] for of in (reference.columns, log))
    return ours, theirs.to_numpy()


def _judged(name: str, reference: Result, document: dict[str, Any]) -> np.ndarray:
    """The rows in which a column is compared.

    After the exclusion of a hypothesis with a constant parameter its set is no statement any more, and with
    it the estimate. The detection estimator after the alarm, and the estimates, follow the law if the class
    has faults of all types. A law that makes no use of a name logs no effectiveness.
    """
    fdi, rows = document["fdi"], np.arange(len(reference.columns[name]))
    last = np.inf
    alarm = reference.alarm[0] if reference.alarm else np.inf
    if name.startswith("fie_") and not name.endswith("excluded") and fdi["fault_profile"] == "abrupt":
        out = reference.columns[
            "_".join(name.split("_")[: -(3 if name.endswith("rad_s") else 1) - 1]) + "_excluded"
        ]
        last = np.argmax(out) if out.any() else np.inf
    if fdi["fault_class"] == "all" and (name[1:] == "_residual_rad_s" or name.endswith("estimate")):
        last = alarm
    if document["control"]["law"] == "nominal" and name[1:] == "_residual_rad_s" and reference.names:
        last = min(last, reference.names[0][0])
    return rows <= last


def _verdict(metrics: dict[str, Any], reference: Result, document: dict[str, Any]) -> list[str]:
    dt, detection, isolation = 1.0 / document["rate_hz"], metrics["detection"], metrics["isolation"]
    k, axis = reference.alarm or (None, None)
    pairs = [
        ("detection.time_s", None if k is None else k * dt, detection["time_s"]),
        ("detection.axis", axis, detection["axis"]),
    ]
    of_all_types = document["fdi"]["fault_class"] == "all"
    if not of_all_types or document["fdi"]["fault_profile"] == "any":
        at, name = reference.names[-1] if reference.names else (0, None)
        said = isolation["faults"] or [isolation] if reference.alarm else []
        pairs += [
            ("isolation.fault", name, isolation["fault"]),
            ("isolation.time_s", at * dt if name else None, isolation["time_s"]),
            (
                "isolation.faults",
                [(one.name, one.kind, one.candidates) for one in reference.findings],
                [(one["fault"], one["type"], list(one["candidates"])) for one in said],
            ),
        ]
        if of_all_types:
            gone = isolation["withdrawn"], isolation.get("types_withdrawn") or ()
            pairs.append(("withdrawn", reference.withdrawn, tuple(_frames(listed, dt) for listed in gone)))
    return [
        f"{what}: page {ours!r}, metrics {theirs!r}"
        for what, ours, theirs in pairs
        if not _same(ours, theirs)
    ]


def _same(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, float) and isinstance(theirs, float):
        return abs(ours - theirs) < 1e-6
    return bool(ours == theirs)


def _frames(withdrawn: Any, dt: float) -> list[Withdrawn]:
    return [
        (one["fault"], one.get("type"), round(one["from_s"] / dt), round(one["to_s"] / dt))
        for one in withdrawn
    ]
