"""What rows follow from: those of an earlier start go with new ones only if nothing of it has changed."""

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.paths import data_root
from beaver_ftc.results.metrics import versions

PACKAGE = Path(__file__).resolve().parents[2]
NO_ROWS = ("cli", "live", "integrations")  # rooms that ask for rows, or show them, and make none


@dataclass(frozen=True)
class Identity:
    """What was asked, resolved, and what flew it."""

    document: dict[str, Any]

    @classmethod
    def of(cls, what: str, asked: dict[str, Any]) -> "Identity":
        """The identity of what was asked, under its name, on this machine."""
        document = {what: asked, "versions": {**versions(), **plug_ins(), "flight code": fingerprint()}}
        return cls(json.loads(json.dumps(document)))

    def refuse_other(self, there: dict[str, Any], folder: Path) -> None:
        """Raise BadInput if the flights in a folder follow from anything else."""
        what = next(iter(self.document))
        changed = differences(there.get(what, {}), self.document[what])
        if changed:
            raise BadInput(
                f"{folder}: the {what} file has changed since these flights ({', '.join(changed)}): "
                f"resuming would mix two {what}s, allowed: the unchanged file, or another --out"
            )
        then, now = there.get("versions", {}), self.document["versions"]
        changed = differences(then, now)
        if changed:
            said = ", ".join(f"{name} {then.get(name)} then, {now.get(name)} now" for name in changed)
            raise BadInput(
                f"{folder}: flown by other versions ({said}): resuming would mix them, "
                "allowed: the same versions, or another --out"
            )


def differences(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
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
    """The sources and data that rows may follow from: all but the rooms that make none."""
    sources = [
        path
        for path in (*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.json"))
        if path.relative_to(PACKAGE).parts[0] not in NO_ROWS
    ]
    aircraft = [path for path in (data_root() / "aircraft").rglob("*") if path.is_file()]
    return sorted({*sources, *aircraft})


@cache
def fingerprint() -> str:
    """A digest of those files: a version number sees no edit."""
    digest = hashlib.sha256()
    for path in hashed_files():
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
