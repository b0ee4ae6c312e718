"""`beaver-ftc identify` and `diagnose`: from recorded flights to a model, and with it to the faults of a
flight."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import Document, Format, FormatOption, answer
from beaver_ftc.commands import declare
from beaver_ftc.documents import BadInput
from beaver_ftc_logs.refusals import refusal

if TYPE_CHECKING:
    from beaver_ftc_logs.log_rows import LogRows
    from beaver_ftc_logs.pages import Words
    from beaver_ftc_logs.samples import Samples

FlightsArgument = Annotated[list[Path], typer.Argument(metavar="FLIGHT", help="Paths of recorded flights.")]
ReaderOption = Annotated[
    str | None,
    typer.Option(help="Format of the log: table, alfa, ulog or ardupilot. Default: found from the file."),
]


def identify(
    flights: FlightsArgument,
    vehicle: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    out: Annotated[Path | None, typer.Option(metavar="MODEL")] = None,
    check: bool = False,
    false_alarms_per_hour: Annotated[float | None, typer.Option(metavar="RATE")] = None,
    reader: ReaderOption = None,
    format: FormatOption = Format.text,
) -> None:
    """Identify a vehicle from recorded flights.

    The command writes a model file for `diagnose`. The fit uses the healthy parts of the flights. The fit
    also uses faulty parts if labels in the log state the effectiveness. The model is validated on data that
    the fit did not use. The model file contains the result of the validation. A page beside this file (MODEL
    with .html) shows it.

    Examples:
      beaver-ftc identify my-logs/healthy.csv --vehicle my-logs/vehicle.yaml --out wing.json

    vehicle: Path of a vehicle file, or the built-in name `alfa`.
    out: Path of the model file; required without --check. With --check: path of the proposed vehicle file.
    Default: the proposal is printed.
    check: Only report the content of the logs, and propose a vehicle file if --vehicle is left out.
    false_alarms_per_hour: False alarms of `diagnose` in one hour of healthy flight. Default: the number
    in the vehicle file.
    """
    if check:
        _check_logs(flights, vehicle, out, reader, format)
        return
    if vehicle is None or out is None:
        option = "--vehicle" if vehicle is None else "--out"
        raise refusal("identify", f"{option} is missing", "--vehicle FILE --out MODEL, or --check")
    from beaver_ftc_logs.identification import identify
    from beaver_ftc_logs.identification_page import refuse_foreign_file, render_identification
    from beaver_ftc_logs.identification_text import identification_text
    from beaver_ftc_logs.loading import load_flights_for_fit
    from beaver_ftc_logs.model import model_file_text
    from beaver_ftc_logs.preparation import scale_if_better
    from beaver_ftc_logs.vehicle import with_alarm_rate
    from beaver_ftc_logs.vehicle_of_logs import load_vehicle_for_logs

    input_paths = {path.resolve() for path in (*flights, Path(vehicle))}
    if not out.name or out.suffix == ".html" or out.resolve() in input_paths:
        allowed = "a name such as wing.json, of no log or vehicle file; the page is wing.html"
        raise BadInput(f"identify: --out {out}: allowed: {allowed}")
    page = out.with_suffix(".html")
    refuse_foreign_file(page)
    loaded, mixing = load_vehicle_for_logs(vehicle, flights, reader)
    if false_alarms_per_hour is not None:
        loaded = with_alarm_rate(loaded, false_alarms_per_hour)
    logs, loaded = scale_if_better(load_flights_for_fit(flights, loaded, reader), loaded)
    model = identify(logs, loaded)
    page_html = render_identification(logs, model)
    _write_file(out, model_file_text(model))
    _write_file(page, page_html)
    document = {
        "model": str(out),
        "page": str(page),
        "mixing": mixing,
        "identified": model.identified,
        "settings": model.settings.model_dump(),
    }
    part_lines = [f"  {samples.name}: {samples.notes[0]}" for samples in logs if samples.n_log_parts > 1]
    answer(
        format,
        document,
        lambda: "\n".join(
            [*mixing, identification_text(model), *part_lines, f"model: {out}", f"page: {page}"]
        ),
    )


def _check_logs(
    flights: list[Path], vehicle: str | None, out: Path | None, reader: str | None, format: Format
) -> None:
    """Report for each log whether it can be used, and print or write the first proposed vehicle file. Exit
    status 2 if a log cannot be used."""
    from beaver_ftc_logs.check import as_text, check_log
    from beaver_ftc_logs.proposal import vehicle_file_text
    from beaver_ftc_logs.vehicle_of_logs import load_vehicle_for_logs

    loaded, mixing = load_vehicle_for_logs(vehicle, flights, reader) if vehicle is not None else (None, [])
    if out is not None and (out.exists() or loaded is not None):
        reason = f"{out} exists, allowed: another name" if out.exists() else "a vehicle file is given already"
        raise BadInput(f"identify: --check --out: {reason}")
    findings = [check_log(path, loaded, reader) for path in flights]
    guess = next((finding["vehicle"] for finding in findings if finding["vehicle"]), None)
    texts = [*mixing, *(as_text(finding) for finding in findings)]
    if guess is not None and out is not None:
        _write_file(out, vehicle_file_text(guess))
        texts.append(f"vehicle file: {out}")
    elif guess is not None:
        texts.append(vehicle_file_text(guess))
    answer(format, {"logs": findings, "vehicle": guess, "mixing": mixing}, lambda: "\n".join(texts))
    if not all(finding["usable"] for finding in findings):
        raise typer.Exit(2)


def _write_file(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    from beaver_ftc.results import clear_disk_errors
    from beaver_ftc.studies.engine import write_whole

    with clear_disk_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode("utf-8"))


@dataclass(frozen=True)
class DiagnoseOptions:
    """The arguments of `diagnose`."""

    flights: FlightsArgument
    model: Annotated[Path | None, typer.Option(metavar="MODEL")] = None
    aircraft: Annotated[str | None, typer.Option(metavar="NAME")] = None
    scenario: Annotated[str | None, typer.Option(metavar="SCENARIO")] = None
    vehicle: Annotated[str | None, typer.Option(metavar="FILE")] = None
    out: Path = Path("diagnoses")
    score: bool = False
    detector: Annotated[str, typer.Option(metavar="NAME")] = "bank-of-filters"
    certificate: bool = False
    reader: ReaderOption = None
    format: FormatOption = Format.text


@declare("diagnosis.parquet", "verdict.json")
def diagnose(options: DiagnoseOptions) -> None:
    """Diagnose recorded flights with a model or an aircraft.

    For each flight the command writes diagnosis.parquet, verdict.json and report.html into a folder of its
    own. The table diagnosis.parquet has one row for each sample. A row uses samples up to its own time, but
    for the exceptions that the tutorial on flight logs names. A log.parquet that `run` wrote needs no model,
    because it is diagnosed with the design model of its scenario.

    Examples:
      beaver-ftc diagnose my-logs/suspect.csv --model wing.json

    model: Model file that `identify` wrote. A log of `run` needs no model file.
    aircraft: Diagnose with the design model of this aircraft instead of an identified model.
    scenario: With --aircraft: scenario whose sections fdi, actuators and design_model declare the errors.
    vehicle: With --aircraft: vehicle file. Default: vehicle.yaml beside the log.
    out: Folder for the results.
    score: After the diagnosis, compare its result with the labels in the log.
    detector: Name of the detector.
    certificate: With --aircraft: also write certificate.json and log.parquet, the proof of the alarm.
    """
    _check_options_agree(options)
    if options.aircraft is not None:
        _diagnose_with_aircraft(options)
        return
    if options.model is None:
        _replay_run_logs(options.flights, options.out, options.format)
        return
    from beaver_ftc_logs.detectors import check_detector_name, diagnose_with_detector
    from beaver_ftc_logs.findings import as_text, verdict_document
    from beaver_ftc_logs.loading import stream_flights
    from beaver_ftc_logs.model import load_model
    from beaver_ftc_logs.pages import words_of_model

    check_detector_name(options.detector)
    model = load_model(options.model)
    verdicts = []
    for samples in stream_flights(options.flights, model.vehicle, options.reader):
        rows = diagnose_with_detector(options.detector, samples, model)
        verdict = verdict_document(samples, model, rows) | {"detector": options.detector}
        verdicts.append(
            _write_diagnosis(options, samples, rows, verdict, model.groups, words_of_model(model))
        )
    answer(options.format, {"flights": verdicts}, lambda: "\n".join(map(as_text, verdicts)))


def _write_diagnosis(
    options: DiagnoseOptions,
    samples: "Samples",
    rows: "LogRows",
    verdict: Document,
    groups: list[list[str]],
    words: "Words",
    extra: Callable[[Path], None] | None = None,
) -> Document:
    """Write table, verdict and page of a flight into a folder. Returns the verdict with its score, if asked
    for, and with the folder. extra: writes further files into this folder."""
    from beaver_ftc_logs.pages import render_diagnosis, write_results
    from beaver_ftc_logs.scoring import score_diagnosis

    if options.score:
        verdict["score"] = score_diagnosis(samples, rows, groups)
    page = render_diagnosis(samples, rows, verdict, words)
    table = rows.table(words.surfaces, with_probability=options.model is not None)
    folder = write_results(options.out, samples.name, table, verdict, page, extra)
    return verdict | {"folder": str(folder)}


def _check_options_agree(options: DiagnoseOptions) -> None:
    """Raise BadInput for options that contradict one another, or that would change nothing.

    option                                 allowed with
    --model                                without --aircraft
    --scenario, --vehicle, --certificate   --aircraft
    --score, --reader                      --model or --aircraft
    --detector                             --model
    """
    by_aircraft = options.aircraft is not None
    by_model = options.model is not None
    names_detector = options.detector != "bank-of-filters"
    if by_aircraft and by_model:
        raise BadInput("diagnose: --model and --aircraft: allowed: one of them")
    if by_aircraft and names_detector:
        reason = f"--detector {options.detector}: allowed: none, fdi.scheme of --scenario names it"
        raise BadInput(f"diagnose: --aircraft with {reason}")
    aircraft = by_aircraft, "--aircraft NAME"
    either = by_aircraft or by_model, "--model MODEL or --aircraft NAME"
    needs = {
        f"--scenario {options.scenario}": (options.scenario is not None, *aircraft),
        f"--vehicle {options.vehicle}": (options.vehicle is not None, *aircraft),
        "--certificate": (options.certificate, *aircraft),
        "--score": (options.score, *either),
        "--detector": (names_detector, *either),
        "--reader": (options.reader is not None, *either),
    }
    for option, (is_given, is_allowed, needed) in needs.items():
        if is_given and not is_allowed:
            raise BadInput(f"diagnose: {option}: allowed: only with {needed}")


def _diagnose_with_aircraft(options: DiagnoseOptions) -> None:
    """Diagnose logs by the model of an aircraft. The vehicle file is that of --vehicle, otherwise
    vehicle.yaml in the folder of the log."""
    from beaver_ftc_logs.by_aircraft import diagnose_aircraft, load_diagnosed
    from beaver_ftc_logs.findings import as_text
    from beaver_ftc_logs.loading import read_vehicle_parts, refuse_equal_names
    from beaver_ftc_logs.pages import words_of_aircraft
    from beaver_ftc_logs.readers import check_exists
    from beaver_ftc_logs.stepped import BOUND_WINDOW_S
    from beaver_ftc_logs.vehicle_of_logs import load_vehicle_for_logs

    if options.certificate:
        from beaver_ftc_logs import certified

    refuse_equal_names(path.stem for path in options.flights)
    diagnosed = aircraft, _ = load_diagnosed(str(options.aircraft), options.scenario)
    words = words_of_aircraft(aircraft, BOUND_WINDOW_S)
    groups = [[name] for name in words.surfaces]
    verdicts: list[Document] = []
    texts: list[str] = []
    for path in options.flights:
        check_exists(path)
        beside = Path(os.path.abspath(path)).parent / "vehicle.yaml"
        if options.vehicle is None and not beside.is_file():
            raise refusal(path, "no vehicle.yaml beside it", "--vehicle FILE")
        loaded, mixing = load_vehicle_for_logs(options.vehicle or str(beside), [path], options.reader)
        texts += mixing
        for log in read_vehicle_parts(path, loaded, options.reader):
            inputs, rows, verdict = diagnose_aircraft(log, loaded, diagnosed)
            writer = None
            if options.certificate:
                writer = partial(certified.write_certificate_and_log, inputs, rows)
            verdict = _write_diagnosis(options, inputs.samples, rows, verdict, groups, words, writer)
            verdicts.append(verdict)
            texts.append(as_text(verdict))
    answer(options.format, {"flights": verdicts}, lambda: "\n".join(texts))


def _replay_run_logs(flights: list[Path], out: Path, format: Format) -> None:
    """Replay logs of `beaver-ftc run`, each with its scenario.yaml in the same folder."""
    from beaver_ftc_logs.loading import refuse_equal_names
    from beaver_ftc_logs.pages import write_results
    from beaver_ftc_logs.replay import as_text, is_log_of_run, replay_run_log

    foreign = [path for path in flights if not is_log_of_run(path)]
    if foreign:
        reason = "--model is missing, allowed without one: log.parquet beside its scenario.yaml"
        raise BadInput(f"diagnose: {foreign[0]}: {reason}")
    replays = [replay_run_log(path) for path in flights]
    refuse_equal_names(verdict["flight"] for _, verdict in replays)
    verdicts = [
        verdict | {"folder": str(write_results(out, verdict["flight"], columns, verdict))}
        for columns, verdict in replays
    ]
    answer(format, {"flights": verdicts}, lambda: "\n".join(map(as_text, verdicts)))


def compare_recorded(folder: Path, out: Path, format: Format, markdown_page: Path | None) -> None:
    """Compare the methods of diagnosis on the recorded flights in a folder. markdown_page: page to update;
    its picture in the folder `images` beside it is replaced, too."""
    from beaver_ftc.results import result_folder
    from beaver_ftc.studies.present import write_files
    from beaver_ftc_logs.recorded.benchmark import run_benchmark
    from beaver_ftc_logs.recorded.comparison import as_text, result_files, update_page

    document = run_benchmark(folder)
    with result_folder(out, "recorded-flights") as result_dir:
        write_files(result_dir, result_files(document))
    if markdown_page is not None:
        update_page(document, markdown_page)
        path = markdown_page.parent / "images" / "recorded-flights.png"
        if path.parent.is_dir():
            path.write_bytes((out / "recorded-flights" / "flights.png").read_bytes())
    answer(format, document | {"folder": str(out / "recorded-flights")}, lambda: as_text(document))


def compare_other_days(folder: Path, format: Format, markdown_page: Path | None) -> None:
    """Test the diagnosis on other days, which are made by changing the labelled flights in a folder."""
    from beaver_ftc_logs.recorded.comparison import as_text, update_page
    from beaver_ftc_logs.recorded.other_days import run_other_days

    document = {"other_days": run_other_days(folder)}
    if markdown_page is not None:
        update_page(document, markdown_page)
    answer(format, document, lambda: as_text(document))
