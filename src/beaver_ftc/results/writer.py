"""The result folder of a run: it appears whole or not at all.

Everything is written into a hidden sibling of the final folder, which is renamed into place at the end. A
killed run leaves only the hidden folder; it is locked while in use, so the next run knows it for stale and
removes it.
"""

import contextlib
import ctypes
import errno
import os
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import partial
from itertools import takewhile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from uuid import uuid4

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.plugins import required
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import as_json, metrics
from beaver_ftc.results.model import Document, Metrics

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.results.painters import Painters
    from beaver_ftc.scenario.schema import Scenario

try:
    import fcntl
except ImportError:  # not a POSIX system: nothing can be locked, so nothing is taken for stale
    fcntl = None  # type: ignore[assignment]

CERTIFICATE_FILE = "certificate.json"
# What a run leaves; what else lies in a result folder is declared by the commands that write it.
FILES_OF_A_RUN = frozenset({
    "scenario.yaml", "log.parquet", "metrics.json", "report.html", "figures", "aircraft",
    "log.csv", "flight.acmi", "flight.csv", "flight.ulg", "flight.bin", "vehicle.yaml",
})  # fmt: skip
AIRCRAFT = "aircraft"  # an own aircraft, to fly it again
MODEL_FILES = frozenset({".xml", ".yaml"})  # of it
_PICTURE_END_BYTES = 2048  # of a picture: its metadata come first, those of a PDF last
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2

Progress = Callable[[float], None]


def run(
    scenario: "Scenario",
    out: Path,
    report: bool = True,
    progress: Progress | None = None,
    exports: Collection[str] = (),
    prepare: "Callable[[Plant], None] | None" = None,
    recording: str | None = None,
    certified: bool = False,
    painters: "Painters" = (),
    figures: Sequence[str] = ("png",),
) -> Document:
    """Fly `scenario`, write `out/<name>/`, and return the metrics document.

    A flight that is not completed leaves nothing. Once it is, log and scenario are kept whatever else fails.

    exports: of "csv" and "acmi". prepare: called with the trimmed plant just before the flight. recording:
    table, ulog or ardupilot, to write the log as a recorder on board would have. certified: write the
    certificate of its alarm and exclusions. painters: who draws the figures, if not this process.
    figures: their formats.

    Raises BadInput for a flight that cannot be trimmed or certified, SimulationFailed for one not completed
    or kept, NotAllWritten where the log is kept but another file could not be written.
    """
    from beaver_ftc.loop.loop import fly

    certificate = required("certificate", "certified")(scenario) if certified else None
    watch = certificate.watch if certificate else None
    failed: list[Exception] = []
    with result_folder(out, scenario.name) as folder:
        written = partial(_note_failure_and_go_on, failed, folder)
        log_path = folder / "log.parquet"
        aircraft = scenario.airframe
        with ParquetLog(log_path) as log:
            flight = fly(scenario, log, progress, prepare=prepare, watch=watch)
        write_scenario(folder, scenario)
        document: Document = {}
        with written("metrics.json"):
            document = metrics(flight)
            (folder / "metrics.json").write_text(as_json(document), encoding="utf-8")
        if certificate:
            with written(CERTIFICATE_FILE):
                certificate.write(folder)
        if report and document:
            with written("report.html"):
                write_report_files(folder, document, painters=painters, formats=figures)
        if "csv" in exports:
            from beaver_ftc.results.exports import write_csv

            with written("log.csv"):
                write_csv(log_path, folder / "log.csv")
        if "acmi" in exports and document:
            from beaver_ftc.results.exports import write_acmi

            with written("flight.acmi"):
                write_acmi(log_path, Metrics.of(document), folder / "flight.acmi", aircraft)
        if recording is not None:
            from beaver_ftc.results.exports import write_recording

            stops_rad = {s: max(abs(to.min_rad), abs(to.max_rad)) for s, to in aircraft.travel.items()}
            with written(f"the recording ({recording})"):
                write_recording(log_path, stops_rad, recording, folder, tuple(aircraft.signals))
    if failed:
        why = "; ".join(" ".join(str(error).split()) for error in failed)
        kept = f"{out / scenario.name}: the flight and its log are kept"
        raise NotAllWritten(f"{kept}, but {why}") from failed[0]
    return document


class NotAllWritten(SimulationFailed):
    """A flight was completed and its log is kept, but another file of its results could not be written."""


