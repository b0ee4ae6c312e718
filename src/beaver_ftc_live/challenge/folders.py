"""A challenge on the disk: what is handed out, what is hidden, what comes in.

DIR/public/       for the students: rules, practice flights, a detector and a law to begin with
DIR/teacher/      hidden flights: sweep files with seeds that nobody has drawn before, for their owner alone
DIR/submissions/  NAME-1.py, NAME-2.py ...: the last one of a name counts
DIR/grades/       what `grade` has found
"""

import hashlib
import os
import re
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING

from beaver_ftc.documents import BadInput
from beaver_ftc.results import clear_disk_errors
from beaver_ftc_live.challenge.confine import readable

if TYPE_CHECKING:
    from beaver_ftc.scenario import Scenario

PUBLIC, TEACHER, SUBMISSIONS, GRADES = "public", "teacher", "submissions", "grades"
MOST_BYTES = 64 * 1024
PRACTICE_SEED, PRACTICE_RUNS = 1, 8
HEALTHY_SHARE = 4  # one flight in so many has no fault
_HANDOUT = Path(__file__).with_name("handout")
_NAME = re.compile(r"[A-Za-z0-9_-]{1,40}", re.ASCII)
_FILE = re.compile(r"([A-Za-z0-9_-]{1,40}?)-([1-9][0-9]{0,5})\.py", re.ASCII)
_OTHERS = 0o077
_SEEDS = 2**40  # too many to try: the table of an aircraft's trim shows a submission what a seed has drawn


@dataclass(frozen=True)
class Submission:
    """A file that was handed in; its digest tells one text from another."""

    student: str
    file: Path
    digest: str


