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
from collections.abc import Iterator
from contextlib import suppress
from functools import reduce
from operator import getitem

import numpy as np

import beaver_ftc as bf
from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc_assurance.certificates import check_certificate as checker
from beaver_ftc_assurance.certificates.certified import as_text, with_digest
from tools.drawn.campaign import AIRCRAFT
from tools.drawn.compose import OURS, PLAIN, drawn_flights
from tools.drawn.forge import Document, Log, forgeries, places

SCALED = 1.01  # times a number that is altered
SIDES = "the stated sides are not the recomputed ones"


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


if __name__ == "__main__":
    main()
