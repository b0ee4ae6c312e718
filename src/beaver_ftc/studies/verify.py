"""The guarantees of the theory, tested in random flights within all that the diagnosis declares.

    G1    no false alarm
    G2    the true fault is not excluded, and no wrong fault is named
    G3    the alarm comes at most a frame later than guaranteed

A healthy flight tests G1. A faulty flight is flown with each scheme, and tests all three.
"""

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
from beaver_ftc.loop.loop import fly
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.results.judgement import Truth, is_late
from beaver_ftc.results.metrics import as_json, fault_free_s
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.scenario.signals import grown_share
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial, poisson_bound, share_within
from beaver_ftc.studies.engine.study import Study, run_study
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import finite, number_or_never
from beaver_ftc.studies.random_flights import HEALTHY_S, KINDS, Draw

ONE_SIDED = 2.0 * CONFIDENCE - 1.0  # confidence of a two-sided interval whose upper limit has CONFIDENCE
PUBLISHED, SHARPENED = "published", "sharpened"
_CONSTANT_ONLY = "constant"  # this step declares faults of constant size, and is not flown with growing ones
_OFF = {"pole_bank": False, "memory": False, "shared_effectiveness": False}
SCHEMES: dict[str, Document] = {PUBLISHED: {"thresholds": "published"}, SHARPENED: {}}
# The steps from the published scheme to the default one; the last step needs a further declaration.
STEPS: dict[str, Document] = {
    PUBLISHED: SCHEMES[PUBLISHED],
    "interval": {"sharpen": _OFF},
    "pole bank": {"sharpen": {**_OFF, "pole_bank": True}},
    "memory": {"sharpen": {"shared_effectiveness": False}},
    SHARPENED: SCHEMES[SHARPENED],
    _CONSTANT_ONLY: {"fault_profile": "abrupt"},
}
NAME = "verification"
TOGETHER = 50  # flights in a file of the study

Row = Document
Schemes = dict[str, Document]


