"""`beaver-ftc compare`: finished runs side by side, or schemes and laws on the same flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import listed
from beaver_ftc.cli.output import Format, FormatOption, answer
from beaver_ftc.cli.progress import progress_bar
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.extensions import required

FILES = (
    "comparison.json", "comparison.png", "comparison.html", "runs.json", "runs.png", "runs.html",
    "flights.json", "flights.md", "flights.png",
)  # fmt: skip


@dataclass(frozen=True)
class Options:
    """The arguments of `command`."""

    runs: Annotated[list[Path] | None, typer.Argument(metavar="RUN")] = None
    sweep: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    benchmark: bool = False
    tune: bool = False
    errors: bool = False
    schemes: str | None = None
    laws: str | None = None
    only: Annotated[str | None, typer.Option("--set")] = None
    flights: Annotated[str | None, typer.Option(metavar="N|FOLDER")] = None
    other_days: bool = False
    workers: Annotated[int, typer.Option(min=1)] = 2
    target: Annotated[float, typer.Option(min=0)] = 1.0
    out: Path = Path("comparisons")
    leaderboard: Path | None = None
    format: FormatOption = Format.text


@declare(*FILES)
def command(options: Options) -> None:
    """Compare runs, or schemes and laws on the same flights.

    It compares finished runs; or schemes and laws (--sweep, --benchmark); or detectors on recorded flights
    (--flights FOLDER), each flight with a model identified without it.

    Writes comparison.json, .png and .html; for runs: runs.json, .png and .html; for recorded flights:
    flights.json, .md and .png.

    The same command resumes an interrupted comparison on flights.

    runs: Result folders of `run`.
    sweep: Compare on the flights of a sweep.
    benchmark: Compare on the standard sets; update the leaderboard.
    tune: Tune the rivals on the calibration set.
    errors: With --tune: for declared sensor errors and turbulence.
    schemes: Comma-separated schemes; all registered ones if neither schemes nor laws are listed.
    laws: Comma-separated laws; all registered ones if neither schemes nor laws are listed.
    only: With --benchmark: one set.
    flights: At most N flights of each sweep; or recorded flights.
    other_days: With --flights FOLDER: on days made of the labelled flights.
    workers: Processes.
    target: With --tune: false alarms per hour allowed.
    out: Folder for the comparison.
    leaderboard: With --benchmark or recorded flights: the page to update.
    """
    most, folder = _most_or_folder(options.flights)
    _refuse_contradictions(options, folder)
    if options.runs:
        _compare_runs(options.runs, options.out, options.format)
    elif folder is not None and options.other_days:
        required("compare_other_days", "compare --flights")(folder, options.format, options.leaderboard)
    elif folder is not None:
        compare = required("compare_recorded", "compare --flights")
        compare(folder, options.out, options.format, options.leaderboard)
    elif options.tune:
        _tune(options, most)
    else:
        _compare_on_flights(options, most)


def _refuse_contradictions(options: Options, folder: Path | None) -> None:
    ways = (options.runs, options.sweep is not None, options.benchmark, options.tune, folder is not None)
    if sum(map(bool, ways)) != 1:
        raise BadInput(
            "compare: allowed: exactly one of RUN..., --sweep FILE, --benchmark, --tune, --flights FOLDER"
        )
    for option, with_it, allowed in (
        (options.only is not None, options.benchmark, "--set: allowed: only with --benchmark"),
        (options.errors, options.tune, "--errors: allowed: only with --tune"),
        (options.other_days, folder is not None, "--other-days: allowed: only with --flights FOLDER"),
    ):
        if option and not with_it:
            raise BadInput(f"compare: {allowed}")


def _most_or_folder(flights: str | None) -> tuple[int | None, Path | None]:
    """A number of flights, or the folder of recorded ones."""
    if flights is None:
        return None, None
    if not flights.lstrip("-").isdigit():
        return None, Path(flights)
    if int(flights) < 1:
        raise BadInput(f"compare: --flights {flights}: allowed: at least 1, or a folder of recorded flights")
    return int(flights), None


def _compare_runs(folders: list[Path], out: Path, format: Format) -> None:
    from beaver_ftc.studies.compare.runs import as_text, labels, write_runs

    runs = write_runs(out, folders)
    document = {"runs": dict(zip(labels(runs), runs, strict=True))}
    answer(format, document, lambda: f"{as_text(runs)}\n\nreport: {out / 'runs' / 'runs.html'}")


def _compare_on_flights(options: Options, most: int | None) -> None:
    """Schemes and laws on the flights of a sweep, or of the standard sets."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.studies.compare.leaderboard import as_text, run_comparison, write_leaderboard
    from beaver_ftc.studies.compare.trial import LAW, SCHEME, entries_of, of_set, of_sweep, set_names

    if options.sweep is not None:
        cases = of_sweep(options.sweep, most=most)
        name = cases[0].set
    else:
        sets = [options.only] if options.only else set_names()
        cases = [case for each in sets for case in of_set(each, most)]
        name = f"benchmark-{options.only}" if options.only else "benchmark"
    entries = entries_of(
        _chosen("--schemes", DETECTORS, options.schemes, SCHEME, alone=options.laws is None),
        _chosen("--laws", LAWS, options.laws, LAW, alone=options.schemes is None),
    )
    with progress_bar(f"{len(cases)} flights, {len(entries)} times each") as progress:
        document = run_comparison(options.out, name, cases, entries, options.workers, progress)
    folder = options.out / name
    answer(
        options.format,
        document | {"folder": str(folder)},
        lambda: f"{as_text(document)}page: {folder / 'comparison.html'}",
    )
    if options.leaderboard is not None:
        write_leaderboard(document, options.leaderboard)


def _chosen(option: str, group: str, names: str | None, ours: str, *, alone: bool) -> list[str]:
    """The names listed, ours among them; without a list all that are registered, or none where the list of
    the other kind is what was asked for (alone: it was not). Raises BadInput with a line a name that is not
    registered."""
    from beaver_ftc.plugins import refusal, registered

    if names is None:
        return list(registered(group)) if alone else []
    wrong = [f"{option}: {says}" for name in listed(names) if (says := refusal(group, name))]
    if wrong:
        raise BadInput("\n".join(wrong))
    return list(dict.fromkeys([ours, *listed(names)]))


def _tune(options: Options, most: int | None) -> None:
    from beaver_ftc.studies.compare.tune import tune, write_tuned

    with progress_bar("calibration flights") as progress:
        document = tune(options.target, options.workers, most, progress, options.errors)
    write_tuned(document, errors=options.errors)
    answer(
        options.format,
        document,
        lambda: "\n".join(f"{name}: {tuned}" for name, tuned in document["options"].items()),
    )
