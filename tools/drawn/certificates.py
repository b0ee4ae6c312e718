"""Certificates of drawn flights: does the checker accept true ones, and refuse altered and false ones?

    python -m tools.drawn.certificates [--flights N] [--seed S] [--altered A] [--forged F]

The program checks the certificates of N flights of our scheme, drawn from the schema (`python -m
tools.drawn`), and of N healthy flights. A times it alters a number, index or frame of one of them, once with
the old digest and once with a new one, so that only the recomputation can refuse it. F times it puts a false
statement into one: an alarm in a row without one, or an exclusion of a fault that is not excluded, or at
another time. The evidence is that of another event, or made up (forged.yaml), and one to three EDITS change
it; the digest is new. If the checker refuses a statement for its sides alone, the statement counts as
accepted, since a forger can write the right sides. Log and scenario stay as they are. The exit status is 1 if
a true certificate is refused, or another one accepted.
"""

import argparse
import copy
import json
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import beaver_ftc as bf
from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc_assurance.certificates import check_certificate as checker
from beaver_ftc_assurance.certificates.certificate import MEASURED_MODEL_BOUND
from beaver_ftc_assurance.certificates.certified import as_text, with_digest
from tools.drawn.campaign import AIRCRAFT
from tools.drawn.compose import OURS, PLAIN, drawn_flights

Document = dict[str, Any]
Log = dict[str, np.ndarray]
SCALED = 1.01  # times a number that is altered
TYPES = ("stuck", "float", "bias", "loss_of_effectiveness", "hardover up", "oscillatory", "rate_limit")
SIDES = "the stated sides are not the recomputed ones"
FORGED = yaml.safe_load(Path(__file__).with_name("forged.yaml").read_text(encoding="utf-8"))


def main() -> None:
    """Fly, check, alter, forge and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--altered", type=int, default=100)
    parser.add_argument("--forged", type=int, default=5000)
    args = parser.parse_args()
    np.seterr(all="ignore")  # forged numbers overflow
    rng, count, reasons = np.random.default_rng(args.seed), Counter[str](), Counter[str]()
    for written, log, scenario in flights(args.seed, args.flights):
        count["true certificates"] += 1
        if refused := [*checker.failures(written, log, scenario)]:
            count["true ones refused"] += 1
            print(f"refused: {refused[0][:200]}", flush=True)
        share = count["true certificates"] / (2 * args.flights)
        others = {
            "altered": alterations(rng, written, int(args.altered * share) - count["altered"]),
            "forged": forgeries(rng, written, log, scenario, int(args.forged * share) - count["forged"]),
        }
        for kind, made in others.items():
            for other, how in made:
                why = [*checker.failures(other, log, scenario)]
                if kind == "forged":
                    why = [one for one in why if not one.endswith(SIDES)]
                count[kind] += 1
                count[f"{kind} ones accepted"] += not why
                reasons.update(one.rpartition(": ")[2][:60] for one in why[:1])
                if not why:
                    print(f"accepted: {how}: {as_text(other)[:400]}", flush=True)
    print(*(f"{word} {n}" for word, n in count.items()), sep=", ")
    for reason, n in reasons.most_common(25):
        print(f"{n:6d} {reason}")
    wrong = ("true ones refused", "altered ones accepted", "forged ones accepted")
    raise SystemExit(any(count[word] for word in wrong))


def flights(seed: int, n: int) -> Iterator[tuple[Document, Log, str]]:
    """Certificate as it is read back, log and scenario of n drawn flights of our scheme, and of as many
    healthy ones."""
    drawn, found = drawn_flights(seed, AIRCRAFT, kinds=(OURS, PLAIN, PLAIN)), 0
    while found < n:
        with suppress(bf.BadInput):  # there is no trim
            scenario = next(drawn).scenario()
            yield from map(_certified, (bf.load(_healthy(seed + found)), scenario))
            found += 1


def _certified(scenario: bf.Scenario) -> tuple[Document, Log, str]:
    flight = bf.fly(scenario)
    proof = flight.proof()
    return json.loads(as_text(proof.certificate)), proof.log, to_yaml(flight.scenario)


def _healthy(k: int) -> Document:
    return {
        "name": "healthy", "duration_s": 4.0, "seed": k, "initial": {"airspeed_mps": 35 + k % 15},
        "reference": {"q": [{"sine": {"amplitude_deg_s": 1 + k % 4, "frequency_hz": 0.3}}]},
        "fdi": {"fault_class": ("all", "published")[k % 2]},
    }  # fmt: skip


def places(node: Any, place: tuple = ()) -> Iterator[tuple]:
    """Yield the places of the numbers of a document."""
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*place, key))
    elif isinstance(node, int | float):
        yield place


def alterations(rng: np.random.Generator, written: Document, n: int) -> Iterator[tuple[Document, tuple]]:
    """Yield n documents with one number altered, with the old and with a new digest, and the place."""
    known = [*places(written)] if written["statements"] else []
    for place in (known[i] for i in rng.integers(len(known), size=max(n, 0))) if known else ():
        other = altered(written, place)
        yield other, place
        yield with_digest(other), (*place, "with the digest")


def altered(certificate: Document, place: tuple) -> Document:
    """The certificate with one number altered: a frame or index by one, another number by a hundredth."""
    other = copy.deepcopy(certificate)
    node, key = reduce(getitem, place[:-1], other), place[-1]
    value = node[key]
    if isinstance(value, int):
        node[key] = value + 1
    else:
        node[key] = value * SCALED if value else 1e-3
    return other


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


# --- the edits: each changes one thing that could make a statement hold ----------------------------------


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


if __name__ == "__main__":
    main()
