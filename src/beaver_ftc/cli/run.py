"""`beaver-ftc run`: fly scenarios, write their results and print their verdicts."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import (
    Document,
    Format,
    FormatOption,
    JunitOption,
    NoReportOption,
    ResultsOption,
    ScenariosArgument,
    address,
    complain,
    emit,
    emit_json,
    failure_of,
    load_all,
    progress_bar,
    report,
    write_junit,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plugins import required

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.results.painters import Painters
    from beaver_ftc.scenario.schema import Scenario

    Prepare = Callable[[Plant], None]
    Drawn = tuple[Painters, Sequence[str]]  # the processes that draw the figures, and the formats


FORMATS = ("png", "pdf", "svg")  # of figures
Recording = StrEnum("Recording", ["table", "ulog", "ardupilot"])  # the kinds of `results.recordings`


@dataclass(frozen=True)
class Options:
    """The arguments of `command`."""

    scenarios: ScenariosArgument
    out: ResultsOption = Path("runs")
    format: FormatOption = Format.text
    no_report: NoReportOption = False
    junit: JunitOption = None
    csv: bool = False
    acmi: bool = False
    recording: Annotated[Recording | None, typer.Option("--as")] = None
    flightgear: Annotated[str | None, typer.Option(metavar="HOST:PORT")] = None
    certificate: bool = False
    figures: Annotated[str, typer.Option(metavar="FORMATS")] = "png"


def command(options: Options) -> None:
    """Simulate scenarios and report the results.

    With --format json the command prints one JSON object. For one scenario it contains the metrics, `folder`
    (or `error`) and a list `runs`. For several scenarios it is {"passed": ..., "runs": [...]}.

    Examples:
      beaver-ftc run elevator-partial-loss
      beaver-ftc run elevator-partial-loss --format json --no-report

    csv: Also write the log as log.csv.
    acmi: Also write the flight path as flight.acmi, for Tacview.
    recording: Also write the log of an on-board recorder in this format, and vehicle.yaml.
    flightgear: Show the flight in real time in FlightGear at this address.
    certificate: Also write certificate.json, the proof of the alarm and of the exclusions.
    figures: Formats of the figures, separated by commas: png, pdf, svg.
    """
    formats = _formats(options.figures)
    from beaver_ftc.results.model import Judged

    try:
        loaded = load_all(options.scenarios)
    except BadInput as error:
        if options.format is Format.json:
            emit_json({"passed": False, "runs": [], "errors": str(error).splitlines()})
        write_junit([Judged("scenarios", error=str(error))], options.junit)
        raise
    if options.no_report:
        raise typer.Exit(_run_all(loaded, options, ((), formats)))
    from beaver_ftc.results.painters import painters

    with painters() as connections:
        status = _run_all(loaded, options, (connections, formats))
    raise typer.Exit(status)


def _formats(text: str) -> tuple[str, ...]:
    """The formats of the figures, each once."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    for name in names:
        if name not in FORMATS:
            raise BadInput(f"--figures: {name!r:.60} is no format, allowed: {', '.join(FORMATS)}")
    return names


def _connection_to_flightgear(host_and_port: str | None) -> "Prepare | None":
    """The function that connects a plant to the FlightGear at this address; None without an address."""
    import socket

    if host_and_port is None:
        return None
    host, port = address("--flightgear", host_and_port)
    try:
        socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError):
        raise BadInput(f"--flightgear: there is no host {host!r}") from None
    return partial(required("flightgear", "--flightgear"), host=host, port=port)


def _run_all(scenarios: list["Scenario"], options: Options, drawn: "Drawn") -> int:
    """Fly the scenarios one after the other, also after one that fails. Returns the largest exit status."""
    from beaver_ftc.results.model import Judged, Metrics
    from beaver_ftc.results.verdict import verdict_text

    prepare = _connection_to_flightgear(options.flightgear)
    runs, judged, status = [], [], 0
    for scenario in scenarios:
        began = time.perf_counter()
        try:
            document = _run_one(scenario, options, prepare, drawn)
        except Exception as error:
            failure = failure_of(error)
            took_s = time.perf_counter() - began
            status = max(status, report(failure))
            runs.append({"scenario": scenario.name, "error": str(failure)})
            judged.append(Judged(scenario.name, error=str(failure), took_s=took_s))
            continue
        took_s = time.perf_counter() - began
        metrics = Metrics.of(document)
        runs.append(document)
        judged.append(replace(metrics.judged, took_s=took_s))
        status = max(status, 0 if metrics.passed else 1)
        if options.format is Format.text:
            emit(verdict_text(metrics, document["folder"], colour=sys.stdout.isatty()))
    write_junit(judged, options.junit)
    if options.format is Format.json:
        first = runs[0] if len(runs) == 1 else {}
        emit_json(first | {"passed": status == 0, "runs": runs})
    return status


def _run_one(scenario: "Scenario", options: Options, prepare: "Prepare | None", drawn: "Drawn") -> Document:
    """Fly a scenario and write its result folder. Returns the metrics, with `folder` and the counts of the
    certificate."""
    from beaver_ftc.results.writer import run

    for warning in scenario.warnings():
        complain(f"{scenario.name}: warning: {warning}")
    exports = [name for name, wanted in (("csv", options.csv), ("acmi", options.acmi)) if wanted]
    recording = options.recording.value if options.recording else None
    with progress_bar(scenario.name) as progress:
        certified = options.certificate
        document = run(
            scenario, options.out, not options.no_report, progress, exports, prepare, recording, certified,
            *drawn,
        )  # fmt: skip
    folder = options.out / scenario.name
    return document | {"folder": str(folder)} | (_certificate(folder) if certified else {})


def _certificate(folder: Path) -> Document:
    """The numbers of statements, and of decisions without one, in the certificate of a result folder."""
    import json

    from beaver_ftc.results.writer import CERTIFICATE_FILE

    written = json.loads((folder / CERTIFICATE_FILE).read_text(encoding="utf-8"))
    return {"certificate": {name: len(written[name]) for name in ("statements", "without")}}
