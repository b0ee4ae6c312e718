"""Code that may crash, tried in a child, and the answer kept.

Code that reads memory by addresses, or borrows from inside another package, may crash with a build that it
does not fit. A crash cannot be caught, but a child's crash is an answer.
"""

import contextlib
import hashlib
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from beaver_ftc.documents.files import PACKAGE, cache_base, read_own

PASSED, FAILED = b"passed", b"failed"
NO = 3  # the status of a child that has found out that it does not
PATIENCE_S = 120.0  # on the clock: a busy machine may need that long to begin


def passes(name: str, build: str, code: str, environment: Mapping[str, str] | None = None) -> bool:
    """Whether a child that runs this code ends well: with status 0, and not with NO or by a signal.

    build: the versions and files that the answer is of. A child that ends otherwise found no answer: where it
    is started again another may.
    """
    base = cache_base()
    if base is None:
        return bool(_passes_now(code, environment or {}))
    subject = hashlib.sha256(f"{build} {code}".encode()).hexdigest()[:16]
    file = base / f"trial-{name}-{subject}"
    answer = _kept(file)
    if answer is None:
        answer = _passes_now(code, environment or {})
        if answer is not None:
            _keep(file, answer)
    return bool(answer)


def _kept(file: Path) -> bool | None:
    """The answer of an earlier process; None if there is none, or if another user may have written it."""
    try:
        content, why_refused = read_own(file)
    except OSError:
        return None
    return None if why_refused else {PASSED: True, FAILED: False}.get(content)


def _keep(file: Path, answer: bool) -> None:
    with contextlib.suppress(OSError):
        partial = file.with_name(f"{file.name}.{os.getpid()}")
        partial.write_bytes(PASSED if answer else FAILED)
        partial.replace(file)


def _passes_now(code: str, environment: Mapping[str, str]) -> bool | None:
    """None where no child can be started, or it does not end: another process may have more luck."""
    paths = (str(PACKAGE.parent), os.environ.get("PYTHONPATH", ""))  # never the working directory
    around = {**os.environ, **environment, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code],
            env=around,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=PATIENCE_S,
            check=False,
        )
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return None
    return done.returncode == 0 if done.returncode in (0, NO) or done.returncode < 0 else None
