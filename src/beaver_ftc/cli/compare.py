"""`beaver-ftc compare`: finished runs side by side, or schemes and laws on the same flights."""

from pathlib import Path
from typing import Annotated, Any

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json
from beaver_ftc.documents.errors import BadInput

_OURS = "adaptive-estimators", "fault-tolerant"


def command(
    runs: Annotated[list[Path] | None, typer.Argument(metavar="RUN", help="Result folders of `run`.")] = None,
    sweep: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Compare on the flights of a sweep.")
    ] = None,
    benchmark: Annotated[
        bool, typer.Option("--benchmark", help="Compare on the standard sets; update the leaderboard.")
    ] = False,
    tune: Annotated[bool, typer.Option("--tune", help="Tune the rivals on the calibration set.")] = False,
    errors: Annotated[
        bool, typer.Option("--errors", help="With --tune: for declared sensor errors and turbulence.")
    ] = False,
    schemes: Annotated[
        str | None, typer.Option(help="Comma-separated schemes; all registered ones if left out.")
    ] = None,
    laws: Annotated[
        str | None, typer.Option(help="Comma-separated laws; all registered ones if left out.")
    ] = None,
    only: Annotated[str | None, typer.Option("--set", help="With --benchmark: one set.")] = None,
    flights: Annotated[
        str | None,
        typer.Option(metavar="N|FOLDER", help="At most N flights of each sweep; or recorded flights."),
    ] = None,
    other_days: Annotated[
        bool,
        typer.Option("--other-days", help="With --flights FOLDER: on days made of the labelled flights."),
    ] = False,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    target: Annotated[float, typer.Option(min=0, help="With --tune: false alarms per hour allowed.")] = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for the comparison.")] = Path("comparisons"),
    leaderboard: Annotated[
        Path | None, typer.Option(help="With --benchmark or recorded flights: the page to update.")
    ] = None,
    format: FormatOption = Format.text,
) -> None:
    """Compare runs; or schemes and laws on the same flights.

    Finished runs; or schemes and laws (--sweep, --benchmark); or ways to diagnose recorded flights
    (--flights FOLDER), each left out of the model it is diagnosed with.

    Writes comparison.json, comparison.png and comparison.html (for runs: runs.json, runs.png, runs.html)
    below --out; for recorded flights, flights.json, flights.md and
    flights.png.

    Stopped or killed, a comparison on flights goes on where it was with the same command.
    """
    most, folder = _most_or_folder(flights)
    asked = [bool(runs), sweep is not None, benchmark, tune, folder is not None]
    if sum(asked) != 1:
        raise BadInput(
            "compare: allowed: exactly one of RUN..., --sweep FILE, --benchmark, --tune, --flights FOLDER"
        )
    if only is not None and not benchmark:
        raise BadInput("compare: --set: allowed: only with --benchmark")
    if errors and not tune:
        raise BadInput("compare: --errors: allowed: only with --tune")
    if other_days and folder is None:
        raise BadInput("compare: --other-days: allowed: only with --flights FOLDER")
    if runs:
        _compare_runs(runs, out, format)
    elif folder is not None and other_days:
        _compare_other_days(folder, format, leaderboard)
    elif folder is not None:
        _compare_recorded(folder, out, format, leaderboard)
    elif tune:
        _tune(target, workers, most, errors, format)
    else:
        cases = _cases(sweep, only, most)
        name = f"benchmark-{only}" if only else "benchmark" if benchmark else cases[0].set
        _say(_fly(cases, schemes, laws, workers, out, name), out / name, format, leaderboard)


def _most_or_folder(flights: str | None) -> tuple[int | None, Path | None]:
    """A number of flights, or the folder of recorded ones."""
    if flights is None:
        return None, None
    if not flights.lstrip("-").isdigit():
        return None, Path(flights)
    if int(flights) < 1:
        raise BadInput(f"compare: --flights {flights}: allowed: at least 1, or a folder of recorded flights")
    return int(flights), None


