"""`beaver-ftc identify` and `diagnose`: from recorded flights to a model, and to what broke in a flight."""

import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beaver_ftc.cli import Document, Format, FormatOption, answer
from beaver_ftc.commands import declare
from beaver_ftc.documents import BadInput

if TYPE_CHECKING:
    from beaver_ftc_logs.model import Model
    from beaver_ftc_logs.samples import Samples

FlightsArgument = Annotated[list[Path], typer.Argument(metavar="FLIGHT", help="Recorded flights.")]
ReaderOption = Annotated[
    str | None, typer.Option(help="table, alfa, ulog or ardupilot, where it is not evident.")
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

    Writes a model file for `diagnose`. The fit uses the healthy parts of the flights, and faulty parts whose
    labels give the effectiveness. It is validated on data not used for fitting; the result is in the model
    file and on a page beside it (MODEL with .html).

    vehicle: Vehicle file, or the built-in `alfa`; `beaver-ftc new NAME --log` writes one that lists every
    key.
    out: The model file to write; with --check the vehicle file that is proposed.
    check: Do not fit; report what the logs contain, and propose a vehicle file if none is given.
    false_alarms_per_hour: Alarms that `diagnose` may raise in healthy flight, instead of the vehicle file's.
    """
    _silence_numpy()
    if check:
        _check(flights, vehicle, out, reader, format)
        return
    if vehicle is None or out is None:
        option = "--vehicle" if vehicle is None else "--out"
        raise BadInput(f"identify: {option} is missing, allowed: --vehicle FILE --out MODEL, or --check")
    from beaver_ftc.results import clear_disk_errors
    from beaver_ftc.studies.engine import write_whole
    from beaver_ftc_logs.identification import by_pressure, identify, summary
    from beaver_ftc_logs.model import as_text
    from beaver_ftc_logs.pages import check_page, render_model
    from beaver_ftc_logs.samples import load_flights
    from beaver_ftc_logs.vehicle import asking, load_vehicle

    page = out.with_suffix(".html")
    check_page(page)
    described = load_vehicle(vehicle)
    if false_alarms_per_hour is not None:
        described = asking(described, false_alarms_per_hour)
    loaded, described = by_pressure(load_flights(flights, described, reader), described)
    model = identify(loaded, described)
    shown = render_model(loaded, model)
    for path, text in ((out, as_text(model)), (page, shown)):
        with clear_disk_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, text.encode("utf-8"))
    document = {
        "model": str(out),
        "page": str(page),
        "identified": model.identified,
        "settings": model.settings.model_dump(),
    }
    long = [f"  {one.name}: {one.notes[0]}" for one in loaded if one.parts > 1]
    answer(format, document, lambda: "\n".join([summary(model), *long, f"model: {out}", f"page: {page}"]))


def _silence_numpy() -> None:
    """A column of nothing but gaps makes NumPy warn of means of nothing: the readers say so by its name."""
    warnings.filterwarnings("ignore", category=RuntimeWarning)


def _check(
    flights: list[Path], vehicle: str | None, out: Path | None, reader: str | None, format: Format
) -> None:
    from beaver_ftc_logs.check import as_text, as_yaml, check
    from beaver_ftc_logs.vehicle import load_vehicle

    described = load_vehicle(vehicle) if vehicle is not None else None
    if out is not None and (out.exists() or described is not None):
        says = f"{out} exists, allowed: another name" if out.exists() else "a vehicle file is given already"
        raise BadInput(f"identify: --check --out: {says}")
    checked = [check(path, described, reader) for path in flights]
    guess = next((one["vehicle"] for one in checked if one["vehicle"]), None)
    lines = [as_text(one) for one in checked]
    if guess is not None and out is not None:
        _write_new(out, as_yaml(guess))
        lines.append(f"vehicle file: {out}")
    elif guess is not None:
        lines.append(as_yaml(guess))
    answer(format, {"logs": checked, "vehicle": guess}, lambda: "\n".join(lines))
    if not all(one["usable"] for one in checked):
        raise typer.Exit(2)


def _write_new(path: Path, text: str) -> None:
    from beaver_ftc.results import clear_disk_errors

    with clear_disk_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Options:
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
def diagnose(options: Options) -> None:
    """Diagnose recorded flights with a model or an aircraft.

    Writes DIR/<flight>/diagnosis.parquet (one row per sample), verdict.json and report.html. A row uses only
    samples up to its own time. The log.parquet of `run` needs no model: it is diagnosed as in flight.

    model: The model file that `identify` wrote; none for logs of `run`.
    aircraft: Use the design model of this aircraft, as the simulation does, instead of an identified model.
    scenario: With --aircraft: scenario whose fdi, actuators and design_model declare the errors.
    vehicle: With --aircraft: the vehicle file, if it is not vehicle.yaml beside the log.
    out: Folder for the results.
    score: Compare with the log's labels, after the fact.
    detector: Detector to use: bank-of-filters, or another one by its name.
    certificate: With --aircraft: also write certificate.json and log.parquet, which prove the alarm.
    """
    _silence_numpy()
    _check_options(options)
    flights, out, format = options.flights, options.out, options.format
    if options.aircraft is not None:
        _by_aircraft(options)
        return
    if options.model is None:
        _replay(flights, out, format)
        return
    from beaver_ftc_logs.detectors import check_detector
    from beaver_ftc_logs.findings import as_text
    from beaver_ftc_logs.model import load_model
    from beaver_ftc_logs.samples import flights_of

    check_detector(options.detector)
    known = load_model(options.model)
    verdicts = [
        _diagnose(flight, known, out, options.score, options.detector)
        for flight in flights_of(flights, known.vehicle, options.reader)
    ]
    answer(
        format,
        {"flights": verdicts},
        lambda: "\n".join(f"{as_text(each)}\n  report: {each['folder']}/report.html" for each in verdicts),
    )


def _check_options(options: Options) -> None:
    """Raise BadInput for options that contradict one another."""
    if options.aircraft is None:
        only = {"--scenario": options.scenario, "--vehicle": options.vehicle}
        only |= {"--certificate": "" if options.certificate else None}
        for option, given in only.items():
            if given is not None:
                raise BadInput(
                    f"diagnose: {f'{option} {given}'.rstrip()}: allowed: only with --aircraft NAME"
                )
        return
    if options.model is not None:
        raise BadInput("diagnose: --model and --aircraft: allowed: one of them")
    if options.detector != "bank-of-filters":
        says = f"--detector {options.detector}: allowed: none, fdi.scheme of --scenario names it"
        raise BadInput(f"diagnose: --aircraft with {says}")


def _by_aircraft(options: Options) -> None:
    from beaver_ftc_logs.by_aircraft import as_text, diagnosed, known, take
    from beaver_ftc_logs.pages import write_by_aircraft
    from beaver_ftc_logs.readers import check_exists
    from beaver_ftc_logs.samples import parts_for
    from beaver_ftc_logs.scoring import score
    from beaver_ftc_logs.vehicle import load_vehicle

    if options.certificate:
        from beaver_ftc_logs import certified

    by = known(str(options.aircraft), options.scenario)
    verdicts = []
    for path in options.flights:
        check_exists(path)
        beside = path.with_name("vehicle.yaml")
        if options.vehicle is None and not beside.is_file():
            raise BadInput(f"{path}: no vehicle.yaml beside it, allowed: --vehicle FILE")
        described = load_vehicle(options.vehicle or str(beside))
        for recording in parts_for(path, described, options.reader):
            taken = take(recording, described, by)
            rows, verdict = diagnosed(taken, by)
            samples, surfaces = taken.samples, by.aircraft.surfaces
            if options.score:
                verdict["score"] = score(samples, rows, [[name] for name in surfaces])
            proof = partial(certified.write, taken, rows) if options.certificate else None
            folder = write_by_aircraft(options.out, samples, surfaces, rows, verdict, proof)
            verdicts.append(verdict | {"folder": str(folder)})
    answer(options.format, {"flights": verdicts}, lambda: "\n".join(map(as_text, verdicts)))


def _replay(flights: list[Path], out: Path, format: Format) -> None:
    from beaver_ftc_logs.pages import write_results
    from beaver_ftc_logs.replay import as_text, is_own_log, replay

    others = [path for path in flights if not is_own_log(path)]
    if others:
        says = "--model is missing, allowed without one: log.parquet beside its scenario.yaml"
        raise BadInput(f"diagnose: {others[0]}: {says}")
    done = [replay(path) for path in flights]
    verdicts = [
        verdict | {"folder": str(write_results(out, verdict["flight"], columns, verdict))}
        for columns, verdict in done
    ]
    answer(format, {"flights": verdicts}, lambda: "\n".join(map(as_text, verdicts)))


def _diagnose(samples: "Samples", model: "Model", out: Path, scored: bool, detector: str) -> Document:
    from beaver_ftc_logs.detectors import diagnose_with
    from beaver_ftc_logs.findings import verdict_of
    from beaver_ftc_logs.pages import write_diagnosis
    from beaver_ftc_logs.scoring import score

    rows = diagnose_with(detector, samples, model)
    verdict = verdict_of(samples, model, rows) | {"detector": detector}
    if scored:
        verdict["score"] = score(samples, rows, model.groups)
    folder = write_diagnosis(out, samples, model, rows, verdict)
    return verdict | {"folder": str(folder)}


def compare_recorded(folder: Path, out: Path, format: Format, page: Path | None) -> None:
    """Compare ways to diagnose the recorded flights in a folder; page: a page of Markdown to update."""
    from beaver_ftc.results import result_folder
    from beaver_ftc.studies.present import write_files
    from beaver_ftc_logs.recorded.benchmark import as_text, files_of, run_benchmark, update_page

    document = run_benchmark(folder)
    with result_folder(out, "recorded-flights") as written:
        write_files(written, files_of(document))
    if page is not None:
        update_page(document, page)
        picture = page.parent / "images" / "recorded-flights.png"
        if picture.parent.is_dir():
            picture.write_bytes((out / "recorded-flights" / "flights.png").read_bytes())
    answer(format, document | {"folder": str(out / "recorded-flights")}, lambda: as_text(document))


def compare_other_days(folder: Path, format: Format, page: Path | None) -> None:
    """The same on days made of the labelled flights."""
    from beaver_ftc_logs.recorded.benchmark import as_text, update_page
    from beaver_ftc_logs.recorded.other_days import run_other_days

    document = {"other_days": run_other_days(folder)}
    if page is not None:
        update_page(document, page)
    answer(format, document, lambda: as_text(document))
