"""`beaver-ftc compare`: finished runs side by side, or schemes and laws on the same flights."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, answer, listed, progress_bar
from beaver_ftc.commands import WorkersOption, declare
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plugins import required

FILES = (
    "comparison.json", "comparison.png", "comparison.html", "runs.json", "runs.png", "runs.html",
    "flights.json", "flights.md", "flights.png", "tuned.json", "tuning.json",
)  # fmt: skip


@dataclass(frozen=True)
class Options:
    """The arguments of `command`."""

    runs: Annotated[list[Path] | None, typer.Argument(metavar="RUN")] = None
    sweep: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    benchmark: bool = False
    tune: bool = False
    grade: str | None = None
    trials: Annotated[int, typer.Option(min=5)] = 24
    restarts: Annotated[int, typer.Option(min=0)] = 8
    seed: int = 1
    draw: Annotated[int, typer.Option(min=0)] = 0
    draws: Annotated[int, typer.Option(min=1)] = 1
    tuned: Annotated[Path | None, typer.Option(metavar="FILE")] = None
    schemes: str | None = None
    laws: str | None = None
    only: Annotated[str | None, typer.Option("--set")] = None
    flights: Annotated[str | None, typer.Option(metavar="N|FOLDER")] = None
    other_days: bool = False
    workers: WorkersOption = None
    out: Path = Path("comparisons")
    leaderboard: Path | None = None
    format: FormatOption = Format.text


@declare(*FILES)
def command(options: Options) -> None:
    """Compare runs, or schemes and laws on the same flights.

    The command compares finished runs (RUN), schemes and laws (--sweep or --benchmark), or detectors on
    recorded flights (--flights FOLDER). For each recorded flight, the model is identified from the other
    flights. --tune searches for good parameters of schemes and laws. The search is the same for built-in
    methods and plug-ins.

    The command writes comparison.json, .png and .html. For finished runs it writes runs.json, .png and .html.
    For recorded flights it writes flights.json, .md and .png. With --tune it writes tuned.json, which has the
    parameters, and tuning.json, which has how they were found.

    If a comparison on flights is interrupted, the same command resumes it.

    Examples:
      beaver-ftc run elevator-partial-loss rudder-stuck
      beaver-ftc compare runs/elevator-partial-loss runs/rudder-stuck
      beaver-ftc compare --sweep elevator-effectiveness --flights 20
      beaver-ftc compare --tune --grade exact --schemes adaptive-estimators

    runs: Result folders that `run` wrote.
    sweep: Compare on the flights of this sweep.
    benchmark: Compare on the benchmark's standard sets of flights, and update the ranking.
    tune: Choose parameters of schemes and laws on the calibration flights.
    grade: With --tune: use only flights of this grade: exact, actuators or errors. Default: all.
    trials: With --tune: number of trials of each search.
    restarts: With --tune: largest number of further searches.
    seed: With --tune: seed of the search.
    draw: With --tune: number of the set of calibration flights.
    draws: With --tune: how many such sets, from that number on, are flown together.
    tuned: With --sweep or --benchmark: read the parameters from this file.
    schemes: Names of schemes, separated by commas. Default: all registered schemes and laws.
    laws: Names of laws, separated by commas. Default: all registered schemes and laws.
    only: With --benchmark: fly only this set of flights.
    flights: N: at most N flights of each sweep. FOLDER: compare detectors on its recorded flights.
    other_days: With --flights FOLDER: diagnose changed copies of the labelled flights.
    out: Folder for the results.
    leaderboard: With --benchmark or --flights FOLDER: path of the page with the ranking.
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
    """Raise BadInput unless exactly one kind of comparison is chosen, and each option belongs to it."""
    kinds = (options.runs, options.sweep is not None, options.benchmark, options.tune, folder is not None)
    if sum(map(bool, kinds)) != 1:
        raise BadInput(
            "compare: allowed: exactly one of RUN..., --sweep FILE, --benchmark, --tune, --flights FOLDER"
        )
    for is_given, is_allowed, message in (
        (options.only is not None, options.benchmark, "--set: allowed: only with --benchmark"),
        (options.grade is not None, options.tune, "--grade: allowed: only with --tune"),
        (options.trials != Options.trials, options.tune, "--trials: allowed: only with --tune"),
        (options.restarts != Options.restarts, options.tune, "--restarts: allowed: only with --tune"),
        (options.seed != Options.seed, options.tune, "--seed: allowed: only with --tune"),
        (options.draw != 0, options.tune, "--draw: allowed: only with --tune"),
        (options.draws != 1, options.tune, "--draws: allowed: only with --tune"),
        (
            options.tuned is not None,
            options.sweep is not None or options.benchmark,
            "--tuned: allowed: only with --sweep or --benchmark",
        ),
        (options.other_days, folder is not None, "--other-days: allowed: only with --flights FOLDER"),
    ):
        if is_given and not is_allowed:
            raise BadInput(f"compare: {message}")