@contextlib.contextmanager
def _note_failure_and_go_on(failed: list[Exception], folder: Path, what: str) -> Iterator[None]:
    """Write one part of the results; where that fails, note why and leave nothing of that part."""
    before = set(folder.iterdir())
    try:
        yield
    except Exception as error:
        for left in set(folder.iterdir()) - before:
            shutil.rmtree(left) if left.is_dir() else left.unlink()
        says = f"{type(error).__name__}: {error}"
        if isinstance(error, OSError) and error.errno and not error.filename:  # of the disk
            says = _disk_error_text(error)
        reason = SimulationFailed(f"{what} could not be written: {says}")
        reason.__cause__ = error
        failed.append(reason)


def write_documents(folder: Path, scenario: "Scenario", document: Document) -> None:
    """Write what was flown and what came out of it into a result folder."""
    write_scenario(folder, scenario)
    (folder / "metrics.json").write_text(as_json(document), encoding="utf-8")


def write_scenario(folder: Path, scenario: "Scenario") -> None:
    """Write what was flown into a result folder."""
    from beaver_ftc.scenario.builtin import to_yaml

    if str(scenario.aircraft).startswith("./"):  # the user's own, copied: it can be flown again from here
        shutil.copytree(
            scenario.airframe.folder, folder / AIRCRAFT, ignore=_files_not_of_model, dirs_exist_ok=True
        )
        scenario = scenario.model_copy(update={"aircraft": f"./{AIRCRAFT}"})
    (folder / "scenario.yaml").write_text(to_yaml(scenario), encoding="utf-8")


def _files_not_of_model(folder: str, names: list[str]) -> set[str]:
    """The files that are no part of a JSBSim model and of its description."""
    return {n for n in names if Path(folder, n).is_file() and Path(n).suffix not in MODEL_FILES}


def write_report_files(
    folder: Path,
    document: Document,
    to: Path | None = None,
    painters: "Painters" = (),
    formats: Sequence[str] = ("png",),
) -> None:
    """Draw the figures and the report of a result folder that holds its log and its scenario.

    to: where to, if not into that folder. painters: who draws the figures, if not this process. formats: of
    the figures.
    """
    from beaver_ftc.results.figures import pictures_of
    from beaver_ftc.results.painters import drawing
    from beaver_ftc.results.report import write_report

    to = to or folder
    if formats:
        (to / "figures").mkdir(exist_ok=True)
    pictures = pictures_of(folder / "log.parquet", Metrics.of(document), to / "figures", formats)
    with drawing(pictures, painters):
        write_report(to / "report.html", [folder])


def add_report(folder: Path, document: Document) -> str:
    """Draw figures and report of a result folder that is there already; why not, if that fails: then the
    folder is as it was. They appear whole, and in no folder that has taken its place meanwhile."""
    failed: list[Exception] = []
    with (
        TemporaryDirectory(prefix=_partial_folder_prefix(folder.name), dir=folder.parent) as hidden,
        _locked(Path(hidden)),
        _note_failure_and_go_on(failed, folder, "report.html"),
    ):
        drawn_for = folder.stat()
        write_report_files(folder, document, Path(hidden))
        if os.path.samestat(drawn_for, folder.stat()):
            for name in ("figures", "report.html"):
                Path(hidden, name).rename(folder / name)
    return "".join(map(str, failed))


@contextlib.contextmanager
def result_folder(out: Path, name: str, files: Iterable[str] = ()) -> Iterator[Path]:
    """Yield an empty folder to fill; on success it becomes `out/name`, on any failure it vanishes.

    files: the names that an earlier result of this kind has. Raises SimulationFailed where the folder cannot
    be written, or `out/name` is not a result of ours.
    """
    final = out / name
    before = "the result that was there is as it was" if final.is_dir() else "nothing is left there"
    with clear_disk_errors(final, f"; {before}"):
        refuse_foreign(final, files)
        created = _make_parents(out)
        _remove_stale(out, name)
        own = uuid4().hex
        unnamed = out / f".beaver-ftc-{own}"
        hidden = out / f"{_partial_folder_prefix(name)}{own}"
        unnamed.mkdir()
        try:
            with _locked(unnamed):  # before it bears the name by which another run would look for stale ones
                unnamed.rename(hidden)
                yield hidden
                for path in (*hidden.rglob("*"), hidden):  # on the disk before its name says that it is
                    sync(path)
                _move_into_place(hidden, final, files)
        except BaseException:
            shutil.rmtree(hidden, ignore_errors=True)
            with contextlib.suppress(OSError):
                for folder in created:
                    folder.rmdir()
            raise


