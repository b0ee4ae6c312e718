"""The identity of a study: the request, the versions and the code that its rows follow from.

A study resumes only if its identity is the same, so that old and new rows may stand in one table.
"""

import hashlib
import json
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root, read_json
from beaver_ftc.plugins import SERVICES, folders
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document

PACKAGE = Path(__file__).resolve().parents[2]
# Folders and modules of a package whose code starts studies or prints rows: no number in a row depends on it.
NO_ROWS = ("cli", "commands", "pytest_plugin")


def of(what: str, asked: Document) -> Document:
    """The identity of a study: the resolved request `asked` under the key `what`, then the versions of this
    machine's packages and the fingerprint of its code."""
    document = {what: asked, "versions": {**versions(), **plug_ins(), "flight code": fingerprint()}}
    return json.loads(json.dumps(document))


def known(manifest: Path, what: str) -> Document | None:
    """The identity under the key `what` in a file; None if there is no such file, or if it is damaged."""
    try:
        there = read_json(manifest)
        is_one = isinstance(there[what], dict) and isinstance(there["versions"], dict)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return there if is_one else None


def refuse_other(mine: Document, there: Document, folder: Path) -> None:
    """Raise BadInput if the flights in a folder follow from another identity than mine."""
    what = next(iter(mine))
    changed = differences(there.get(what, {}), mine[what])
    if changed:
        raise BadInput(
            f"{folder}: the {what} file has changed since these flights ({', '.join(changed)}): "
            f"resuming would mix two {what}s, allowed: the unchanged file, or another --out"
        )
    then = there.get("versions", {})
    now = mine["versions"]
    changed = [f"{name} {then.get(name)} then, {now.get(name)} now" for name in differences(then, now)]
    if changed:
        raise BadInput(
            f"{folder}: flown by other versions ({', '.join(changed)}): resuming would mix them, "
            "allowed: the same versions, or another --out"
        )


def differences(then: Document, now: Document) -> list[str]:
    """The keys whose values differ, those that have gone included."""
    return [name for name in dict.fromkeys([*now, *then]) if then.get(name) != now.get(name)]


def plug_ins() -> dict[str, str]:
    """Versions of the other packages whose detectors and laws may fly."""
    from importlib.metadata import PackageNotFoundError, version

    from beaver_ftc.plugins import DETECTORS, LAWS, OURS, registered

    packages = {entry.package for group in (DETECTORS, LAWS) for entry in registered(group).values()}
    found = {}
    for package in sorted(packages - {OURS, ""}):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


def hashed_files() -> list[Path]:
    """The sources and data that rows may depend on: those of the core and of each package that offers it a
    service, without NO_ROWS, and all files of the aircraft."""
    sources = [
        path
        for package in (PACKAGE, *folders(SERVICES))
        for path in package.rglob("*")
        if path.suffix in (".py", ".json", ".yaml")
        and path.relative_to(package).with_suffix("").parts[0] not in NO_ROWS
    ]
    aircraft = [path for path in (data_root() / "aircraft").rglob("*") if path.is_file()]
    return sorted({*sources, *aircraft})


@cache
def fingerprint() -> str:
    """A digest of `hashed_files`, because a version number does not change with an edit."""
    return digest(hashed_files())[:16]


def digest_of_aircraft(folder: Path) -> str:
    """A digest of an aircraft's files: another aircraft of the same name has another digest."""
    return digest(
        path for path in sorted(folder.rglob("*")) if path.suffix in (".xml", ".yaml") and path.is_file()
    )


def digest(paths: Iterable[Path]) -> str:
    """A digest of files, names and contents."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()
