"""Certificates of drawn flights: does the checker accept all, and refuse each that is altered?

    python -m tools.drawn.certificates [--flights N] [--seed S] [--altered A]

Of N flights of our scheme that are certified, from the schema (`python -m tools.drawn`), each certificate is
checked; then A times one number, index or frame of one of them is altered, drawn by the seed: as it is, and
with the digest written again, so that only what is recomputed is left to refuse it. Exit status 1 where a
true certificate is refused or an altered one accepted, or where a second reader (tools/drawn/reader.py)
differs.
"""

import argparse
import copy
import json
from collections import Counter
from collections.abc import Iterator
from time import process_time
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc_assurance.certificates.certificate import (
    EvidenceColumns,
    as_text,
    certificate,
    copy_with_columns,
    event_rows,
    logged_columns,
    with_digest,
)
from beaver_ftc_assurance.certificates.check_certificate import failures
from beaver_ftc_assurance.certificates.tape import Recorder
from tools.drawn.campaign import AIRCRAFT
from tools.drawn.compose import OURS, PLAIN, drawn_flights
from tools.drawn.reader import doubts

Document = dict[str, Any]
Times = list[tuple[float, float]]
SCALED = 1.01  # times a number that is altered


def main() -> None:
    """Fly, check, alter, and say how often what came out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--altered", type=int, default=100)
    args = parser.parse_args()
    rng, count, sizes, unseen = np.random.default_rng(args.seed), Counter(), [0], Counter()
    without: Counter[str] = Counter()
    ms: Times = []
    for index, written, log, scenario in certified(args.seed, args.flights, ms):
        refused = [*failures(written, log, scenario)]
        count["flights"] += 1
        count["statements"] += len(written["statements"])
        count["not certified"] += len(written["without"])
        without.update(f"{_kind(said)}: {said['because']}" for said in written["without"])
        count["refused"] += bool(refused)
        doubted = [*doubts(written, log, scenario)]
        count["doubted by a second reader"] += bool(doubted)
        sizes.append(len(as_text(written)))
        if refused or doubted:
            print(f"{index}: {'; '.join([*refused, *doubted])[:300]}", flush=True)
        due = -(-args.altered * count["flights"] // args.flights) - count["altered"]
        for place in drawn_places(rng, written, due):
            count["altered"] += 1
            other = altered(written, place)
            count["accepted"] += not [*failures(other, log, scenario)]
            resealed = with_digest(other)
            accepts = not [*failures(resealed, log, scenario)]
            if accepts == bool([*doubts(resealed, log, scenario)]):
                count["readers disagree"] += 1
                print(f"{index}: {place}: accepted by {'the first' if accepts else 'the second'}", flush=True)
            if accepts:
                unseen[" ".join(str(part) for part in place if not isinstance(part, int))] += 1
    print(*(f"{word} {n}" for word, n in count.items()), f"largest {max(sizes)} bytes", sep=", ")
    kept, wrote = np.median(ms, axis=0) if ms else (0.0, 0.0)
    print(f"of the processor {kept:.1f} ms to keep the frames, {wrote:.1f} ms to write it (medians)")
    for reason, n in without.most_common():
        print(f"{n:6d} without: {reason}")
    print(f"with the digest written again {unseen.total()} accepted:", dict(unseen.most_common()))
    wrong = ("refused", "doubted by a second reader", "accepted", "readers disagree")
    raise SystemExit(1 if any(count[word] for word in wrong) or unseen else 0)


def _kind(said: Document) -> str:
    """Of which kind an event is."""
    return "alarm" if said["what"] is None else "exclusion" if said["column"] else "type"


def certified(
    seed: int, flights: int, ms: Times
) -> Iterator[tuple[int, Document, dict[str, np.ndarray], str]]:
    """So many flights of our scheme: number, certificate as it is read back, log, scenario.

    ms: what they took.
    """
    found = 0
    for drawn in drawn_flights(seed, AIRCRAFT, kinds=(OURS, PLAIN, PLAIN)):
        try:
            flight = bf.fly(drawn.scenario())
        except bf.BadInput:
            continue
        document, evidence = timed(flight, ms)
        log = Columns()
        copy_with_columns(flight._log_or_raise(), evidence, log)
        log.close()
        yield drawn.index, json.loads(as_text(document)), dict(log), to_yaml(flight.scenario)
        found += 1
        if found == flights:
            return


def timed(flight: bf.Flight, ms: Times) -> tuple[Document, EvidenceColumns]:
    """A flight's certificate and the columns that prove it; ms: of the processor, what keeping its frames
    adds, and to write it."""
    rows, scenario = logged_columns(flight._log_or_raise()), flight.scenario
    if not event_rows(rows):
        return certificate(scenario, flight._log_or_raise())
    recorder, began = Recorder(scenario), process_time()
    fly(scenario)
    plain = process_time()
    fly(scenario, watch=recorder.watch)
    flown = process_time()
    found = certificate(scenario, flight._log_or_raise(), recorder)
    ms.append((1e3 * (flown - plain - (plain - began)), 1e3 * (process_time() - flown)))
    return found


def places(node: Any, place: tuple = ()) -> Iterator[tuple]:
    """Where numbers stand in a document; words are none."""
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*place, key))
    elif isinstance(node, int | float):
        yield place


def drawn_places(rng: np.random.Generator, certificate: Document, n: int) -> list[tuple]:
    """So many of them, drawn, where there are statements."""
    known = [*places(certificate)] if certificate["statements"] else []
    return [known[i] for i in rng.integers(len(known), size=n)] if known else []


def altered(certificate: Document, place: tuple) -> Document:
    """The same with one number altered: a frame or index by one, a number by a hundredth."""
    other = copy.deepcopy(certificate)
    node = other
    for key in place[:-1]:
        node = node[key]
    value = node[place[-1]]
    if isinstance(value, int):
        node[place[-1]] = value + 1
    else:
        node[place[-1]] = value * SCALED if value else 1e-3
    return other


if __name__ == "__main__":
    main()