def _most_or_folder(flights: str | None) -> tuple[int | None, Path | None]:
    """The number of flights, or the folder of recorded flights, that the option --flights gives."""
    if flights is None:
        return None, None
    if not re.fullmatch(r"-?[0-9]{1,9}", flights):
        return None, Path(flights)
    if int(flights) < 1:
        raise BadInput(f"compare: --flights {flights}: allowed: at least 1, or a folder of recorded flights")
    return int(flights), None


def _compare_runs(folders: list[Path], out: Path, format: Format) -> None:
    """Compare finished runs, and print the comparison."""
    from beaver_ftc.studies.compare.runs import as_text, labels, write_runs

    runs = write_runs(out, folders)
    document = {"runs": dict(zip(labels(runs), (run.entry for run in runs), strict=True))}
    answer(format, document, lambda: f"{as_text(runs)}\n\nreport: {out / 'runs' / 'runs.html'}")


def _compare_on_flights(options: Options, most: int | None) -> None:
    """Compare schemes and laws on the flights of a sweep, or of the standard sets, and print the result."""
    from beaver_ftc.studies.compare.leaderboard import as_text, comparison_study, write_leaderboard
    from beaver_ftc.studies.compare.sets import of_set, of_sweep, set_names
    from beaver_ftc.studies.compare.trial import LAW, SCHEME, entries_of
    from beaver_ftc.studies.compare.tune import read_tuned
    from beaver_ftc.studies.engine.processes import cores
    from beaver_ftc.studies.engine.study import run_into

    if options.sweep is not None:
        cases = of_sweep(options.sweep, most=most)
        name = cases[0].set
    else:
        sets = [options.only] if options.only else set_names()
        cases = [case for set_name in sets for case in of_set(set_name, most)]
        name = f"benchmark-{options.only}" if options.only else "benchmark"
    chosen = None if options.tuned is None else read_tuned(options.tuned)
    entries = entries_of(
        _chosen("--schemes", options.schemes, SCHEME, alone=options.laws is None),
        _chosen("--laws", options.laws, LAW, alone=options.schemes is None),
    )
    with progress_bar(f"{len(cases)} flights, {len(entries)} times each") as progress:
        study = comparison_study(name, cases, entries, chosen)
        document = run_into(study, options.out, options.workers or cores(), progress)
    page = options.out / name / "comparison.html"
    answer(options.format, document, lambda: f"{as_text(document)}page: {page}")
    if options.leaderboard is not None:
        write_leaderboard(document, options.leaderboard)


def _group(option: str) -> str:
    """The group of plug-ins whose names an option lists."""
    from beaver_ftc.plugins import DETECTORS, LAWS

    return DETECTORS if option == "--schemes" else LAWS


def _chosen(option: str, names: str | None, ours: str, *, alone: bool) -> list[str]:
    """The listed names, after `ours`. Without a list: all registered names, or none if the other option has
    a list (`alone` is then false)."""
    from beaver_ftc.plugins import registered

    if names is None:
        return list(registered(_group(option))) if alone else []
    return list(dict.fromkeys([ours, *_named(option, names)]))


def _named(option: str, names: str | None) -> list[str]:
    """The listed schemes or laws. Raises BadInput with a line for each name that is not registered."""
    from beaver_ftc.plugins import refusal

    entries = [] if names is None else listed(names)
    mistakes = [f"{option}: {text}" for name in entries if (text := refusal(_group(option), name))]
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return entries


def _tune(options: Options, most: int | None) -> None:
    """Search parameters of schemes and laws, write them, and print them."""
    from beaver_ftc.plugins import DETECTORS, LAWS, registered
    from beaver_ftc.studies.compare.trial import STATISTICAL
    from beaver_ftc.studies.compare.tune import Search, methods_of, tune, write_tuned
    from beaver_ftc.studies.compare.tune_shown import as_text
    from beaver_ftc.studies.engine.processes import cores

    everything = options.schemes is None and options.laws is None
    schemes = [*registered(DETECTORS), STATISTICAL] if everything else _named("--schemes", options.schemes)
    laws = list(registered(LAWS)) if everything else _named("--laws", options.laws)
    methods = methods_of(schemes, laws, _grades(options.grade))
    how = Search(options.trials, options.seed, options.restarts, most, options.draw, options.draws)
    budget = options.trials * (1 + options.restarts)
    with progress_bar(f"{len(methods)} methods and grades, up to {budget} trials each") as progress:
        document = tune(methods, how, options.workers or cores(), progress)
    path = write_tuned(document, options.out)
    answer(options.format, document, lambda: f"{as_text(document)}\n\nwritten: {path}")


def _grades(grade: str | None) -> list[str]:
    """The grade of flights that the option gives; all grades without it."""
    from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES

    if grade is None:
        return list(FLIGHT_GRADES)
    if grade not in FLIGHT_GRADES:
        raise BadInput(f"compare: --grade {grade[:50]!r}, allowed: {', '.join(FLIGHT_GRADES)}")
    return [grade]
