"""Healthy logs with one mistake in their columns: is any of them diagnosed as a fault?

    python -m benchmarks.wrong_columns [--logs 10] [--seed 1] [--by identified] [--only TEXT]

Healthy flights are drawn as in own_logs.py and read by the vehicle file that `run --as table` writes. Each of
54 mistakes is made in each log: a sign, a unit, or two columns exchanged. The logs are diagnosed by a model
that `identify` has of other healthy flights, and by the aircraft's design model. The table has a row for each
way and group of mistakes:

- refused: the log is refused in a line, before a diagnosis;
- not credible: less than half of the samples are credible;
- alarmed: an alarm in a credible sample. No surface has failed, so each is false;
- named: a surface is named in one of these samples.
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable
from math import degrees
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from benchmarks.own_logs import BY, NO_SURFACE, Campaign, Log, Said, recorded, scenarios, training, ways

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.present.tables import markdown_table

DEG = degrees(1.0)
RATES, ANGLES = ("p_rad_s", "q_rad_s", "r_rad_s"), ("roll_rad", "pitch_rad", "yaw_rad")
COMMANDS = tuple(f"{surface}_command" for surface in ("aileron", "elevator", "rudder", "flap"))
HEAD = ["by", "mistakes", "logs", "refused", "not credible", "alarmed", "named"]


class Mistake(NamedTuple):
    """Columns whose values become factor times those of `source`, or of themselves."""

    group: str
    said: str
    factor: float
    source_of_column: dict[str, str]


def mistakes() -> list[Mistake]:
    """The 54, in groups."""
    signs = [scaled("sign", name, -1.0) for name in (*RATES, *COMMANDS, "alpha_rad", "beta_rad", *ANGLES)]
    angular = (*RATES, "alpha_rad", "beta_rad", *ANGLES)
    units = [
        *(scaled("unit", name, DEG) for name in angular),
        *(scaled("unit", name, 1.0 / DEG) for name in RATES),
        *(scaled("unit", name, 100.0) for name in COMMANDS),
        *(scaled("unit", "airspeed_mps", factor) for factor in (1.9438, 3.6, 3.2808, 2.2369)),
        *(scaled("unit", "qdyn_pa", factor) for factor in (1.0 / 47.880259, 1e-3, 1e-2)),
        *(scaled("unit", "t_s", factor) for factor in (1e3, 1e6)),
    ]
    columns = (RATES, COMMANDS, ("alpha_rad", "beta_rad"), ANGLES)
    pairs = [(a, b) for of in columns for i, a in enumerate(of) for b in of[i + 1 :]]
    exchanged = [
        Mistake("exchange", f"{a} and {b} exchanged", 1.0, {a: b, b: a})
        for a, b in pairs
    ]  # fmt: skip
    whole = [
        Mistake("unit", f"all of {said} times {factor:.4g}", factor, {name: name for name in of})
        for said, of, factor in (
            ("the rates", RATES, DEG), ("the rates", RATES, 1.0 / DEG), ("the commands", COMMANDS, 100.0),
            ("the commands", COMMANDS, DEG), ("the angles", ANGLES, DEG),
        )
    ]  # fmt: skip
    return [*signs, *units, *whole, *exchanged]


def scaled(group: str, name: str, factor: float) -> Mistake:
    """One column times a factor."""
    return Mistake(group, f"{name} times {factor:.4g}", factor, {name: name})


def with_mistake(log: Log, mistake: Mistake, folder: Path) -> Log:
    """The log with the mistake in its columns, in a folder of its own."""
    table = pd.read_csv(log.path)
    made = table.assign(**{new: mistake.factor * table[old] for new, old in mistake.source_of_column.items()})
    path = folder / log.path.name
    made.to_csv(path, index=False)
    for name in ("vehicle.yaml", "scenario.yaml"):
        (folder / name).write_bytes((log.folder / name).read_bytes())
    return log._replace(folder=folder, path=path)


def ending(diagnosed: Callable[[Log], Said], log: Log) -> tuple[str, ...]:
    """In which columns of the table the log counts."""
    try:
        rows, _ = diagnosed(log)
    except BadInput:
        return ("refused",)
    alarmed = (rows.faulty == 1) & (rows.credible == 1)
    ends = ["not credible"] if rows.credible.mean() < 0.5 else []
    if alarmed.any():
        ends.append("alarmed")
    if set(map(str, rows.isolated_surfaces[alarmed])) - NO_SURFACE:
        ends.append("named")
    return tuple(ends)


def main() -> None:
    """Fly, make each mistake in each log, diagnose, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--by", choices=BY, nargs="*", default=BY)
    parser.add_argument("--only", default="", help="mistakes whose words have this")
    asked = parser.parse_args()
    of = Campaign(seed=asked.seed)
    counts: Counter[tuple[str, str, str]] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        trained = training(of) if "identified" in asked.by else ()
        tried = ways(of, asked.by, [recorded(one, Path(scratch)) for one in trained])
        healthy = [one for one in scenarios(of) if not one["faults"]][: asked.logs]
        logs = [recorded(one, Path(scratch)) for one in healthy]
        folder = Path(scratch) / "mistaken"
        folder.mkdir()
        for mistake in (one for one in mistakes() if asked.only in one.said):
            for log in logs:
                wrong = with_mistake(log, mistake, folder)
                for way, diagnosed in tried.items():
                    ends = ending(diagnosed, wrong)
                    counts.update((way, mistake.group, end) for end in ("logs", *ends))
    groups = sorted({(way, group) for way, group, _ in counts})
    print(markdown_table(HEAD, [
        [*group, *(str(counts[(*group, end)]) for end in HEAD[2:])] for group in groups
    ]))  # fmt: skip


if __name__ == "__main__":
    main()
