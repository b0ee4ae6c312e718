"""`beaver-ftc challenge`: hidden flights for a class, what its students hand in, and the grades."""

import os
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli import Format, FormatOption, WorkersOption, answer, progress_bar
from beaver_ftc.commands import declare
from beaver_ftc.documents import BadInput


class Challenge:
    """Grade a class's detectors and laws on hidden flights."""


@declare(plugins=False)
def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR")],
    flights: Annotated[int, typer.Option(min=4, max=200)] = 16,
    format: FormatOption = Format.text,
) -> None:
    """Write a challenge for a class.

    The folder DIR/public is for the students. It contains rules, practice flights, an example detector and an
    example law. The folder DIR/teacher is for you. It contains the hidden flights, with new seeds.

    Examples:
      beaver-ftc challenge new autumn

    folder: New folder for the challenge.
    flights: Number of hidden flights. One flight in four has no fault.
    """
    from beaver_ftc_live.challenge import folders
    from beaver_ftc_live.challenge.grading import rules

    folders.new(folder, flights, rules())
    parts = {part: str(folder / part) for part in (folders.PUBLIC, folders.TEACHER, folders.SUBMISSIONS)}
    lines = (
        f"{parts['public']}: for the students",
        f"{parts['teacher']}: {flights} hidden flights, for you alone",
        f"{parts['submissions']}: for `challenge submit FILE --student NAME --to {folder}`",
    )
    answer(format, parts | {"flights": flights}, lambda: "\n".join(lines))


@declare(plugins=False)
def submit(
    file: Annotated[Path, typer.Argument(metavar="FILE|FOLDER")],
    student: str | None = None,
    to: Annotated[Path | None, typer.Option(metavar="DIR")] = None,
    format: FormatOption = Format.text,
) -> None:
    """Check a detector or a law, and hand it in.

    The command flies one practice flight under the conditions of `grade`. The submission runs in a process of
    its own, without access to files, network, truth and seed. A new submission does not replace an earlier
    submission.

    Examples:
      beaver-ftc challenge submit autumn/public/detector.py --student ada --to autumn

    file: A Python file with one class that has reset and step, or a folder with such a file.
    student: Name of the student. Default: the name of the file or folder.
    to: Folder of the challenge. Without this option the submission is checked, but not handed in.
    """
    from beaver_ftc_live.challenge import folders
    from beaver_ftc_live.challenge.grading import tried

    name = folders.check_student(student or Path(os.path.abspath(file)).stem)
    source = folders.source_of(file)
    document = {"student": name, **tried(source, file.name), "submitted": None}
    if to is not None:
        document["submitted"] = str(folders.keep(source, name, to))
    done = f"handed in as {document['submitted']}" if to else "not handed in: for that, add --to DIR"
    points = f"{document['points']:g} points in one practice flight with a loss"
    says = f"{document['kind']} {document['class']}: {points} (a grade is the mean over all flights); {done}"
    answer(format, document, lambda: says)


@declare("grades.json", "grades.md", "grades.html", plugins=False)
def grade(
    folder: Annotated[Path, typer.Argument(metavar="DIR")],
    workers: WorkersOption = None,
    format: FormatOption = Format.text,
) -> None:
    """Fly every student's last submission on the hidden flights.

    The command writes grades.json, grades.md and grades.html into DIR/grades. If a submission fails, its row
    contains the reason.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc challenge grade autumn

    folder: Folder of the challenge.
    """
    from beaver_ftc.studies.engine import cores
    from beaver_ftc_live.challenge import grading

    if not folder.is_dir():
        raise BadInput(f"challenge grade: {folder}: no such folder, allowed: one of `challenge new`")
    with progress_bar("submissions") as progress:
        document = grading.grade(folder, workers or cores(), progress)
    results = str(folder / "grades")
    answer(
        format, document | {"folder": results}, lambda: f"{grading.as_text(document)}\n\nresults: {results}"
    )
