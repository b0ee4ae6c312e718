"""The identity of a study: the request, the versions and the code, which determine its rows.

A study resumes only with the same identity, so that old and new rows belong into one table.
"""

import json
from functools import cache
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root, digest_of_files, read_json
from beaver_ftc.plugins import SERVICES, folders
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document

PACKAGE = Path(__file__).resolve().parents[2]
# Folders and modules of a package whose code only starts studies or prints rows. No number of a row depends
# on them.
NO_ROWS = ("cli", "commands", "pytest_plugin")


def of_request(kind: str, request: Document) -> Document:
    """The identity of a study. kind: `study` or `sweep`, the key of the resolved request. The identity also
    has the versions of the packages of this machine, and the fingerprint of the code."""
    versions_here = {**versions(), **plug_ins(), "flight code": fingerprint()}
    return json.loads(json.dumps({kind: request, "versions": versions_here}))


def read_identity(manifest: Path, kind: str) -> Document | None:
    """The identity of a study or sweep, its kind, in a file; None if the file does not exist or is
    damaged."""
    try:
        document = read_json(manifest)
        is_identity = isinstance(document[kind], dict) and isinstance(document["versions"], dict)
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return document if is_identity else None


def refuse_other(mine: Document, theirs: Document, folder: Path) -> None:
    """Raise BadInput unless this sweep has the identity of the flights in its folder. mine, theirs: the
    identities of this sweep and of these flights."""
    changed = differences(theirs["sweep"], mine["sweep"])
    if changed:
        raise BadInput(
            f"{folder}: the sweep file has changed since these flights ({', '.join(changed)}): "
            "resuming would mix two sweeps, allowed: the unchanged file, or another --out"
        )
    then = theirs["versions"]
    now = mine["versions"]
    changed = [f"{name} {then.get(name)} then, {now.get(name)} now" for name in differences(then, now)]
    if changed:
        raise BadInput(
            f"{folder}: flown by other versions ({', '.join(changed)}): resuming would mix them, "
            "allowed: the same versions, or another --out"
        )


def differences(then: Document, now: Document) -> list[str]:
    """The keys whose values differ, with keys that only one of the two has."""
    return [name for name in dict.fromkeys([*now, *then]) if then.get(name) != now.get(name)]


def plug_ins() -> dict[str, str]:
    """Versions of the packages of third parties with registered detectors or laws."""
    from importlib.metadata import PackageNotFoundError, version

    from beaver_ftc.plugins import DETECTORS, LAWS, OURS, registered

    packages = {entry.package for group in (DETECTORS, LAWS) for entry in registered(group).values()}
    version_of = {}
    for package in sorted(packages - {OURS, ""}):
        try:
            version_of[package] = version(package)
        except PackageNotFoundError:
            version_of[package] = "unknown"
    return version_of


def hashed_files() -> list[Path]:
    """The files on which rows may depend: sources and data of the core and of each package that offers it a
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
    """A digest of `hashed_files`. A version number alone would not change with an edit of the code."""
    return digest_of_files(*hashed_files())
