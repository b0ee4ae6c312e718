"""The promises of the theory, counted on random flights inside everything the diagnosis declares."""

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
from beaver_ftc.results.metrics import Truth, as_json, fault_free_s, is_late
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.scenario.signals import grown_share
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial, poisson_bound, share_within
from beaver_ftc.studies.engine.study import Study, run_study
from beaver_ftc.studies.present.page import Makers
from beaver_ftc.studies.present.tables import finite, number_or_never
from beaver_ftc.studies.random_flights import HEALTHY_S, KINDS, Draw

ONE_SIDED = 2.0 * CONFIDENCE - 1.0  # the two-sided confidence whose upper limit has CONFIDENCE
PUBLISHED, SHARPENED = "published", "sharpened"
_CONSTANT_ONLY = "constant"  # for faults that are: one that grows is outside what this step declares
_OFF = {"pole_bank": False, "memory": False, "shared_effectiveness": False}
SCHEMES: dict[str, Document] = {PUBLISHED: {"thresholds": "published"}, SHARPENED: {}}
# From the published scheme to the default, and on to what takes a declaration, one step after the other.
STEPS: dict[str, Document] = {
    PUBLISHED: SCHEMES[PUBLISHED],
    "interval": {"sharpen": _OFF},
    "pole bank": {"sharpen": {**_OFF, "pole_bank": True}},
    "memory": {"sharpen": {"shared_effectiveness": False}},
    SHARPENED: SCHEMES[SHARPENED],
    _CONSTANT_ONLY: {"fault_profile": "abrupt"},
}
NAME = "verification"
TOGETHER = 50  # flights that are kept together

Row = Document
Schemes = dict[str, Document]


def fly_draw(draw: Draw, schemes: Schemes) -> Row:
    """The row of a flight. A fault is flown once with each scheme, in all else the same flight."""
    try:
        return _faulty(draw, schemes) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim: said, not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The row of a flight without a fault: one for both schemes, as the first filter of the sharpened scheme
    is the published one."""
    flight = fly(draw.scenario())
    return {
        "index": draw.index,
        "watched_s": fault_free_s(flight),
        "alarm": flight.detection_time_s is not None,
        "departed": flight.departure is not None,
        "outside_s": flight.outside_s,
        "closest": list(flight.closest_approach),
    }


def _faulty(draw: Draw, schemes: Schemes) -> Row:
    row: Row = {"index": draw.index}
    for scheme, fdi in schemes.items():
        scenario = draw.scenario(fdi)
        abrupt = scenario.faults[0].profile == "abrupt"
        row[scheme] = judge(fly(scenario)) if abrupt or scheme != _CONSTANT_ONLY else row[SHARPENED]
    frame = {"rate_hz": scenario.rate_hz, "substeps": scenario.substeps}
    return row | frame | scenario.faults[0].model_dump(exclude_none=True)


def judge(flight: Landing) -> Row:
    """The outcome of each promise in a flight with one fault; delays in s from the first frame with it."""
    truth = Truth.of(flight.scenario)
    guaranteed_s = flight.guaranteed_delay_s
    alarm_s = flight.detection_time_s
    delay_s = truth.onset.delay_s(alarm_s)
    left = (*flight.candidates, flight.isolated)
    meant = truth.faults_named_rightly_by(flight.isolated, flight.isolation_time_s)
    return {
        "delay_s": delay_s,
        "false_alarm": alarm_s is not None and truth.onset.is_false(alarm_s),
        "guaranteed_s": guaranteed_s,
        "late": guaranteed_s is not None
        and (delay_s is None or is_late(delay_s, guaranteed_s, 1.0 / flight.scenario.rate_hz)),
        "isolation_s": truth.onset.delay_s(flight.isolation_time_s),
        "excluded": alarm_s is not None and not any(truth.faults[0].is_named_by(name) for name in left),
        "wrong": flight.isolated is not None and not meant,
        "estimate_error": _estimate_error(flight) if meant else None,
    }


def _estimate_error(flight: Landing) -> float | None:
    """Distance of the estimated parameter from the true one at the end of the flight."""
    fault = flight.scenario.faults[0]
    if flight.estimate is None or not isinstance(fault, LossOfEffectiveness):
        return None
    grown = grown_share(fault, flight.frames / flight.scenario.rate_hz)
    return abs(flight.estimate + fault.magnitude * grown)


class Promise(NamedTuple):
    """The guarantee that a promise follows from, as docs/explanation numbers them; the key of the row of a
    scheme that is true if the promise is broken."""

    guarantee: str
    broken: str


PROMISES = {  # by what is counted
    "false_alarms": Promise("G1", "false_alarm"),
    "true_fault_exclusions": Promise("G2", "excluded"),
    "wrong_isolations": Promise("G2", "wrong"),
    "late_detections": Promise("G3", "late"),
}
_SPREADS = {
    "detection delay, s": "delay_s", "isolation delay, s": "isolation_delay_s",
    "delay / guaranteed": "delay_over_guaranteed", "error of the estimate": "estimate_error",
}  # fmt: skip


def summarise(rows: dict[str, list[Row]]) -> Document:
    """The document of all flights; `kept`: whether every promise of the sharpened scheme, the default, held.

    The published one is there for comparison: its isolation threshold presumes a constant parameter.
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
    document["kept"] = not document["healthy"]["false_alarms"] and not any(
        document["schemes"][SHARPENED][promise] for promise in PROMISES if faulty
    )
    return document