def fly_draw(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight. A flight with a fault is flown once with each scheme."""
    try:
        return _faulty(draw, schemes) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim is reported, but not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The row of a flight without a fault. One flight tests both schemes, since the first filter of the
    sharpened scheme is that of the published one. closest: largest |residual| / threshold of each scheme."""
    flight = fly(draw.scenario())
    of_filters = flight.closest_approach
    return {
        "index": draw.index,
        "watched_s": fault_free_s(flight),
        "alarm": flight.detection_time_s is not None,
        "departed": flight.departure is not None,
        "outside_s": flight.outside_s,
        "closest": {PUBLISHED: of_filters[0], SHARPENED: max(of_filters)},
    }


def _faulty(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight with a fault: an outcome for each scheme, then the fault. A growing fault has the
    outcome of the sharpened scheme under _CONSTANT_ONLY, so that all steps count the same faults."""
    row: Row = {"index": draw.index}
    for scheme, fdi in schemes.items():
        scenario = draw.scenario(fdi)
        abrupt = scenario.faults[0].profile == "abrupt"
        row[scheme] = judge(fly(scenario)) if abrupt or scheme != _CONSTANT_ONLY else row[SHARPENED]
    frame = {"rate_hz": scenario.rate_hz, "substeps": scenario.substeps}
    return row | frame | scenario.faults[0].model_dump(exclude_none=True)


def judge(flight: Landing) -> Row:
    """The outcome of a flight with one fault. Delays are in s from the first frame with the fault;
    false_alarm, late, excluded, wrong: whether a guarantee is violated."""
    truth = Truth.of(flight.scenario)
    guaranteed_s = flight.guaranteed_delay_s
    alarm_s = flight.detection_time_s
    delay_s = truth.onset.delay_s(alarm_s)
    is_false = alarm_s is not None and truth.onset.is_false(alarm_s)
    not_excluded = (*flight.candidates, flight.isolated)
    rightly_named = truth.faults_named_rightly_by(flight.isolated, flight.isolation_time_s)
    return {
        "delay_s": delay_s,
        "false_alarm": is_false,
        "guaranteed_s": guaranteed_s,
        "late": guaranteed_s is not None
        and not is_false
        and (delay_s is None or is_late(delay_s, guaranteed_s, 1.0 / flight.scenario.rate_hz)),
        "isolation_delay_s": truth.onset.delay_s(flight.isolation_time_s),
        "excluded": alarm_s is not None
        and not any(truth.faults[0].is_named_by(name) for name in not_excluded),
        "wrong": flight.isolated is not None and not rightly_named,
        "estimate_error": _estimate_error(flight) if rightly_named else None,
    }


def _estimate_error(flight: Landing) -> float | None:
    """|theta_estimated - theta| at the end of the flight, theta = -magnitude times the share to which the
    loss has grown; None without an estimate, and for another fault."""
    fault = flight.scenario.faults[0]
    if flight.estimate is None or not isinstance(fault, LossOfEffectiveness):
        return None
    grown = grown_share(fault, flight.frames / flight.scenario.rate_hz)
    return abs(flight.estimate + fault.magnitude * grown)


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
        "skipped": sum("skipped" in row for kind in KINDS for row in rows[kind]),
        "schemes": {scheme: _scheme([row[scheme] for row in faulty]) for scheme in schemes},
    }
    if faulty:
        document["delay_shorter_by"] = _shorter(document["schemes"])
    violations = document["schemes"].get(SHARPENED, {})  # empty without faulty flights
    document["kept"] = not document["healthy"]["false_alarms"] and not any(map(violations.get, PROMISES))
    return document


def _healthy_document(rows: Sequence[Row]) -> Document:
    """False alarms and flight hours of the healthy flights."""
    hours = sum(row["watched_s"] for row in rows) / 3600.0
    alarms = sum(row["alarm"] for row in rows)
    return {
        "flights": len(rows),
        "hours": hours,
        "false_alarms": alarms,
        "false_alarms_per_hour": alarms / hours if hours else None,
        "false_alarms_per_hour_upper_95": finite(poisson_bound(alarms, hours, CONFIDENCE, upper=True)),
        "departures": sum(row["departed"] for row in rows),
        "hours_outside_envelope": sum(row["outside_s"] for row in rows) / 3600.0,
        "closest_approach": {
            scheme: max(row["closest"][scheme] for row in rows) for scheme in SCHEMES if rows
        },
    }


def _scheme(rows: Sequence[Row]) -> Document:
    """Violations, detections, delays and errors of one scheme. rows: its outcomes. delay_over_guaranteed: of
    the detected faults alone, without a delay of 0 s."""
    n = len(rows)
    counts = {promise: sum(row[kind.broken] for row in rows) for promise, kind in PROMISES.items()}
    certain = [row for row in rows if row["guaranteed_s"] is not None]
    timed = [row for row in certain if row["guaranteed_s"] and row["delay_s"] is not None]
    ratios = [row["delay_s"] / row["guaranteed_s"] for row in timed]
    errors = [row["estimate_error"] for row in rows if row["estimate_error"] is not None]
    return {
        **counts,
        **{
            f"{name}_probability_upper_95": binomial(count, n, ONE_SIDED).high
            for name, count in counts.items()
        },
        "detected": sum(row["delay_s"] is not None for row in rows),
        "isolated": sum(row["isolation_delay_s"] is not None for row in rows),
        "detection_certain": len(certain),
        "delay_s": _quantiles(row["delay_s"] for row in rows),
        "isolation_delay_s": _quantiles(row["isolation_delay_s"] for row in rows),
        "delay_over_guaranteed": _quantiles(ratios),
        "estimate_error": _quantiles(errors),
    }


def _quantiles(values: Iterable[float | None]) -> dict[str, float | None]:
    """Median and 90 % quantile. A value None is an event that never came, and infinite; an infinite quantile
    is None."""
    all_values = list(values)
    return {name: finite(share_within(all_values, share)) for name, share in (("median", 0.5), ("p90", 0.9))}


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
