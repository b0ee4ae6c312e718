"""What must stay equal to the bit through a rebuild: fingerprints of logs, metrics, studies and words.

    python -m tools.oracles write FILE [--what flights,studies,words] [--every N] [--workers W]
    python -m tools.oracles compare FILE FILE

`flights`: every built-in scenario x law x scheme, at three frame rates. `studies`: each study's documents on
a small grid. `words`: help, schema, lists, verdicts.
--every N: each N-th of the flights alone. Fingerprints differ between machines: write both files on one.
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import yaml

LAWS = ("nominal", "adaptive", "fault-tolerant", "fault-tolerant-published", "oracle", "oracle-published",
        "indi", "l1-adaptive", "lqr")  # fmt: skip
SCHEMES = ("adaptive-estimators", "none", "rls-monitor", "augmented-ekf", "augmented-ukf", "multiple-models",
           "observer-constant")  # fmt: skip
RATES_HZ = (50.0, 100.0, 200.0)
AT_MOST_S = 65.0  # of a mission
VARYING = re.compile(
    r'"?\b(wall_s|elapsed_s|seconds|took_s|wall_time_s|created|date|version|cpu_s|commit|real_time_factor'
    r'|times_real_time|flight code|code|us)"?\s*[:=]\s*[^,}\n]*'
)
SMALL_SWEEP = {
    "name": "small", "base": "elevator-partial-loss", "set": {"duration_s": 15}, "runs": 12, "seed": 3,
    "vary": {"faults[0].magnitude": {"uniform": [0.05, 1.0]}, "initial.airspeed_mps": {"uniform": [38, 52]}},
    "expect": {"failure_rate": {"at_most": 0}},
}  # fmt: skip
COMMAND = "from beaver_ftc.cli.main import main; main()"
KINDS = (".json", ".txt", ".md", ".csv")
STUDIES: dict[str, tuple[str, ...]] = {
    "sweep": ("sweep", "small.yaml", "--format", "json"),
    "sweep text": ("sweep", "small.yaml", "--no-report"),
    "search": ("sweep", "small.yaml", "--search", "delay", "--format", "json"),
    "verify": ("verify", "--hours", "0.05", "--faults", "6", "--format", "json"),
    "verify steps": ("verify", "--hours", "0.02", "--faults", "3", "--steps"),
    "detectability grid": ("detectability", "--grid", "quick", "--schemes", "observer-constant",
                           "--turbulence", "none"),
    "compare": ("compare", "--sweep", "small.yaml", "--schemes", "adaptive-estimators,observer-constant",
                "--laws", "nominal,fault-tolerant", "--flights", "4"),
    "matrix": ("matrix", "--airspeed", "45"),
    "matrix declared": ("matrix", "--declared", "--airspeed", "45", "--format", "json"),
    "matrix pitch": ("matrix", "--pitch-lost", "--airspeed", "45"),
    "detectability": ("detectability", "elevator-partial-loss"),
    "mismatch": ("mismatch", "elevator-partial-loss", "--variant", "declared,linearised,mass=1.1"),
    "mismatch two": ("mismatch", "fault-free", "unanticipated", "--format", "json", "--no-report"),
    "mismatch map": ("mismatch", "fault-free", "--map", "--no-report"),
    "reproduce": ("reproduce",),
    "linearise": ("linearise",),
    "linearise json": ("linearise", "--format", "json"),
    "trim": ("trim",),
}  # fmt: skip
WORDS: tuple[tuple[str, ...], ...] = (("schema",), ("list",), ("list", "--format", "json"), ("--help",))


def digest(content: bytes) -> str:
    """A short fingerprint."""
    return hashlib.sha256(content).hexdigest()[:16]


def changed(name: str, law: str, scheme: str, rate_hz: float) -> dict[str, Any]:
    """A built-in scenario, said otherwise, no longer than AT_MOST_S."""
    import beaver_ftc as bf

    data = bf.load(name).model_dump(mode="json", by_alias=True, exclude_unset=True)
    data["control"] = {**data.get("control", {}), "law": law}
    data["fdi"] = {**data.get("fdi", {}), "scheme": scheme}
    data["rate_hz"] = rate_hz
    data.pop("expect", None)
    if bf.load(name).duration_s > AT_MOST_S:
        data["duration_s"] = AT_MOST_S
        data.pop("gates", None)
    return data


def flown(words: dict[str, Any]) -> dict[str, str]:
    """Fingerprints of a flight's log, column by column, and its metrics; or what it ended with."""
    import beaver_ftc as bf

    try:
        flight = bf.fly(words)
    except (bf.BadInput, bf.SimulationFailed) as error:
        return {"ended": str(error)}
    log = flight.log
    columns = {
        str(name): digest(np.ascontiguousarray(log[name].to_numpy()).tobytes()) for name in log.columns
    }
    metrics = VARYING.sub("", json.dumps(flight.metrics, sort_keys=True))
    return {"columns": digest(json.dumps(columns).encode()), "metrics": digest(metrics.encode()),
            "words": digest(VARYING.sub("", str(flight)).encode())}  # fmt: skip


