"""From rows to numbers with confidence limits, and to text."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial_upper, poisson_bound, quantile
from beaver_ftc.studies.present.tables import finite, number
from beaver_ftc.studies.verify.fly import SCHEMES, SHARPENED, STEPS, Row

PROMISES = ("false_alarms", "true_fault_exclusions", "wrong_isolations", "late_detections")


def summarise(rows: dict[str, list[Row]]) -> dict[str, Any]:
    """The document of a campaign; `kept`: whether every promise of the sharpened scheme, the default, held.

    The published one is there for comparison: its isolation threshold presumes a constant parameter.
    """
    healthy = [row for row in rows["healthy"] if "skipped" not in row]
    faulty = [row for row in rows["faulty"] if "skipped" not in row]
    document: dict[str, Any] = {
        "healthy": _healthy(healthy),
        "faults": len(faulty),
        "skipped": len(rows["healthy"]) + len(rows["faulty"]) - len(healthy) - len(faulty),
        "schemes": {
            scheme: _scheme([row[scheme] for row in faulty])
            for scheme in STEPS
            if faulty and scheme in faulty[0]
        },
    }
    if faulty:
        document["delay_shorter_by"] = _shorter(document["schemes"])
    document["kept"] = document["healthy"]["false_alarms"] == 0 and all(
        document["schemes"][SHARPENED][promise] == 0 for promise in PROMISES if faulty
    )
    return document


def _healthy(rows: Sequence[Row]) -> dict[str, Any]:
    hours = sum(row["watched_s"] for row in rows) / 3600.0
    alarms = sum(row["alarm"] for row in rows)
    closest = np.max([row["closest"] for row in rows], axis=0).tolist() if rows else []
    return {
        "flights": len(rows),
        "hours": hours,
        "false_alarms": alarms,
        "false_alarms_per_hour": alarms / hours if hours else None,
        "false_alarms_per_hour_upper_95": poisson_bound(alarms, hours, CONFIDENCE, upper=True)
        if hours
        else None,
        "departures": sum(row["departed"] for row in rows),
        "hours_outside_envelope": sum(row["outside_s"] for row in rows) / 3600.0,
        "closest_approach": dict(zip(SCHEMES, closest, strict=False)) if len(rows) else {},
    }


def _scheme(rows: Sequence[Row]) -> dict[str, Any]:
    n = len(rows)
    counts = {
        "false_alarms": sum(row["false_alarm"] for row in rows),
        "true_fault_exclusions": sum(row["excluded"] for row in rows),
        "wrong_isolations": sum(row["wrong"] for row in rows),
        "late_detections": sum(row["late"] for row in rows),
    }
    certain = [row for row in rows if row["guaranteed_s"] is not None]
    ratios = [row["delay_s"] / row["guaranteed_s"] for row in certain if row["delay_s"]]
    return {
        **counts,
        **{f"{name}_probability_upper_95": binomial_upper(count, n) for name, count in counts.items()},
        "detected": sum(row["delay_s"] is not None for row in rows),
        "isolated": sum(row["isolation_s"] is not None for row in rows),
        "detection_certain": len(certain),
        "delay_s": _quantiles(row["delay_s"] for row in rows),
        "isolation_delay_s": _quantiles(row["isolation_s"] for row in rows),
        "delay_over_guaranteed": _quantiles(ratios),
        "estimate_error": _quantiles(
            row["estimate_error"] for row in rows if row["estimate_error"] is not None
        ),
    }


def _quantiles(values: Iterable[float | None]) -> dict[str, float | None]:
    """Median and 90th percentile, what never came counting as infinitely late; None stands for infinite."""
    numbers = np.sort([np.inf if value is None else value for value in values])
    return {name: finite(quantile(numbers, share)) for name, share in (("median", 0.5), ("p90", 0.9))}


def _shorter(schemes: dict[str, Any]) -> float | None:
    """By what share the sharpened scheme's median delay is shorter than the published one's."""
    published, sharpened = (schemes[name]["delay_s"]["median"] for name in SCHEMES)
    return 1.0 - sharpened / published if published and sharpened is not None else None


def summary_text(document: dict[str, Any]) -> str:
    """The document for people."""
    lines = [*_healthy_lines(document["healthy"]), *_fault_lines(document)]
    if document["skipped"]:
        lines.append(f"{document['skipped']} flights drawn could not be trimmed and are not counted")
    lines.append("every promise of the sharpened scheme kept" if document["kept"] else "A PROMISE IS BROKEN")
    return "\n".join(lines)


def _healthy_lines(healthy: dict[str, Any]) -> list[str]:
    if not healthy["flights"]:
        return []
    closest = ", ".join(f"{name} {share:.6f}" for name, share in healthy["closest_approach"].items())
    outside = f"{healthy['hours_outside_envelope']:.2f} h outside the validated envelope"
    rate = f"at most {healthy['false_alarms_per_hour_upper_95']:.2g} per hour, 95 % confidence"
    return [
        f"{healthy['hours']:.2f} flight hours without a fault: {healthy['flights']} flights, {outside}, "
        f"{healthy['departures']} departures",
        f"  false alarms                    {healthy['false_alarms']} ({rate})",
        f"  closest approach to threshold   {closest}",
        "",
    ]


def _fault_lines(document: dict[str, Any]) -> list[str]:
    schemes = document["schemes"]
    if not schemes:
        return []
    lines = [f"{document['faults']} random faults{'':17}" + "".join(f"{name:>18}" for name in schemes)]
    for promise in PROMISES:
        cells = [f"{s[promise]} (p < {s[promise + '_probability_upper_95']:.1e})" for s in schemes.values()]
        lines.append(_line(promise.replace("_", " "), cells))
    for label, key in (
        ("detected", "detected"),
        ("detection certain", "detection_certain"),
        ("isolated", "isolated"),
    ):
        lines.append(_line(label, [str(s[key]) for s in schemes.values()]))
    for label, key in (
        ("detection delay, s", "delay_s"),
        ("isolation delay, s", "isolation_delay_s"),
        ("delay / guaranteed", "delay_over_guaranteed"),
        ("error of the estimate", "estimate_error"),
    ):
        for which in ("median", "p90"):
            lines.append(
                _line(f"{label}, {which}", [number(s[key][which], none="never") for s in schemes.values()])
            )
    if document["delay_shorter_by"] is not None:
        lines += [f"  median detection delay shorter by {document['delay_shorter_by']:.0%}", ""]
    return lines


def _line(label: str, cells: Iterable[str]) -> str:
    return f"  {label:<32}" + "".join(f"{cell:>18}" for cell in cells)
