"""The command `verify`: violations of the guarantees (guarantees.py) in many random flights."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import ceil
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from beaver_ftc.commands import Reporter, SeedOption, StudyCommand, WorkersOption
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.results.metrics import as_json
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial, poisson_bound, share_within
from beaver_ftc.studies.engine.study import Study, run_study
from beaver_ftc.studies.guarantees import SCHEMES, SHARPENED, STEPS, Row, fly_draw
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import finite, known_values, number_or_never, sum_of, values_of
from beaver_ftc.studies.random_flights import HEALTHY_S, KINDS, Draw

ONE_SIDED = 2.0 * CONFIDENCE - 1.0  # confidence of a two-sided interval whose upper limit has CONFIDENCE
NAME = "verification"
TOGETHER = 50  # flights in a file of the study


class Promise(NamedTuple):
    """A kind of violation. guarantee: G1, G2 or G3. broken: key of an outcome that is true if this guarantee
    is violated."""

    guarantee: str
    broken: str


PROMISES = {  # by name of the count
    "false_alarms": Promise("G1", "false_alarm"),
    "true_fault_exclusions": Promise("G2", "excluded"),
    "wrong_isolations": Promise("G2", "wrong"),
    "late_detections": Promise("G3", "late"),
}
_SPREADS = {  # label and key of the numbers with quantiles
    "detection delay, s": "delay_s", "isolation delay, s": "isolation_delay_s",
    "delay / guaranteed": "delay_over_guaranteed", "error of the estimate": "estimate_error",
}  # fmt: skip


def summarise(rows: dict[str, list[Row]]) -> Document:
    """The document of all flights. rows: by kind; those with `skipped` are only counted. kept: whether the
    sharpened scheme, the default, kept all guarantees.

    The published scheme is flown for comparison: its isolation threshold assumes a constant fault.
    """
    healthy, faulty = ([row for row in rows[kind] if "skipped" not in row] for kind in KINDS)
    schemes = [scheme for scheme in STEPS if faulty and scheme in faulty[0]]
    document: Document = {
        "healthy": _healthy_document(healthy),
        "faults": len(faulty),
        "skipped": sum(map(len, rows.values())) - len(healthy) - len(faulty),
        "schemes": {scheme: _scheme(values_of(faulty, scheme)) for scheme in schemes},
    }
    if faulty:
        document["delay_shorter_by"] = _shorter(document["schemes"])
    violations = document["schemes"].get(SHARPENED, {})  # empty without faulty flights
    document["kept"] = not document["healthy"]["false_alarms"] and not any(map(violations.get, PROMISES))
    return document


def _healthy_document(rows: Sequence[Row]) -> Document:
    """False alarms and flight hours of the healthy flights."""
    hours = sum_of(rows, "watched_s") / 3600.0
    alarms = sum_of(rows, "alarm")
    return {
        "flights": len(rows),
        "hours": hours,
        "false_alarms": alarms,
        "false_alarms_per_hour": alarms / hours if hours else None,
        "false_alarms_per_hour_upper_95": finite(poisson_bound(alarms, hours, CONFIDENCE, upper=True)),
        "departures": sum_of(rows, "departed"),
        "hours_outside_envelope": sum_of(rows, "outside_s") / 3600.0,
        "closest_approach": {
            scheme: max(row["closest"][scheme] for row in rows) for scheme in SCHEMES if rows
        },
    }


def _scheme(rows: Sequence[Row]) -> Document:
    """Violations, detections, delays and errors of one scheme. rows: its outcomes. delay_over_guaranteed: of
    the detected faults alone, without a delay of 0 s."""
    n = len(rows)
    counts = {promise: sum_of(rows, kind.broken) for promise, kind in PROMISES.items()}
    detected = [row for row in rows if row["delay_s"] is not None]
    ratios = [row["delay_s"] / row["guaranteed_s"] for row in detected if row["guaranteed_s"]]
    return {
        **counts,
        **{
            f"{name}_probability_upper_95": binomial(count, n, ONE_SIDED).high
            for name, count in counts.items()
        },
        "detected": len(detected),
        "isolated": len(known_values(rows, "isolation_delay_s")),
        "detection_certain": len(known_values(rows, "guaranteed_s")),
        "delay_s": _quantiles(values_of(rows, "delay_s")),
        "isolation_delay_s": _quantiles(values_of(rows, "isolation_delay_s")),
        "delay_over_guaranteed": _quantiles(ratios),
        "estimate_error": _quantiles(known_values(rows, "estimate_error")),
    }


def _quantiles(values: Sequence[float | None]) -> Document:
    """Median and 90 % quantile. A value None is an event that never came, and infinite; an infinite quantile
    is None."""
    return {name: finite(share_within(values, share)) for name, share in (("median", 0.5), ("p90", 0.9))}


def _shorter(schemes: Document) -> float | None:
    """The share by which the sharpened scheme's median delay is shorter than the published one's; None if one
    is infinite, or the published one is 0 s."""
    published, sharpened = (schemes[name]["delay_s"]["median"] for name in SCHEMES)
    return 1.0 - sharpened / published if published and sharpened is not None else None


def summary_text(document: Document) -> str:
    """The document in words."""
    lines = [*_healthy_lines(document["healthy"]), *_fault_lines(document)]
    if document["skipped"]:
        lines.append(f"{document['skipped']} flights drawn could not be trimmed and are not counted")
    sentence = "G1 holds" if document["healthy"]["flights"] else "Nothing is tested"
    if document["schemes"]:
        sentence = "G1 to G3 hold"
    lines.append(f"{sentence} for the sharpened scheme" if document["kept"] else "A GUARANTEE IS VIOLATED")
    return "\n".join(lines)


def _healthy_lines(healthy: Document) -> list[str]:
    """The lines about healthy flights."""
    if not healthy["flights"]:
        return []
    closest = ", ".join(f"{name} {share:.6f}" for name, share in healthy["closest_approach"].items())
    forms = (
        "{hours:.2f} flight hours without a fault: {flights} flights, {hours_outside_envelope:.2f} h outside "
        "the validated envelope, {departures} departures",
        "  G1 false alarms                 {false_alarms} (at most {false_alarms_per_hour_upper_95:.2g} per "
        "hour, 95 % confidence)",
    )
    lines = [line.format(**healthy) for line in forms]
    return [*lines, f"  closest approach to threshold   {closest}", ""]


def _fault_lines(document: Document) -> list[str]:
    """The lines about faulty flights, a column for each scheme."""
    schemes = document["schemes"]
    if not schemes:
        return []
    lines = [f"{document['faults']} random faults{'':17}" + "".join(f"{name:>18}" for name in schemes)]
    for promise, kind in PROMISES.items():
        cells = [f"{s[promise]} (p < {s[promise + '_probability_upper_95']:.1e})" for s in schemes.values()]
        lines.append(_line(f"{kind.guarantee} {promise.replace('_', ' ')}", cells))
    for key in ("detected", "detection_certain", "isolated"):
        lines.append(_line(key.replace("_", " "), (str(s[key]) for s in schemes.values())))
    for (label, key), quantile in product(_SPREADS.items(), ("median", "p90")):
        lines.append(
            _line(f"{label}, {quantile}", (number_or_never(s[key][quantile]) for s in schemes.values()))
        )
    if document["delay_shorter_by"] is not None:
        lines += [f"  median detection delay shorter by {document['delay_shorter_by']:.0%}", ""]
    return lines


def _line(label: str, cells: Iterable[str]) -> str:
    """A label and its cells in columns."""
    return f"  {label:<32}" + "".join(f"{cell:>18}" for cell in cells)


FILES: Makers = {"verify.json": as_json}


@dataclass(frozen=True)
class Verify(StudyCommand):
    """Test the guarantees on flights within the declared bounds.

    The guarantees hold as long as all errors are within the declared bounds. The command counts violations of
    the guarantees, with exact confidence limits. A violation is a false alarm, an excluded true fault, a
    wrong isolation, or a detection more than one frame later than guaranteed. Two schemes diagnose the same
    flights: the published scheme and the sharpened scheme. The sharpened scheme has the steps of
    `fdi.sharpen`. The exit status is 1 if a guarantee is violated.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc verify --hours 1 --faults 40

    hours: Number of flight hours without a fault.
    faults: Number of flights with one random fault.
    seed: Seed of all random draws.
    out: Folder for the results.
    steps: Also fly the schemes between the published and the sharpened scheme.
    """

    hours: Annotated[float, typer.Option(min=0.0, max=1e6)] = 2.0
    faults: Annotated[int, typer.Option(min=0, max=10_000_000)] = 200
    seed: SeedOption = 1
    workers: WorkersOption = None
    out: Path = Path("runs")
    steps: bool = False

    FILES = FILES
    PLUGINS = False

    def run(self, reporter: Reporter) -> Document:
        """Fly all hours and all faults."""
        n_flights = {"healthy": ceil(self.hours * 3600.0 / HEALTHY_S), "faulty": self.faults}
        draws = [Draw(self.seed, kind, i) for kind in KINDS for i in range(n_flights[kind])]
        if not draws:
            raise BadInput("verify: nothing to fly, allowed: --hours or --faults above 0")
        schemes = STEPS if self.steps else SCHEMES

        def document(rows: list[Row]) -> Document:
            healthy = n_flights["healthy"]
            return {"seed": self.seed, **summarise({"healthy": rows[:healthy], "faulty": rows[healthy:]})}

        fly_one = partial(fly_draw, schemes=schemes)
        study = Study(NAME, draws, fly_one, document, FILES, follows_from=schemes, part=TOGETHER)
        return run_study(study, self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """The counts, and whether the guarantees hold."""
        return summary_text(document)

    def passed(self, document: Document) -> bool:
        """Whether the default scheme kept all guarantees."""
        return bool(document["kept"])
