"""A trial of library.py with a version of Numba that is not known, in a process of its own.

What is borrowed from inside another version may end a process instead of raising. So kernels are compiled and
called in a child; the answer is kept beside the compiled code.
"""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import llvmlite
import numba

from beaver_ftc.documents.paths import cache_base, read_own

VARIABLE = "BEAVER_FTC_COMPILER"
PASSED, FAILED = b"passed", b"failed"
PATIENCE_S = 120.0
CODE = "import beaver_ftc.compiled.trial as trial; trial.run()"


def passes() -> bool:
    """Whether kernels compiled so are right, as found now or by an earlier process."""
    base = cache_base()
    if base is None:
        return _passes_now()
    file = base / f"trial-{numba.__version__}-{llvmlite.__version__}-{sys.implementation.cache_tag}"
    answer = _answer_in(file)
    if answer is None:
        answer = PASSED if _passes_now() else FAILED
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)  # of another user, or a link
            file.write_bytes(answer)
    return answer == PASSED


def _answer_in(file: Path) -> bytes | None:
    try:
        content, why_refused = read_own(file)
    except OSError:
        return None
    return content if not why_refused and content in (PASSED, FAILED) else None


def _passes_now() -> bool:
    environment = {**os.environ, VARIABLE: "trial"}
    try:
        done = subprocess.run(
            [sys.executable, "-c", CODE],
            env=environment,
            capture_output=True,
            timeout=PATIENCE_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and done.stdout.split() == [PASSED]


def run() -> None:
    """Compile kernels that call one another, and compare them with their plain form."""
    import numpy as np

    from beaver_ftc.compiled import compile_into

    def scale(x, by):
        x[:] = x / by

    def weigh(record, x):
        scaled(x, record.level)
        return np.sqrt(x[0] * x[1]) + record.state.sum()

    def total(records, x):
        found = 0.0
        for record in records:
            for i in range(2):
                found += weighed(record, x[i]) + max(x[i, 0], found)
        return found

    def refuse(x):
        scaled(x[:2], x[1])
        if x[0] > 0.0:
            raise ValueError("greater than zero")
        return x[0]

    compiled = [compile_into(None, function) for function in (scale, weigh, total, refuse)]
    scaled, weighed, totalled, refused = compiled
    records = np.ones(2, [("level", "f8"), ("state", "f8", (2, 3))])
    records["level"] = 2.0, 0.0
    x = np.arange(1.0, 5.0).reshape(2, 2)
    again = x.copy()
    first = totalled(records, x), weighed(records[0], x[0]), refused(np.array([-1.0, 2.0]))
    scaled, weighed = scale, weigh
    with np.errstate(all="ignore"):
        second = total(records.view(np.recarray), again), weigh(records.view(np.recarray)[0], again[0]), -0.5
    try:
        refused(np.array([1.0, 1.0]))
    except ValueError as error:
        if str(error) == "greater than zero" and np.array_equal([*first, *x[0]], [*second, *again[0]], True):
            print(PASSED.decode())
