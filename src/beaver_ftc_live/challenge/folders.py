"""The folders of a challenge.

DIR/public/       for the students: rules, practice flights, an example detector and an example law
DIR/teacher/      hidden flights: sweep files with new random seeds, readable for their owner alone
DIR/submissions/  NAME-1.py, NAME-2.py ...: the last one of a name counts
DIR/grades/       the results of `grade`
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
HEALTHY_SHARE = 4  # one of so many hidden flights has no fault
_HANDOUT = Path(__file__).with_name("handout")
_NAME = re.compile(r"[A-Za-z0-9_-]{1,40}", re.ASCII)
_FILE = re.compile(r"([A-Za-z0-9_-]{1,40}?)-([1-9][0-9]{0,5})\.py", re.ASCII)
_OTHERS = 0o077  # permissions of all but the owner
# Smallest seed of hidden flights. A submission sees the trim, which depends on the seed, and could try all
# smaller seeds.
_SEEDS = 2**40


@dataclass(frozen=True)
class Submission:
    """A submitted file, with the SHA-256 of its content."""

    student: str
    file: Path
    digest: str


def new(folder: Path, flights: int, rules: Mapping[str, float]) -> None:
    """Write a challenge with so many hidden flights into a new or empty folder. Raises BadInput for another
    folder.

    rules: limits and points in the rules for the students (`grading.rules`).
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
    """The text of each file for the students, by its name."""
    texts = {
        path.name.removesuffix(".txt"): path.read_text(encoding="utf-8")
        for path in _HANDOUT.iterdir() if path.suffix in (".md", ".txt")
    }  # fmt: skip
    texts["README.md"] = texts["README.md"].format(**rules)
    for kind in ("healthy", "loss"):
        texts[f"practice-{kind}.yaml"] = _flights(kind, "practice", PRACTICE_RUNS, PRACTICE_SEED)
    return texts | {"practice.yaml": _base().replace("fdi: {", "fdi: {scheme: smoothed-surprise, ")}


def _flights(kind: str, name: str, runs: int, seed: int) -> str:
    """The sweep file of so many flights. kind: `healthy` or `loss`."""
    return (_HANDOUT / f"{kind}.yaml").read_text(encoding="utf-8").format(name=name, runs=runs, seed=seed)


def _base() -> str:
    """The scenario that the practice flights vary."""
    text = _flights("loss", "practice", 1, PRACTICE_SEED)
    return dedent(text.partition("\nbase:\n")[2].partition("\nruns:")[0]) + "\n"


def practice() -> "Scenario":
    """The practice flight with which `submit` checks a submission."""
    from beaver_ftc.documents import parse_yaml as parse
    from beaver_ftc.scenario import load

    return load(parse(_base()).data)


def hidden_flights(challenge: Path) -> list["Scenario"]:
    """The flights of all sweep files in the folder of the teacher. Raises BadInput if there is none, if
    others or a submission may read it, or if its seed is small enough to be found."""
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
        if any(path.resolve().is_relative_to(folder) for folder in readable()):
            raise BadInput(f"challenge grade: {path}: lies among Python's packages, allowed: another folder")
    for path in files:
        if load_sweep(path).file.seed < _SEEDS:
            raise BadInput(
                f"challenge grade: {path}: seed: a submission could find it, allowed: random, from {_SEEDS}"
            )
    return [case.scenario for path in files for case in of_sweep(path)]


def source_of(path: Path) -> str:
    """The text of a submission: of a file, or of the only Python file of a folder. Raises BadInput for
    another path, a file that is too large, and one that is not UTF-8."""
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
    """Write a submission with the next number of this student, and return its path. Raises BadInput if the
    folder is no challenge."""
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
    """The name of a student. Raises BadInput if it cannot be the name of a file."""
    if not _NAME.fullmatch(name):
        raise BadInput(
            f"challenge submit: --student {name[:60]!r}, allowed: letters, digits, - and _, at most 40"
        )
    return name


def submissions(challenge: Path) -> list[Submission]:
    """The last submission of each student, sorted by name. Raises BadInput if there is none."""
    last: dict[str, tuple[int, Path]] = {}
    for student, number, path in _numbered(challenge / SUBMISSIONS):
        last[student] = max(last.get(student, (0, path)), (number, path))
    if not last:
        raise BadInput(
            f"challenge grade: {challenge / SUBMISSIONS}: no submissions, allowed: files NAME-1.py"
        )
    return [Submission(student, path, _digest(path)) for student, (_, path) in sorted(last.items())]


def _numbered(folder: Path) -> Iterator[tuple[str, int, Path]]:
    """Student, number and path of each submission."""
    for path in sorted(folder.glob("*.py")):
        if matched := _FILE.fullmatch(path.name):
            yield matched[1], int(matched[2]), path


def _digest(path: Path) -> str:
    """SHA-256 of a regular file; of an empty text for any other path."""
    return hashlib.sha256(path.read_bytes() if path.is_file() and not path.is_symlink() else b"").hexdigest()
