"""From what a scenario calls its aircraft to the aircraft: built in, of the jsbsim package, or a folder."""

import copyreg
import os
import re
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from beaver_ftc.aircraft.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.documents.document import Problem
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.documents.paths import data_root
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import parse_document, text_of, validate

DEFAULT = "beaver"
FILE = "aircraft.yaml"
# Aircraft of data that others publish: how each comes here.
IMPORTED = {
    "gtm": "`beaver-ftc import gtm DATABASE.mat` of NASA's data base, gtm_design/config/"
    "T2_polynomial_aerodatabase.mat of github.com/nasa/GTM_DesignSim"
}
BESIDE, FROM_JSBSIM = "./", "jsbsim:"
DERIVED = "# Written by beaver-ftc derive"
_FORMAT = 9  # of what is derived: files of another are derived again
_MAX_BYTES = 1_000_000
_ALLOWED = "a built-in name, jsbsim:NAME, or ./FOLDER beside the scenario"


# Studies make further scenarios of one that was read from a file, and these are not files themselves.
_SEEN: dict[str, set[Path]] = {}


class UnknownAircraft(BadInput):
    """No such aircraft; the message says what is allowed."""


class NotDerived(UnknownAircraft):
    """An aircraft of the jsbsim package that has no design model in the cache."""


@lru_cache
def builtin_names() -> tuple[str, ...]:
    """Names of the built-in aircraft."""
    return tuple(sorted(path.parent.name for path in _root().glob(f"*/{FILE}")))


def _root() -> Path:
    return data_root() / "aircraft"


def load(reference: str = DEFAULT, beside: Path | None = None) -> Aircraft:
    """The aircraft a scenario names, as its file says; `beside` is the folder the scenario is in.

    Raises UnknownAircraft for what is no aircraft, NotDerived for one whose file is yet to be made, and
    ScenarioError with one line a mistake in its file.
    """
    if not isinstance(reference, str):
        raise UnknownAircraft(f"{reference!r:.60} is no aircraft, allowed: {_ALLOWED}")
    if reference.startswith(FROM_JSBSIM):
        name = reference.removeprefix(FROM_JSBSIM)
        if not is_derived(name):
            says = f"has no design model yet, allowed: what `beaver-ftc derive {reference}` makes"
            raise NotDerived(f"{reference!r} {says}")
        return read(derived_folder(name))
    if reference.startswith(BESIDE):
        return read(_inside(beside, reference))
    if reference in IMPORTED:
        folder = imported_folder(reference)
        if not (folder / FILE).is_file():
            says = f"is not here yet, allowed: after {IMPORTED[reference]}"
            raise UnknownAircraft(f"{reference!r} {says}")
        return read(folder)
    if reference not in builtin_names():
        raise UnknownAircraft(
            f"{reference!r} is not known{suggestion(reference, builtin_names())}, jsbsim:NAME as "
            "`beaver-ftc list aircraft` has them, ./FOLDER beside the scenario"
        )
    return read(_root() / reference)


def derived_folder(name: str) -> Path:
    """Where `beaver-ftc derive` keeps what it made of an aircraft of the jsbsim package."""
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", name):
        raise UnknownAircraft(f"'jsbsim:{name[:60]}' is no name, allowed: letters, digits, - and _")
    return kept_folder() / "aircraft" / name


def imported_folder(name: str) -> Path:
    """Where `beaver-ftc import` keeps what it made of data that others publish."""
    return kept_folder() / "imported" / name


def kept_folder() -> Path:
    """Where `derive` and `import` keep aircraft."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return base / "beaver-ftc"


def first_line() -> str:
    """The first line of a file that was derived, by this way of deriving and of this JSBSim."""
    return f"{DERIVED}: format {_FORMAT}, JSBSim {version('jsbsim')}.\n"


def is_derived(name: str) -> bool:
    """Whether the cache has an aircraft of the jsbsim package as it would be derived now."""
    try:
        with (derived_folder(name) / FILE).open(encoding="utf-8") as file:
            return file.readline() == first_line()
    except OSError:
        return False


def _inside(beside: Path | None, reference: str) -> Path:
    """The folder's path if it is below the scenario's own: a scenario reads nothing else.

    Without a scenario's folder: what the reference has stood for in this process, if that is one folder.
    """
    if beside is None:
        seen = _SEEN.get(reference, set())
        if len(seen) != 1:
            raise UnknownAircraft(
                f"there is no folder to find {reference!r} in, allowed: ./FOLDER in a scenario that is a file"
            )
        return next(iter(seen))
    root = beside.resolve()
    try:
        folder = (root / reference).resolve()
    except (OSError, ValueError, RuntimeError):
        folder = Path("/")
    if ".." in Path(reference).parts or not folder.is_relative_to(root):
        raise UnknownAircraft(f"{reference!r} is outside, allowed: a folder below the scenario's own")
    if not folder.is_dir():
        raise UnknownAircraft(f"there is no folder {reference!r}, allowed: {_ALLOWED}")
    for path in sorted(folder.rglob("*")):
        if path.is_symlink() and not path.resolve().is_relative_to(root):
            link = f"{reference}/{path.relative_to(folder)}"
            raise UnknownAircraft(f"{link!r} leads outside, allowed: files below the scenario's own folder")
    _SEEN.setdefault(reference, set()).add(folder)
    return folder


def read(folder: Path) -> Aircraft:
    """The aircraft whose file is in a folder. Raises ScenarioError with one line a mistake."""
    path = folder / FILE
    try:
        changed_ns = path.stat().st_mtime_ns
    except OSError:
        changed_ns = -1
    return _read(folder, changed_ns)


@lru_cache(maxsize=32)
def _read(folder: Path, changed_ns: int) -> Aircraft:
    """`changed_ns`: when the file was last written, so that a changed one is read again."""
    path = folder / FILE
    document = parse_document(text_of(path, _MAX_BYTES), str(path), "the keys of an aircraft file")
    file = validate(AircraftFile, document, str(path))
    model = (folder / file.jsbsim).resolve()
    if not model.is_relative_to(folder.resolve()) or not model.is_file():
        wrong = "is not there" if model.is_relative_to(folder.resolve()) else "is outside"
        says = f"{file.jsbsim!r} {wrong}, allowed: a file beside this one"
        raise ScenarioError(str(path), [Problem(document.line(("jsbsim",)), ("jsbsim",), says)])
    return Aircraft(file, folder)


def _reduced(aircraft: Aircraft) -> tuple[Any, ...]:
    """A process that is sent an aircraft reads its file itself."""
    return read, (aircraft.folder,)


copyreg.pickle(Aircraft, _reduced)