def new(folder: Path, flights: int, rules: Mapping[str, float]) -> None:
    """Write a challenge with so many hidden flights into a new or empty folder. Raises BadInput.

    rules: limits and points that the students are told (`grading.rules`).
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BadInput(f"challenge new: {folder} exists, allowed: a new folder, or an empty one")
    with clear_disk_errors(folder):
        for name, mode in ((PUBLIC, 0o755), (SUBMISSIONS, 0o755), (TEACHER, 0o700)):
            (folder / name).mkdir(parents=True, mode=mode)
        for name, text in _public_files(rules).items():
            (folder / PUBLIC / name).write_text(text, encoding="utf-8")
        healthy = max(1, flights // HEALTHY_SHARE)
        for kind, runs in (("healthy", healthy), ("loss", flights - healthy)):
            text = _flights(kind, "hidden", runs, secrets.randbits(62) + 2**62)
            path = os.open(folder / TEACHER / f"{kind}.yaml", os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
            with os.fdopen(path, "w", encoding="utf-8") as file:
                file.write(text)


def _public_files(rules: Mapping[str, float]) -> dict[str, str]:
    shown = {
        path.name.removesuffix(".txt"): path for path in _HANDOUT.iterdir() if path.suffix in (".md", ".txt")
    }
    texts = {name: path.read_text(encoding="utf-8") for name, path in shown.items()}
    texts["README.md"] = texts["README.md"].format(**rules)
    for kind in ("healthy", "loss"):
        texts[f"practice-{kind}.yaml"] = _flights(kind, "practice", PRACTICE_RUNS, PRACTICE_SEED)
    return texts | {"practice.yaml": _base().replace("fdi: {", "fdi: {scheme: smoothed-surprise, ")}


def _flights(kind: str, name: str, runs: int, seed: int) -> str:
    return (_HANDOUT / f"{kind}.yaml").read_text(encoding="utf-8").format(name=name, runs=runs, seed=seed)


def _base() -> str:
    """The scenario that the practice flights vary."""
    text = _flights("loss", "practice", 1, PRACTICE_SEED)
    return dedent(text.partition("\nbase:\n")[2].partition("\nruns:")[0]) + "\n"


def practice() -> "Scenario":
    """The flight that a submission is tried on."""
    from beaver_ftc.documents import parse_yaml as parse
    from beaver_ftc.scenario import load

    return load(parse(_base()).data)


def hidden_flights(challenge: Path) -> list["Scenario"]:
    """The flights of every sweep file of the teacher's part. Raises BadInput, also if others may read it or
    work out its seed."""
    from beaver_ftc.scenario import load_sweep
    from beaver_ftc.studies.compare import of_sweep

    files = sorted((challenge / TEACHER).glob("*.yaml"))
    if not files:
        raise BadInput(
            f"challenge grade: {challenge / TEACHER}: no hidden flights, allowed: what `challenge new` wrote"
        )
    for path in (challenge / TEACHER, *files):
        if os.name == "posix" and path.stat().st_mode & _OTHERS:
            raise BadInput(
                f"challenge grade: {path}: others may read it, allowed: its owner alone (chmod go= {path})"
            )
        if any(path.resolve().is_relative_to(shown) for shown in readable()):
            raise BadInput(f"challenge grade: {path}: lies among Python's packages, allowed: another folder")
    for path in files:
        if load_sweep(path).file.seed < _SEEDS:
            raise BadInput(
                f"challenge grade: {path}: seed: a submission could find it, allowed: random, from {_SEEDS}"
            )
    return [case.scenario for path in files for case in of_sweep(path)]


def source_of(path: Path) -> str:
    """The text of a submission: a file, or the only one of a folder. Raises BadInput."""
    if path.is_dir() and not path.is_symlink():
        files = sorted(path.glob("*.py"))
        if len(files) != 1:
            raise BadInput(f"{path}: {len(files)} Python files, allowed: one")
        return source_of(files[0])
    if path.suffix != ".py" or path.is_symlink() or not path.is_file():
        raise BadInput(f"{path}: is no Python file, allowed: one .py file, or a folder with one")
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise BadInput(f"{path}: is larger than allowed: {MOST_BYTES // 1024} KiB")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        raise BadInput(f"{path}: is not UTF-8 text, allowed: Python source") from None


def keep(source: str, student: str, challenge: Path) -> Path:
    """Put a submission beside those that there are, under the next number. Raises BadInput."""
    folder = challenge / SUBMISSIONS
    if not folder.is_dir():
        raise BadInput(
            f"challenge submit: --to {challenge}: is no challenge, allowed: a folder of `challenge new`"
        )
    number = max((n for name, n, _ in _numbered(folder) if name == student), default=0) + 1
    with clear_disk_errors(folder):
        while True:
            path = folder / f"{student}-{number}.py"
            try:
                with path.open("x", encoding="utf-8", newline="") as file:
                    file.write(source)
                return path
            except FileExistsError:
                number += 1


def check_student(name: str) -> str:
    """A student's name that can be a file's. Raises BadInput."""
    if not _NAME.fullmatch(name):
        raise BadInput(
            f"challenge submit: --student {name[:60]!r}, allowed: letters, digits, - and _, at most 40"
        )
    return name


def submissions(challenge: Path) -> list[Submission]:
    """The last submission of each student, by name. Raises BadInput where there is none."""
    last: dict[str, tuple[int, Path]] = {}
    for student, number, path in _numbered(challenge / SUBMISSIONS):
        last[student] = max(last.get(student, (0, path)), (number, path))
    if not last:
        raise BadInput(
            f"challenge grade: {challenge / SUBMISSIONS}: no submissions, allowed: files NAME-1.py"
        )
    return [Submission(student, path, _digest(path)) for student, (_, path) in sorted(last.items())]


def _numbered(folder: Path) -> Iterator[tuple[str, int, Path]]:
    for path in sorted(folder.glob("*.py")):
        if matched := _FILE.fullmatch(path.name):
            yield matched[1], int(matched[2]), path


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes() if path.is_file() and not path.is_symlink() else b"").hexdigest()
