"""Certificates of drawn flights: does the checker accept all, and refuse each that is altered?

    python -m tools.drawn.certificates [--flights N] [--seed S] [--altered A]

Of N flights of our scheme that are certified, from the schema (`python -m tools.drawn`), each certificate is
checked; then A times one number, index or frame of one of them is altered, drawn by the seed: as it is, and
with the digest written again, so that only what is recomputed is left to refuse it. Exit status 1 where a
true certificate is refused or an altered one accepted.
"""

import argparse
import copy
import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.scenario.builtin import to_yaml
from beaver_ftc_assurance.certificates.certificate import as_text, with_digest
from beaver_ftc_assurance.certificates.check_certificate import failures
from tools.drawn.campaign import AIRCRAFT
from tools.drawn.compose import OURS, PLAIN, drawn_flights

Document = dict[str, Any]
SCALED = 1.01  # times a number that is altered


def main() -> None:
    """Fly, check, alter, and say how often what came out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--altered", type=int, default=100)
    args = parser.parse_args()
    rng, sizes = np.random.default_rng(args.seed), [0]
    count, unseen, without = Counter[str](), Counter[str](), Counter[str]()
    for index, written, log, scenario in certified(args.seed, args.flights):
        refused = [*failures(written, log, scenario)]
        count["flights"] += 1
        count["statements"] += len(written["statements"])
        count["not certified"] += len(written["without"])
        without.update(f"{_kind(said)}: {said['because']}" for said in written["without"])
        count["refused"] += bool(refused)
        sizes.append(len(as_text(written)))
        if refused:
            print(f"{index}: {'; '.join(refused)[:300]}", flush=True)
        due = -(-args.altered * count["flights"] // args.flights) - count["altered"]
        for place in drawn_places(rng, written, due):
            count["altered"] += 1
            other = altered(written, place)
            count["accepted"] += not [*failures(other, log, scenario)]
            if not [*failures(with_digest(other), log, scenario)]:
                unseen[" ".join(str(part) for part in place if not isinstance(part, int))] += 1
    print(*(f"{word} {n}" for word, n in count.items()), f"largest {max(sizes)} bytes", sep=", ")
    for reason, n in without.most_common():
        print(f"{n:6d} without: {reason}")
    print(f"with the digest written again {unseen.total()} accepted:", dict(unseen.most_common()))
    raise SystemExit(bool(count["refused"] or count["accepted"] or unseen))


def _kind(said: Document) -> str:
    """Of which kind an event is."""
    return "alarm" if said["what"] is None else "exclusion" if said["column"] else "type"


def certified(seed: int, flights: int) -> Iterator[tuple[int, Document, dict[str, np.ndarray], str]]:
    """So many flights of our scheme: number, certificate as it is read back, log, scenario."""
    found = 0
    for drawn in drawn_flights(seed, AIRCRAFT, kinds=(OURS, PLAIN, PLAIN)):
        try:
            flight = bf.fly(drawn.scenario())
        except bf.BadInput:
            continue
        proof = flight.proof()
        yield drawn.index, json.loads(as_text(proof.certificate)), proof.log, to_yaml(flight.scenario)
        found += 1
        if found == flights:
            return


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
