"""`python -m tools.promises`: what the project promises, and which tests hold each promise.

tests/promises.yaml has the promises in words and the names of their tests. Exit status 1 if a promise has no
test that `make test` runs, or a test that is named does not exist.
"""

import ast
import sys
from collections.abc import Collection, Iterator
from fnmatch import fnmatchcase
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any
from zlib import crc32

from tools.data import yaml_of

TESTS = Path(__file__).parents[1] / "tests"


def table() -> dict[str, Any]:
    """By its name: what a promise says, and the names of its tests."""
    return yaml_of(TESTS / "promises.yaml")


@cache
def rows() -> list[dict[str, list[str]]]:
    """What tests/nightly.yaml says."""
    return yaml_of(TESTS / "nightly.yaml")


@cache
def listed(word: str) -> tuple[str, ...]:
    """How the names of tests begin that nightly.yaml lists under a word."""
    return tuple(name for row in rows() for name in row.get(word, ()))


PARTS = {"thirds": 3, "tenths": 10}


@cache
def thinned() -> dict[str, int]:
    """How the names of tests begin of whose cases `make test` runs one in so many."""
    return {name: part for word, part in PARTS.items() for name in listed(word)}


def is_spared(test: str) -> bool:
    """Whether `make test` leaves out this case of a test, should it not be the first."""
    parts = [part for name, part in thinned().items() if test.startswith(name)]
    return bool(parts and crc32(test.encode()) % max(parts))


def is_at_night(test: str) -> bool:
    """Whether `make nightly` alone runs a test."""
    return test.startswith(listed("night")) and not test.startswith(_by_day_too())


@cache
def _by_day_too() -> tuple[str, ...]:
    """How the names of tests begin that `make test` runs among those for the night."""
    return tuple(name for name in listed("day") if name.startswith(listed("night")))


def longest() -> tuple[str, ...]:
    """How the names of tests begin that `make acceptance` runs in place of `make test`."""
    return listed("acceptance")


def is_by_day(test: str) -> bool:
    """Whether `make test` runs a test."""
    return not (is_at_night(test) or test.startswith(longest()))


def tests() -> Iterator[str]:
    """The name of every test function, as pytest writes it, without parameters."""
    for file in sorted(TESTS.rglob("test_*.py")):
        name = f"tests/{file.relative_to(TESTS).as_posix()}"
        body = ast.parse(file.read_text(encoding="utf-8")).body
        yield from (f"{name}::{test}" for test in _tests_of(body))
        for node in body:
            if isinstance(node, ast.ClassDef):
                yield from (f"{name}::{node.name}::{test}" for test in _tests_of(node.body))


def _tests_of(body: list[ast.stmt]) -> Iterator[str]:
    return (node.name for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("test"))


def doubts(promised: dict[str, Any], known: Collection[str]) -> Iterator[str]:
    """What is wrong with a table: a line a promise without a test, and a test that is not there."""
    for name, row in promised.items():
        found = {test: [each for each in known if fnmatchcase(each, test)] for test in row["tests"]}
        yield from (f"{name}: no such test: {test}" for test, there in found.items() if not there)
        if not any(map(is_by_day, chain(*found.values()))):
            yield f"{name}: no test of every day holds it"


def main() -> int:
    """Print the table, then what is wrong with it."""
    for name, row in table().items():
        print(f"{name}: {row['says']}")
        for test in row["tests"]:
            print(f"    {test}")
    found = list(doubts(table(), frozenset(tests())))
    for line in found:
        print(line, file=sys.stderr)
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
