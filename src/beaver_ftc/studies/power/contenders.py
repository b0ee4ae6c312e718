"""Who is held against whom: the built-in detectors and every registered plug-in."""

from typing import Any, NamedTuple

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plugins import DETECTORS, is_compiled, refusal, registered

ESTIMATORS = "adaptive-estimators"


class Contender(NamedTuple):
    """A scheme in the comparison. fdi: what a scenario's `fdi` says beside the bounds to have it."""

    name: str
    scheme: str
    fdi: dict[str, Any]

    @property
    def built_in(self) -> bool:
        """Whether its statistic comes with the flight itself rather than from a replay."""
        return is_compiled(DETECTORS, self.scheme)


STATISTICAL, BOTH = "statistical", "both"
BUILT_IN: dict[str, dict[str, Any]] = {
    ESTIMATORS: {},
    STATISTICAL: {"statistical": {}, "authority": "statistical"},
    BOTH: {"statistical": {}},
}


def contenders(names: list[str] | None = None) -> list[Contender]:
    """Those of the names given, ours first; without names all there are. Raises BadInput, a line a name."""
    if names is None:
        names = [name for name in registered(DETECTORS) if not is_compiled(DETECTORS, name)]
    names = list(dict.fromkeys([*BUILT_IN, *names]))
    wrong = [
        f"--schemes: {says}"
        for name in names
        if name not in BUILT_IN and (says := _refusal(name)) is not None
    ]
    if wrong:
        raise BadInput("\n".join(wrong))
    return [_contender(name) for name in names]


def _refusal(name: str) -> str | None:
    if is_compiled(DETECTORS, name):
        return f"scheme {name!r} detects nothing, allowed: {', '.join(BUILT_IN)}, a registered detector"
    return refusal(DETECTORS, name)


def _contender(name: str) -> Contender:
    return Contender(name, ESTIMATORS, BUILT_IN[name]) if name in BUILT_IN else Contender(name, name, {})