def _healthy_document(rows: Sequence[Row]) -> Document:
    hours = sum(row["watched_s"] for row in rows) / 3600.0
    alarms = sum(row["alarm"] for row in rows)
    closest = map(max, zip(*(row["closest"] for row in rows), strict=True))
    return {
        "flights": len(rows),
        "hours": hours,
        "false_alarms": alarms,
        "false_alarms_per_hour": alarms / hours if hours else None,
        "false_alarms_per_hour_upper_95": finite(poisson_bound(alarms, hours, CONFIDENCE, upper=True)),
        "departures": sum(row["departed"] for row in rows),
        "hours_outside_envelope": sum(row["outside_s"] for row in rows) / 3600.0,
        "closest_approach": dict(zip(SCHEMES, closest, strict=False)),
    }


def _scheme(rows: Sequence[Row]) -> Document:
    n = len(rows)
    counts = {promise: sum(row[of.broken] for row in rows) for promise, of in PROMISES.items()}
    certain = [row for row in rows if row["guaranteed_s"] is not None]
    ratios = [row["delay_s"] / row["guaranteed_s"] for row in certain if row["delay_s"]]
    errors = [row["estimate_error"] for row in rows if row["estimate_error"] is not None]
    return {
        **counts,
        **{
            f"{name}_probability_upper_95": binomial(count, n, ONE_SIDED).high
            for name, count in counts.items()
        },
        "detected": sum(row["delay_s"] is not None for row in rows),
        "isolated": sum(row["isolation_s"] is not None for row in rows),
        "detection_certain": len(certain),
        "delay_s": _quantiles(row["delay_s"] for row in rows),
        "isolation_delay_s": _quantiles(row["isolation_s"] for row in rows),
        "delay_over_guaranteed": _quantiles(ratios),
        "estimate_error": _quantiles(errors),
    }


def _quantiles(values: Iterable[float | None]) -> dict[str, float | None]:
    """Median and 90th percentile, what never came counting as infinitely late; None stands for infinite."""
    found = list(values)
    return {name: finite(share_within(found, share)) for name, share in (("median", 0.5), ("p90", 0.9))}


def _shorter(schemes: Document) -> float | None:
    """The share by which the sharpened scheme's median delay is shorter than the published one's."""
    published, sharpened = (schemes[name]["delay_s"]["median"] for name in SCHEMES)
    return 1.0 - sharpened / published if published and sharpened is not None else None


def summary_text(document: Document) -> str:
    """The document in words."""
    lines = [*_healthy_lines(document["healthy"]), *_fault_lines(document)]
    if document["skipped"]:
        lines.append(f"{document['skipped']} flights drawn could not be trimmed and are not counted")
    flown = bool(document["healthy"]["flights"]), bool(document["schemes"])
    held = {(True, True): "G1 to G3 hold", (True, False): "G1 holds", (False, True): "G2 and G3 hold"}.get(
        flown, "Nothing is tested"
    )
    lines.append(f"{held} for the sharpened scheme" if document["kept"] else "A GUARANTEE IS VIOLATED")
    return "\n".join(lines)


def _healthy_lines(healthy: Document) -> list[str]:
    if not healthy["flights"]:
        return []
    closest = ", ".join(f"{name} {share:.6f}" for name, share in healthy["closest_approach"].items())
    says = (
        "{hours:.2f} flight hours without a fault: {flights} flights, {hours_outside_envelope:.2f} h outside "
        "the validated envelope, {departures} departures",
        "  G1 false alarms                 {false_alarms} (at most {false_alarms_per_hour_upper_95:.2g} per "
        "hour, 95 % confidence)",
    )
    lines = [line.format(**healthy) for line in says]
    return [*lines, f"  closest approach to threshold   {closest}", ""]


def _fault_lines(document: Document) -> list[str]:
    schemes = document["schemes"]
    if not schemes:
        return []
    lines = [f"{document['faults']} random faults{'':17}" + "".join(f"{name:>18}" for name in schemes)]
    for promise, of in PROMISES.items():
        cells = [f"{s[promise]} (p < {s[promise + '_probability_upper_95']:.1e})" for s in schemes.values()]
        lines.append(_line(f"{of.guarantee} {promise.replace('_', ' ')}", cells))
    for key in ("detected", "detection_certain", "isolated"):
        lines.append(_line(key.replace("_", " "), (str(s[key]) for s in schemes.values())))
    for (label, key), which in product(_SPREADS.items(), ("median", "p90")):
        lines.append(_line(f"{label}, {which}", (number_or_never(s[key][which]) for s in schemes.values())))
    if document["delay_shorter_by"] is not None:
        lines += [f"  median detection delay shorter by {document['delay_shorter_by']:.0%}", ""]
    return lines


def _line(label: str, cells: Iterable[str]) -> str:
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
        wanted = {"healthy": ceil(self.hours * 3600.0 / HEALTHY_S), "faulty": self.faults}
        draws = [Draw(self.seed, kind, i) for kind in KINDS for i in range(wanted[kind])]
        if not draws:
            raise BadInput("verify: nothing to fly, allowed: --hours or --faults above 0")
        schemes = STEPS if self.steps else SCHEMES

        def document(rows: list[Row]) -> Document:
            healthy = wanted["healthy"]
            return {"seed": self.seed, **summarise({"healthy": rows[:healthy], "faulty": rows[healthy:]})}

        flying = partial(fly_draw, schemes=schemes)
        study = Study(NAME, draws, flying, document, FILES, follows_from=schemes, part=TOGETHER)
        return run_study(study, self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """The counts, and whether every promise was kept."""
        return summary_text(document)

    def passed(self, document: Document) -> bool:
        """Whether every promise of the default scheme was kept."""
        return bool(document["kept"])