def _flight(case: tuple[str, str, str, float]) -> tuple[str, dict[str, str]]:
    return "flights/" + " ".join(map(str, case)), flown(changed(*case))


def _study(name: str, arguments: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "small.yaml").write_text(yaml.safe_dump(SMALL_SWEEP), encoding="utf-8")
        told = subprocess.run(
            [sys.executable, "-c", COMMAND, *arguments],
            check=False, cwd=place, capture_output=True, text=True, env=os.environ | {"COLUMNS": "100"},
        )  # fmt: skip
        found = {"exit": str(told.returncode), "says": _text(told.stdout, place)}
        for file in sorted(p for p in place.rglob("*") if p.is_file() and p.suffix in KINDS):
            found[str(file.relative_to(place))] = _text(
                file.read_text(encoding="utf-8", errors="replace"), place
            )
        return name, found


def _text(text: str, place: Path) -> str:
    lines = VARYING.sub("", text.replace(str(place), "")).splitlines()
    return digest(
        "\n".join(line for line in lines if "took" not in line and "ms a flight" not in line).encode()
    )


def commands() -> list[str]:
    """The names of the commands."""
    from typer.main import get_command

    from beaver_ftc.cli.main import app

    return sorted(get_command(app).commands)  # type: ignore[attr-defined]


def jobs(what: set[str], every: int) -> Iterator[Any]:
    """What there is to fingerprint, as calls."""
    import beaver_ftc as bf

    if "studies" in what:
        yield from (partial(_study, f"studies/{name}", arguments) for name, arguments in STUDIES.items())
    if "words" in what:
        helps = [(name, "--help") for name in commands()]
        verdicts = [("run", name, "--no-report") for name in bf.scenarios()]
        yield from (partial(_study, "words/" + " ".join(a), a) for a in (*WORDS, *helps, *verdicts))
    if "flights" in what:
        cases = list(product(bf.scenarios(), LAWS, SCHEMES, RATES_HZ))
        yield from (partial(_flight, case) for case in cases[::every])


def write(file: Path, what: set[str], every: int, workers: int) -> None:
    """Fingerprint everything asked for, into a file."""
    found = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for name, prints in pool.map(_call, jobs(what, every)):
            found[name] = prints
            print(f"\r{len(found)} {name:60.60}", end="", file=sys.stderr)
    file.write_text(json.dumps(found, indent=0, sort_keys=True), encoding="utf-8")


def _call(job: Any) -> Any:
    return job()


def compare(one: Path, other: Path) -> int:
    """Print what differs among what both have; the exit status."""
    first, second = (json.loads(path.read_text(encoding="utf-8")) for path in (one, other))
    both = sorted(first.keys() & second.keys())
    differing = [name for name in both if first[name] != second[name]]
    for name in differing:
        keys = sorted(first[name].keys() | second[name].keys())
        print(name, *(key for key in keys if first[name].get(key) != second[name].get(key)))
    print(f"{len(both)} in both, {len(differing)} differ")
    return 1 if differing or not both else 0


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("do", choices=("write", "compare"))
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--what", default="flights,studies,words")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    if args.do == "compare":
        sys.exit(compare(*args.files))
    write(args.files[0], set(args.what.split(",")), args.every, args.workers)


if __name__ == "__main__":
    main()