def _compare_recorded(folder: Path, out: Path, format: Format, page: Path | None) -> None:
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.recorded.figure import write_figure
    from beaver_ftc.studies.recorded.run import run_benchmark
    from beaver_ftc.studies.recorded.words import as_markdown, as_text, update_page

    document = run_benchmark(folder)
    with result_folder(out, "recorded-flights") as written:
        write_figure(document, written / "flights.png")
        (written / "flights.json").write_text(as_json(document), encoding="utf-8")
        (written / "flights.md").write_text(as_markdown(document), encoding="utf-8")
    if page is not None:
        update_page(document, page)
        picture = page.parent / "images" / "recorded-flights.png"
        if picture.parent.is_dir():
            picture.write_bytes((out / "recorded-flights" / "flights.png").read_bytes())
    if format is Format.json:
        emit_json(document | {"folder": str(out / "recorded-flights")})
    else:
        emit(as_text(document))


def _compare_other_days(folder: Path, format: Format, page: Path | None) -> None:
    from beaver_ftc.studies.recorded.robustness import run_other_days
    from beaver_ftc.studies.recorded.words import as_text, update_page

    document = {"other_days": run_other_days(folder)}
    if page is not None:
        update_page(document, page)
    if format is Format.json:
        emit_json(document)
    else:
        emit(as_text(document))


def _compare_runs(folders: list[Path], out: Path, format: Format) -> None:
    from beaver_ftc.studies.compare.runs import as_text, labels, write_runs

    runs = write_runs(out, folders)
    if format is Format.json:
        emit_json({"runs": dict(zip(labels(runs), runs, strict=True))})
    else:
        emit(f"{as_text(runs)}\n\nreport: {out / 'runs' / 'runs.html'}")


def _cases(sweep: Path | None, only: str | None, most: int | None) -> list[Any]:
    from beaver_ftc.studies.compare.trial import of_set, of_sweep, set_names

    if sweep is not None:
        return of_sweep(sweep, most=most)
    return [case for name in ([only] if only else set_names()) for case in of_set(name, most)]


def _chosen(group: str, given: str | None, ours: str) -> list[str]:
    """The names asked for, ours among them. Raises BadInput with a line a name that is not registered."""
    from beaver_ftc.plugins import refusal, registered

    if given is None:
        return list(registered(group))
    names = [name.strip() for name in given.split(",") if name.strip()]
    what = "schemes" if ours == _OURS[0] else "laws"
    wrong = [f"--{what}: {says}" for name in names if (says := refusal(group, name))]
    if wrong:
        raise BadInput("\n".join(wrong))
    return list(dict.fromkeys([ours, *names]))


def _fly(
    cases: list[Any], schemes: str | None, laws: str | None, workers: int, out: Path, name: str
) -> dict[str, Any]:
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.studies.compare.leaderboard import run_comparison
    from beaver_ftc.studies.compare.trial import entries_of

    entries = entries_of(_chosen(DETECTORS, schemes, _OURS[0]), _chosen(LAWS, laws, _OURS[1]))
    with progress_bar(f"{len(cases)} flights, {len(entries)} times each") as progress:
        return run_comparison(out, name, cases, entries, workers, progress)


def _say(document: dict[str, Any], folder: Path, format: Format, leaderboard: Path | None) -> None:
    from beaver_ftc.studies.compare.leaderboard import as_text, write_leaderboard

    if format is Format.json:
        emit_json(document | {"folder": str(folder)})
    else:
        emit(f"{as_text(document)}page: {folder / 'comparison.html'}")
    if leaderboard is not None:
        write_leaderboard(document, leaderboard)


def _tune(target: float, workers: int, most: int | None, errors: bool, format: Format) -> None:
    from beaver_ftc.cli.progress import progress_bar
    from beaver_ftc.studies.compare.tune import tune, write_tuned

    with progress_bar("calibration flights") as progress:
        document = tune(target, workers, most, progress, errors)
    write_tuned(document, errors=errors)
    if format is Format.json:
        emit_json(document)
    else:
        emit("\n".join(f"{name}: {options}" for name, options in document["options"].items()))
