"""Drawn flights, one after the other: flown, held against their promises, kept if they break one."""

import contextlib
import io
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import yaml

import beaver_ftc as bf
from tools.drawn.compose import Drawn, drawn_flights
from tools.drawn.promises import broken, flown_again, saved_alike, told_alike
from tools.drawn.shrink import smaller

AIRCRAFT = ("beaver", "jsbsim:c172p")
AGAIN, BY_COMMAND = 3, 50  # every so many-th flight is flown again, and by the command line
NO_TRIM = ("trim", "no steady straight flight")  # a refusal that the schema cannot foresee


@dataclass(frozen=True)
class Outcome:
    """What came of a flight. refused: why it was not flown."""

    index: int
    declared: bool
    broken: tuple[str, ...] = ()
    refused: str = ""
    detected: bool = False
    named: bool = False
    row: dict[str, str] = field(default_factory=dict)


def fly_slice(
    seed: int,
    aircraft: Sequence[str],
    first: int,
    end: int,
    step: int = 1,
    keep: Path | None = None,
    shrink: bool = False,
) -> Iterator[Outcome]:
    """The outcomes of every step-th flight from first to end."""
    for drawn in islice(drawn_flights(seed, aircraft), first, end, step):
        outcome = fly(drawn)
        if outcome.broken and keep is not None:
            keep_it(keep, drawn, outcome, shrink)
        yield outcome


def fly(drawn: Drawn, again: bool | None = None, by_command: bool | None = None) -> Outcome:
    """Fly it, and hold it against every promise. again, by_command: whether to; every so many-th."""
    again = drawn.index % AGAIN == 0 if again is None else again
    by_command = drawn.index % BY_COMMAND == 0 if by_command is None else by_command
    about = {"index": drawn.index, "declared": drawn.declared, "row": drawn.row}
    try:
        flight = bf.fly(drawn.scenario(), log=False)
    except bf.BadInput as error:
        known = any(word in str(error) for word in NO_TRIM)
        return Outcome(**about, refused=str(error), broken=() if known else (f"refused: {error}",))
    except Exception as error:  # whatever it is, it is a find
        return Outcome(**about, broken=(f"{type(error).__name__}: {error}",))
    found = list(broken(flight.scenario, flight.metrics, drawn.declared))
    if again:
        second, different = flown_again(flight)
        found += [*different, *told_alike(second)]
    if by_command:
        found += commanded(flight)
    metrics = flight.metrics
    return Outcome(
        **about,
        broken=tuple(found),
        detected=metrics["detection"]["detected"],
        named=metrics["isolation"]["isolated"],
    )


def commanded(flight: bf.Flight) -> Iterator[str]:
    """The same by `beaver-ftc run`: exit status, documents, page, and the folder opened. Without the figures,
    which take ten times as long as the flight."""
    from typer.testing import CliRunner

    from beaver_ftc.cli.main import app
    from beaver_ftc.results.report import write_report
    from beaver_ftc.scenario.builtin import to_yaml

    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stderr(io.StringIO()):
        file = Path(place) / "drawn.yaml"
        file.write_text(to_yaml(flight.scenario), encoding="utf-8")
        ended = CliRunner().invoke(app, ["run", str(file), "--out", place, "--no-report"])
        expected = 0 if flight.passed else 1
        if ended.exit_code != expected:
            yield f"exit: {ended.exit_code}, expected {expected}: {ended.output[-200:]!r} {ended.exception!r}"
            return
        folder = Path(place) / flight.name
        write_report(folder / "report.html", [folder])
        yield from saved_alike(folder, flight.metrics)
        opened = bf.open_run(folder)
        yield from told_alike(opened)


def keep_it(folder: Path, drawn: Drawn, outcome: Outcome, shrink: bool) -> None:
    """Write a counterexample where it can be flown again, and a smaller one that breaks the same."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{drawn.words['name']}.yaml"
    words = drawn.words
    if shrink:
        words = smaller(drawn, outcome.broken, lambda less: fly(less, again=True, by_command=False).broken)
    heading = "".join(f"# {line}\n" for line in outcome.broken)
    path.write_text(heading + yaml.safe_dump(plain(words), sort_keys=False, width=110), encoding="utf-8")


def plain(value: object) -> object:
    """Without tuples and NumPy's numbers, which YAML has not."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value.item() if hasattr(value, "item") else value