def refuse_foreign(folder: Path, files: Iterable[str] = ()) -> None:
    """Raise SimulationFailed if `folder` exists and holds anything that is not a result: it would be lost.

    files: names that are known to be of a result, beside those that commands declare.
    """
    if not os.path.lexists(folder):
        return
    if folder.is_symlink() or not folder.is_dir():
        raise SimulationFailed(f"cannot write {folder}: it exists and is not a folder")
    foreign = _foreign_files_in(folder, files)
    if foreign:
        raise SimulationFailed(
            f"will not replace {folder}: it holds {foreign[0]}, which is no result of beaver-ftc; "
            "move it away or choose another --out"
        )


def _foreign_files_in(folder: Path, files: Iterable[str]) -> list[str]:
    """The files of a result folder that are none of ours, by their name or beside our pictures."""
    unknown = {entry.name for entry in folder.iterdir()} - FILES_OF_A_RUN - {*files}
    if unknown:
        from beaver_ftc.commands import files_of_commands

        unknown -= {*files_of_commands()}
    foreign = [path for path in (folder / "figures").rglob("*") if not _is_our_picture(path)]
    copied = (path for path in (folder / AIRCRAFT).rglob("*") if not path.is_dir())
    foreign += [path for path in copied if path.suffix not in MODEL_FILES]
    return sorted([*unknown, *(str(path.relative_to(folder)) for path in foreign)])


def _is_our_picture(path: Path) -> bool:
    """Whether it bears the mark that every picture of ours is saved with."""
    from beaver_ftc.results.style import SOFTWARE_MARK

    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(_PICTURE_END_BYTES)
        file.seek(-min(_PICTURE_END_BYTES, path.stat().st_size), os.SEEK_END)
        return SOFTWARE_MARK.encode() in head + file.read()


@contextlib.contextmanager
def clear_disk_errors(folder: Path, but: str = "") -> Iterator[None]:
    """Turn an operating system's error into one line, which may end with a word of comfort."""
    try:
        yield
    except OSError as error:
        raise SimulationFailed(f"cannot write {folder}: {_disk_error_text(error)}{but}") from error


def _disk_error_text(error: OSError) -> str:
    reason = os.strerror(error.errno) if error.errno else str(error)
    return f"{reason[:1].lower()}{reason[1:]}"


def _partial_folder_prefix(name: str) -> str:
    return f".{name}.partial-"


def _make_parents(folder: Path) -> list[Path]:
    """Create `folder` with its parents; return those that were missing, deepest first."""
    missing = list(takewhile(lambda one: not one.exists(), (folder, *folder.parents)))
    folder.mkdir(parents=True, exist_ok=True)
    return missing


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[bool]:
    """Lock a folder meanwhile. False where another process has it, or nothing can be locked there."""
    if not fcntl:
        yield False
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            locked = True
        except OSError:
            locked = False
        yield locked
    finally:
        os.close(descriptor)


def _remove_stale(out: Path, name: str) -> None:
    """Remove what killed runs of this scenario left behind."""
    for leftover in out.glob(f"{_partial_folder_prefix(name)}*"):
        with contextlib.suppress(OSError), _locked(leftover) as stale:
            if stale:
                shutil.rmtree(leftover, ignore_errors=True)


def sync(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _move_into_place(hidden: Path, final: Path, files: Iterable[str]) -> None:
    refuse_foreign(final, files)
    try:
        hidden.rename(final)  # tried, not asked first: another run of this name may end in between
        return
    except OSError:
        if not final.exists():
            raise
    if _swap_folders(hidden, final):
        shutil.rmtree(hidden, ignore_errors=True)
    else:
        retired = hidden.with_name(f"{hidden.name}-replaced")
        final.rename(retired)
        hidden.rename(final)
        shutil.rmtree(retired, ignore_errors=True)


def _swap_folders(one: Path, other: Path) -> bool:
    """Swap two folders in one step, as Linux can; False where the system or the file system cannot."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    done = rename(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0
    if not done and ctypes.get_errno() not in (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return done
