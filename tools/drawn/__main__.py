"""Whole scenarios drawn from the schema, flown: which promise does a flight break?

    python -m tools.drawn [--flights N] [--seed S] [--shrink]

Row by row of covering arrays of everything a scenario may say (`tools/drawn`), so that any two choices meet.
Flight I of a seed is the same whatever else is flown. Each flight is held against what it promises (exit, no
false alarm, nothing true excluded, nothing wrong named, no later than said), every third is flown again from
its saved text with a log. What breaks is written to runs/drawn-flights; with `--shrink`, with as much left
out as still breaks.
"""

import argparse
import time
from collections import Counter
from itertools import islice
from pathlib import Path

from tools.drawn.campaign import AIRCRAFT, fly, keep_it
from tools.drawn.compose import drawn_flights

KEPT = Path("runs/drawn-flights")
WORDS = ("flights", "refused", "detected", "named", "broken")


def main() -> None:
    """Fly, print the broken promises, and how often each is broken."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shrink", action="store_true", help="leave out what is not needed to break it")
    args = parser.parse_args()
    began, count, kinds = time.monotonic(), Counter(dict.fromkeys(WORDS, 0)), Counter()
    for flight in islice(drawn_flights(args.seed, AIRCRAFT), args.flights):
        outcome = fly(flight)
        count["flights"] += 1
        for word in WORDS[1:]:
            count[word] += bool(getattr(outcome, word))
        kinds.update({line.partition(":")[0] for line in outcome.broken})
        if outcome.broken:
            print(f"{outcome.index}: {'; '.join(outcome.broken)[:300]}", flush=True)
            keep_it(KEPT, flight, outcome, args.shrink)
    took_s = time.monotonic() - began
    print(*(f"{word} {count[word]}" for word in WORDS), sep=", ")
    print(*(f"{kind}: {n}" for kind, n in kinds.most_common()), sep="\n")
    print(f"{took_s:.0f} s, {took_s / max(count['flights'], 1):.3f} s a flight")
    raise SystemExit(1 if count["broken"] else 0)


if __name__ == "__main__":
    main()
