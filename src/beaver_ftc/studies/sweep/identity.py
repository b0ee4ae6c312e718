"""What the flights of a sweep follow from: a table is resumed only by the same sweep on the same versions."""

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from beaver_ftc.errors import BadInput
from beaver_ftc.paths import data_root
from beaver_ftc.results.metrics import versions
from beaver_ftc.scenario.sweep_loader import Sweep

_NOT_FLOWN = (
    "description",
    "expect",
    "base",
    "set",
)  # words, verdicts, and what the resolved base says better
_SOURCES = (
    "*.py",
    "plant/*.py",
    "design/*.py",
    "diagnosis/*.py",
    "control/*.py",
    "diagnosis/rivals/*.py",
    "diagnosis/rivals/*.json",
    "control/rivals/*.py",
    "loop/*.py",
    "results/*.py",
    "scenario/*.py",
    "studies/sweep/*.py",
)
_PACKAGE = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Identity:
    """The document `sweep.json`: what was asked, resolved, and what flew it."""

    document: dict[str, Any]

    @classmethod
    def of(cls, sweep: Sweep, search: str | None = None) -> "Identity":
        """The identity of a sweep on this machine."""
        file = sweep.file.model_dump(mode="json", exclude_none=True)
        asked = {key: value for key, value in file.items() if key not in _NOT_FLOWN}
        document = {
            "sweep": {**asked, "runs": sweep.flights, "base": sweep.base, "search": search},
            "versions": {**versions(), "flight code": _fingerprint()},
        }
        return cls(json.loads(json.dumps(document)))

    def refuse_other(self, there: dict[str, Any], folder: Path) -> None:
        """Raise BadInput if the flights in a folder follow from anything else."""
        changed = _differences(there.get("sweep", {}), self.document["sweep"])
        if changed:
            raise BadInput(
                f"{folder}: the sweep file has changed since these flights ({', '.join(changed)}): "
                "resuming would mix two sweeps, allowed: the unchanged file, or another --out"
            )
        then, now = there.get("versions", {}), self.document["versions"]
        changed = _differences(then, now)
        if changed:
            said = ", ".join(f"{name} {then.get(name)} then, {now.get(name)} now" for name in changed)
            raise BadInput(
                f"{folder}: flown by other versions ({said}): resuming would mix them, "
                "allowed: the same versions, or another --out"
            )


def _differences(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
    return [name for name in dict.fromkeys([*now, *then]) if then.get(name) != now.get(name)]


@cache
def _fingerprint() -> str:
    """A digest of the sources and the aircraft flights follow from: a version number sees no edit."""
    digest = hashlib.sha256()
    files = [path for pattern in _SOURCES for path in _PACKAGE.glob(pattern)]
    files += (path for path in (data_root() / "aircraft").rglob("*") if path.is_file())
    for path in sorted(files):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
