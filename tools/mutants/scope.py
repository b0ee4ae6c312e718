"""Which modules mutants are made of, why not of the others, which tests reach each, what a seed draws."""

import hashlib
from collections import Counter
from pathlib import Path

import yaml

from tools.mutants.making import Mutant, mutants

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "beaver_ftc"
EQUIVALENT = Path(__file__).with_name("equivalent.yaml")

# What computes, judges, counts and words.
SCOPE = (
    "design/*.py", "diagnosis/**/*.py", "control/**/*.py", "studies/engine/statistics.py",
    "studies/*/summary.py", "studies/*/tally.py", "studies/*/text.py", "studies/*/words.py",
    "studies/*/levels.py", "studies/*/limit.py", "results/expectations.py", "results/metrics.py",
    "results/verdict.py", "scenario/signals.py", "scenario/table.py", "scenario/warnings.py",
)  # fmt: skip
# Why the other modules of a folder are not in the scope. A folder without a reason is a mistake.
LEFT_OUT = {
    "": "compile, find folders, register plug-ins",
    "documents": "reads files and says what is wrong in them",
    "aircraft": "declares the fields of a file and reads it",
    "scenario": "the other modules declare the fields of a file, read and write it",
    "plant": "flies JSBSim, partly by compiled code through ctypes: plain Python does not reach it",
    "loop": "joins what flies: a test of it flies, for minutes in plain Python",
    "flights": "fits and filters recordings, row by row: minutes in plain Python",
    "results": "the other modules draw, and read and write files",
    "studies": "the other modules fly, draw, write files and start processes",
    "integrations": "a page, a server, and other people's frames around flights",
    "cli": "reads arguments and prints",
}
# Tests that reach a folder of the package: its own, and those of what stands on it.
FOLDERS = {
    "design": ("design", "diagnosis", "control"),
    "diagnosis": ("diagnosis", "design"),
    "control": ("control",),
    "studies": ("studies",),
    "results": ("results",),
    "scenario": ("scenario",),
}


def left_out() -> list[str]:
    """A line a folder: how many modules are not in the scope, and why."""
    within = {file for pattern in SCOPE for file in PACKAGE.glob(pattern)}
    others = Counter(
        file.relative_to(PACKAGE).parts[0] if file.parent != PACKAGE else ""
        for file in PACKAGE.rglob("*.py")
        if file not in within and file.name != "__init__.py"
    )
    return [f"{folder or '.'} ({number} modules): {LEFT_OUT[folder]}" for folder, number in others.items()]


def drawn(seed: int, patterns: tuple[str, ...]) -> tuple[list[Mutant], int]:
    """The mutants of a seed, those listed as equivalent left out, and how many these are.

    The order depends on each mutant alone: a change elsewhere in the package changes nothing in it.
    """
    files = sorted({file for pattern in patterns for file in PACKAGE.glob(pattern)})
    every = [mutant for file in files for mutant in mutants(file)]
    every.sort(key=lambda mutant: hashlib.sha256(f"{seed} {mutant.name(PACKAGE)}".encode()).digest())
    known = equivalent()
    return [m for m in every if m.name(PACKAGE) not in known], len(known)


def equivalent() -> set[str]:
    """The names of the mutants that make no difference; the file says why of each."""
    listed = yaml.safe_load(EQUIVALENT.read_text()) or {}
    return {f"{file}: {change}" for file, changes in listed.items() for change in changes}


def stale() -> list[str]:
    """Names in the list of equivalent mutants that are none of any mutant today."""
    known = equivalent()
    files = {PACKAGE / name.split(":")[0] for name in known}
    there = {mutant.name(PACKAGE) for file in files if file.exists() for mutant in mutants(file)}
    return sorted(known - there)
