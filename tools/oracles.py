"""Flights that must stay equal to the bit through a rebuild: fingerprints of their logs and metrics.

    python -m tools.oracles write FILE [--every N]
    python -m tools.oracles compare FILE FILE

Every built-in scenario with every law and scheme of this package, at three frame rates; with --every N, each
N-th of them. What commands print is compared by `make docs-check` and `tests/kept`. Fingerprints differ
between machines: write both files on one.
"""

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import islice, product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.documents.files import read_json
from beaver_ftc.plugins import DETECTORS, LAWS
from tools.drawn.factors import registered_of

RATES_HZ = (50.0, 100.0, 200.0)
AT_MOST_S = 65.0  # of a mission
Case = tuple[str, str, str, float]


def cases() -> Iterator[Case]:
    """Scenario, law, scheme and frame rate of each flight."""
    return product(bf.scenarios(), registered_of(LAWS), registered_of(DETECTORS), RATES_HZ)


def changed(name: str, law: str, scheme: str, rate_hz: float) -> bf.Scenario:
    """A built-in scenario, said otherwise, no longer than AT_MOST_S. Raises BadInput."""
    given = bf.load(name)
    keys: dict[str, Any] = {"control.law": law, "fdi.scheme": scheme, "rate_hz": rate_hz, "expect": {}}
    if given.duration_s > AT_MOST_S:
        keys["duration_s"] = AT_MOST_S
    return given.with_(keys)


def fingerprint(case: Case) -> str:
    """Of the bytes of a flight's log and of its metrics; or what it ended with."""
    try:
        flight = bf.fly(changed(*case))
    except (bf.BadInput, bf.SimulationFailed) as error:
        return str(error)
    columns = b"".join(np.ascontiguousarray(column).tobytes() for _, column in flight.log.items())
    said = json.dumps([[*flight.log.columns], {**flight.metrics, "versions": None}])
    return hashlib.sha256(columns + said.encode()).hexdigest()[:16]


def write(file: Path, every: int) -> None:
    """Fingerprint the flights, into a file."""
    flown, found = list(islice(cases(), 0, None, every)), {}
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for case, said in zip(flown, pool.map(fingerprint, flown), strict=True):
            found[" ".join(map(str, case))] = said
            print(f"\r{len(found)} of {len(flown)}", end="", file=sys.stderr)
    file.write_text(json.dumps(found, indent=0), encoding="utf-8")


def compare(one: Path, other: Path) -> int:
    """Print which flights differ among those of both files; the exit status."""
    first, second = map(read_json, (one, other))
    both = sorted(first.keys() & second.keys())
    differing = [name for name in both if first[name] != second[name]]
    print(*differing, f"{len(both)} in both, {len(differing)} differ", sep="\n")
    return int(bool(differing) or not both)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=("write", "compare"))
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--every", type=int, default=1)
    asked = parser.parse_args()
    if asked.do == "compare":
        sys.exit(compare(*asked.files))
    write(asked.files[0], asked.every)


if __name__ == "__main__":
    main()
