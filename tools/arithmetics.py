"""Do other processors find what is kept? `python -m tools.arithmetics [--only NAME]`

Runs the tests that compare results of flights with kept ones once in each arithmetic that one machine can
give, each in a child process: other instructions for compiled kernels, other functions of the C library,
other sums of NumPy and of linear algebra. Prints a row an arithmetic: what differs from the kept results, by
how much. Numba keeps the machine code of each processor and set of instructions apart.

The last digits of a flight are those of one machine and one build: a test that fails in one arithmetic and
not in another hangs on them. Exit status 1 if a test fails.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
ARITHMETICS = {
    "as it is": {},
    "generic processor": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
    "Haswell": {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "+avx2,+fma"},
    "kernels without FMA": {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": "-fma"},
    "C library without FMA": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"},
    "NumPy without x86-64-v3": {"NPY_DISABLE_CPU_FEATURES": "X86_V3"},
    "linear algebra of Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
}
FLIGHTS = "tests/loop/test_compiled_as_plain.py"
_HEAD = (
    "|arithmetic|tests passed|numbers that differ|largest, in tolerances|largest beside 0|other values|",
    "|---|---|---|---|---|---|",
)
_TO = "BEAVER_FTC_ARITHMETICS"  # the file into which a child writes: a line a value or a failed test


def pytest_sessionstart() -> None:
    """In the child, as a plug-in of pytest: a kept value that is not found to the last digit is written."""
    import kept

    kept.TOLD.append(lambda path, *rest: _write(["value", path, *rest]))


def pytest_runtest_logreport(report: Any) -> None:
    """In the child: a test that has run is written, and how it ended."""
    if report.when == "call" or report.failed:
        _write(["test", report.nodeid, report.outcome])


def _write(row: list[Any]) -> None:
    with Path(os.environ[_TO]).open("a") as file:
        print(json.dumps(row), file=file)


def _flown(settings: dict[str, str]) -> list[list[Any]]:
    """What the tests compared under these settings of the environment, a row a value or a test."""
    with tempfile.TemporaryDirectory() as folder:
        to = Path(folder) / "rows"
        to.touch()
        command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "tools.arithmetics", FLIGHTS]
        environment = {**os.environ, **settings, _TO: str(to)}
        said = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        rows = [json.loads(line) for line in to.read_text().splitlines()]
        if not any(kind == "test" for kind, *_ in rows):
            raise SystemExit(f"no test ran:\n{said.stdout}{said.stderr}")
        return rows


def _row(name: str, rows: list[list[Any]]) -> str:
    """The row of a setting: tests passed, numbers compared, and by how much they differ."""
    values = [row[1:] for row in rows if row[0] == "value"]
    ends = [row[2] for row in rows if row[0] == "test"]
    numbers = [(was, now) for _, was, now, _ in values if isinstance(was, float) and isinstance(now, float)]
    shares = [share for *_, share in values if share is not None]
    zeros = [abs(was - now) for was, now in numbers if not (was and now)]
    cells = [
        f"{ends.count('passed')} of {len(ends)}",
        len(numbers),
        f"{max(shares, default=0.0):.1e}",
        f"{max(zeros, default=0.0):.1e}",
        len(values) - len(numbers),
    ]
    return "|".join(["", name, *map(str, cells), ""])


def _wrong(rows: list[list[Any]]) -> Iterator[str]:
    """Yield a line for each test that fails, and each value that differs by more than the test allows."""
    for kind, where, *rest in rows:
        if kind == "value" and (rest[2] is None or rest[2] > 1.0):
            yield f"  {where}: {str(rest[0])[:80]} -> {str(rest[1])[:80]}"
        elif kind == "test" and rest == ["failed"]:
            yield f"  failed: {where}"


def main() -> int:
    """Exit status 1 if a test fails in any arithmetic."""
    parser = argparse.ArgumentParser(prog="python -m tools.arithmetics", description=__doc__)
    parser.add_argument("--only", choices=ARITHMETICS, action="append", metavar="NAME")
    asked = parser.parse_args()
    print(*_HEAD, sep="\n")
    wrong: list[str] = []
    for name in asked.only or ARITHMETICS:
        rows = _flown(ARITHMETICS[name])
        print(_row(name, rows), flush=True)
        wrong += [f"{name}:", *found] if (found := list(_wrong(rows))) else []
    print(*wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
