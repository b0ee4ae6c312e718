"""False certificates: a statement of an event that the log does not have, and edits to make it hold."""

import copy
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from beaver_ftc_assurance.certificates import check_certificate as checker
from beaver_ftc_assurance.certificates.certificate import MEASURED_MODEL_BOUND
from beaver_ftc_assurance.certificates.certified import with_digest
from tools.data import yaml_of

Document = dict[str, Any]
Log = dict[str, np.ndarray]
TYPES = ("stuck", "float", "bias", "loss_of_effectiveness", "hardover up", "oscillatory", "rate_limit")
FORGED = yaml_of(Path(__file__).with_name("forged.yaml"))


def places(node: Any, place: tuple = ()) -> Iterator[tuple]:
    """Yield the places of the numbers of a document."""
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*place, key))
    elif isinstance(node, int | float):
        yield place


def forgeries(
    rng: np.random.Generator, written: Document, log: Log, scenario: str, n: int
) -> Iterator[tuple[Document, tuple]]:
    """Yield n documents with a false statement, and the edits that try to make it hold."""
    for _ in range(n):
        forged, said = false_statement(rng, written, log)
        edits = tuple(rng.choice([*EDITS], size=rng.integers(1, 4), p=SHARES))
        for name in edits:
            with suppress(KeyError, TypeError):  # an edit after one that left a field of another type
                EDITS[name](rng, forged, said)
        _restate(forged, said, log, scenario)
        yield with_digest(json.loads(json.dumps(forged))), edits


def false_statement(rng: np.random.Generator, written: Document, log: Log) -> tuple[Document, Document]:
    """The document with one statement alone, of an event that the log does not have: its evidence is that of
    another event, or made up."""
    rows, forged = len(log["t_s"]), copy.deepcopy(written)
    true = [one for one in written["statements"] if "as" not in one]
    surfaces = [name.removesuffix("_cmd_rad") for name in log if name.endswith("_cmd_rad")]
    excluded = {(one["what"], one["frame"]) for one in written["statements"]}
    while True:
        k, surface = int(rng.integers(1, rows)), str(rng.choice(surfaces))
        what = (None, surface, f"{surface} {rng.choice(TYPES)}")[rng.integers(3)]
        if (what, k) not in excluded and not _is_event(what, k, log):
            break
    columns = [checker.event_column(what, log), f"fie_{surface}_excluded", "detected", "t_s"]
    known = true if true and rng.random() < 0.6 else FORGED["evidence"]
    said = {"frame": 0, **copy.deepcopy(known[rng.integers(len(known))])}
    if known is not true or rng.random() < 0.5:
        _move(said, k - said["frame"], rows, log)
    forged.setdefault("declared", {name: {} for name in "cbgoBm"})
    forged.setdefault("dt_s", float(np.median(np.diff(log["t_s"]))))
    said |= {"what": what, "frame": k}
    if "as" not in said:
        said.setdefault("sides", [[1.0, 0.0]] * 2 if {"bounds", "likelihood"} & said.keys() else [1.0, 0.0])
    said["column"] = str(rng.choice(columns, p=[0.7, 0.1, 0.1, 0.1]))
    forged["statements"] = [said]
    return forged, said


def _is_event(what: str | None, k: int, log: Log) -> bool:
    """Whether the log has this event in this row."""
    column = log.get(checker.event_column(what, log))
    return column is not None and bool(column[k:].all() and (k == 0 or not column[k - 1]))


def _move(said: Document, by: int, rows: int, log: Log) -> None:
    """Move the evidence to another time, with the numbers of the log at that time."""
    for one in (*said.get("terms", ()), *said.get("bounds", ())):
        if "block" not in said and 0 < one["first"] + by <= one["frame"] + by < rows:
            one["first"], one["frame"] = one["first"] + by, one["frame"] + by
            if "since" in one:
                one["since"] = max(one["since"] + by, 0)
            if "weight" in one:
                frames = range(one["first"], one["frame"] + 1)
                one |= {
                    name: [[float(log[f"{axis}_{of}"][k]) for axis in "pqr"] for k in frames]
                    for name, of in zip(("x", "F", "eta_bar"), MEASURED_MODEL_BOUND, strict=True)
                }
    if "likelihood" in said:
        said["first"] = max(said["first"] + by, 1)


def _restate(forged: Document, said: Document, log: Log, scenario: str) -> None:
    """Write the field `rest` of the terms so that it agrees with log and scenario."""
    with suppress(ArithmeticError, LookupError, TypeError, ValueError, checker.Refused):
        declared = checker.declared_at_row(yaml.safe_load(scenario), said["frame"])
        frames = checker.Frames(forged, log, declared, said.get("block"))
        for term in said.get("terms", ()):
            rows = slice(term["first"], term["frame"] + 1)
            term["rest"] = (np.array(term["eta_bar"]) - frames.stated_bound_rad_s2[rows]).tolist()


def _number(rng: np.random.Generator, forged: Document, said: Document) -> None:
    """Change a number, mostly of the statement, or all numbers of its list; frames stay whole numbers."""
    whole = said if rng.random() < 0.8 else forged
    known = [*places(whole)]
    place = known[rng.integers(len(known))]
    node = reduce(getitem, place[:-1], whole)
    for key in range(len(node)) if isinstance(node, list) and rng.random() < 0.3 else (place[-1],):
        is_whole = isinstance(node[key], int)
        node[key] = node[key] + int(rng.integers(-3, 4)) if is_whole else float(rng.choice(FORGED["numbers"]))


def _field(rng: np.random.Generator, forged: Document, said: Document) -> None:
    """Give a field of the document, of the statement or of all of its parts a value, or delete the field."""
    kind = str(rng.choice(["document", "statement", "part"], p=[0.2, 0.2, 0.6]))
    parts = [one for name in ("terms", "bounds") for one in said.get(name) or () if isinstance(one, dict)]
    known = [(name, of) for name, of in FORGED["fields"][kind].items() if kind != "statement" or name in said]
    name, values = known[rng.integers(len(known))] if known else ("block", FORGED["blocks"])
    for one in {"document": [forged], "statement": [said], "part": parts}[kind]:
        value = values[rng.integers(len(values))]
        frames = one["frame"] + 1 - one["first"] if name in ("h", "Z", "r") else 0
        one[name] = [value] * frames if frames else copy.deepcopy(value)
        if rng.random() < 0.1:
            del one[name]


def _odd(rng: np.random.Generator, forged: Document, said: Document) -> None:
    """Put a value of another type into a field of the statement."""
    said[str(rng.choice([*said]))] = FORGED["odd"][rng.integers(len(FORGED["odd"]))]


EDITS: dict[str, Callable[..., None]] = {"number": _number, "field": _field, "odd": _odd}
SHARES = 0.7, 0.27, 0.03
