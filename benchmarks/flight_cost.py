"""What a flight costs beside flying, taken apart, in five kinds of flight.

    python benchmarks/flight_cost.py [--rounds N] [--record FILE | --check FILE]

Each round flies every kind once and then lets JSBSim alone fly as many frames of the same aircraft, in the
same air, surfaces held; ratios are formed within a round, medians over the rounds. A flight in a sweep is all
that `sweep` does for one: scenario, aircraft, trim, record, frames, metrics, row. The trim is a new one each
time.

`--check benchmarks/ratios.json` measures in pairs: the code of the revision that the file was recorded with,
and today's, in turn. It ends with status 1 if a ratio of today's is over a tenth above its partner, and still
is when all is measured again. The recorded numbers themselves are of one machine: on another, what surrounds
the frames has been seen to cost twice as much beside the same frames.
"""

import argparse
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.files import read_json
from beaver_ftc.studies.bench.sweep_flights import by_kind

HERE = Path(__file__).resolve()
ROOT = HERE.parents[1]
ALLOWED_RISE = 0.10
PAIRS = 4


def git(*words: str) -> bytes:
    """What git says of this checkout."""
    return subprocess.run(["git", "-C", str(ROOT), *words], check=True, capture_output=True).stdout


def unpack(revision: str, folder: Path) -> Path:
    """The code of a revision, in a new folder."""
    with tarfile.open(fileobj=io.BytesIO(git("archive", revision))) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)  # from Python 3.11.4 on
        archive.extractall(folder)
    return folder


def measured_in(tree: Path, rounds: int, cache: Path) -> dict[str, Any]:
    """What the code of a tree costs, measured by its own copy of this file in a process of its own."""
    said = cache.with_suffix(".json")
    subprocess.run(
        [sys.executable, tree / "benchmarks" / HERE.name, "--rounds", str(rounds), "--record", said],
        env=os.environ | {"PYTHONPATH": str(tree / "src"), "XDG_CACHE_HOME": str(cache)},
        check=True,
        capture_output=True,
    )
    return read_json(said)["kinds"]


def rises(revision: str, rounds: int) -> dict[str, float]:
    """Each ratio, over that of the code of a revision: medians of pairs, which take turns to go first."""
    with tempfile.TemporaryDirectory() as folder:
        trees = (unpack(revision, Path(folder) / "then"), ROOT)
        caches = [Path(folder) / name for name in ("then-cache", "now-cache")]
        for tree, cache in zip(trees, caches, strict=True):
            measured_in(tree, 1, cache)  # which compiles: a process that has compiled holds more memory
        seen: list[tuple[dict[str, Any], dict[str, Any]]] = []
        for pair in range(PAIRS):
            found = [{}, {}]
            for which in (0, 1) if pair % 2 else (1, 0):
                found[which] = measured_in(trees[which], rounds, caches[which])
            seen.append((found[0], found[1]))
    return {
        f"{kind}: {name}": float(np.median([now[kind][name] / then[kind][name] for then, now in seen]))
        for kind in seen[0][0]
        for name in ("frames_ratio", "flight_ratio")
    }


def check(revision: str, rounds: int) -> int:
    """Print how far each ratio has risen; 1 if one has by more than is allowed, twice in a row."""
    try:
        git("cat-file", "-e", f"{revision}^{{commit}}")
    except subprocess.CalledProcessError:
        print(f"nothing compared: {revision} is not in this clone (git fetch --unshallow brings it)")
        return 0
    print(f"ratios over those of {revision[:12]}, measured in {PAIRS} pairs of {rounds} rounds")
    risen = []
    for attempt in (1, 2):
        found = rises(revision, rounds)
        for name, factor in found.items():
            print(f"    {name} times {factor:.3f}")
        risen = [name for name, factor in found.items() if factor > 1.0 + ALLOWED_RISE]
        if not risen:
            return 0
        print(f"more than a tenth, attempt {attempt} of 2:", "; ".join(risen))
    return 1


def main() -> int:
    """Print the table; record or check."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--check", type=Path)
    parser.add_argument("--record", type=Path)
    given = parser.parse_args()
    if given.check is not None:
        recorded = read_json(given.check)
        return check(recorded["revision"], given.rounds)
    kinds = by_kind(given.rounds)
    print(f"medians of {given.rounds} rounds, ms")
    for kind, of in kinds.items():
        parts = ", ".join(f"{name} {ms:.2f}" for name, ms in of["parts_ms"].items())
        print(f"{kind}: {parts}; bare frames {of['bare_ms']:.2f}")
        print(
            f"    frames / bare {of['frames_ratio']:.3f}, flight / bare {of['flight_ratio']:.3f}, "
            f"a frame {of['frame_us']:.2f} us, the loop's own part {of['own_part_us']:.2f} of them"
        )
    if given.record:
        revision = git("rev-parse", "HEAD").decode().strip() if (ROOT / ".git").exists() else None
        recorded = json.dumps({"revision": revision, "kinds": kinds}, indent=1)
        given.record.write_text(recorded + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
