"""Scenario files as text: those that come with the project, by name, and a scenario back to text.

Scenarios, sweeps and plans of evidence come with the project; none is checked here. A scenario is written
complete and flyable again, or by section, a key to what was computed.
"""

import re
from collections.abc import Callable, Hashable, Iterable
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml
from pydantic import BaseModel

from beaver_ftc.documents.document import first_text
from beaver_ftc.documents.errors import nearest
from beaver_ftc.documents.files import data_root
from beaver_ftc.documents.validation import ScenarioError, parse_document, text_of

MAX_BYTES = 4_000_000
"""A hand-written scenario is a few kB; a fully resolved one with reference tables in it stays below this."""


def read_file(path: Path, given: str, kind: str = "scenario") -> str:
    """The text of a file, or a ScenarioError: why not and, for a bare name, which built-in it is near."""
    return text_of(path, MAX_BYTES, None if looks_like_a_path(given) else lambda: no_such(given, kind))


# What there is built in: where it lies, and the command that flies it.
_KINDS = {
    "scenario": ("scenarios", "run"),
    "sweep": ("scenarios/sweeps", "sweep"),
    "plan": ("evidence", "evidence"),
}


def _builtin(kind: str) -> dict[str, Path]:
    """Files of the built-in scenarios, sweeps or plans, by name; its file's name is a scenario's."""
    folder = data_root() / _KINDS[kind][0]
    return dict(sorted((path.stem, path) for path in folder.glob("*.yaml")))


def builtin_names() -> list[str]:
    """Names of the built-in scenarios, in alphabetical order."""
    return list(_builtin("scenario"))


def builtin_sweeps() -> list[str]:
    """Names of the sweeps that come with the project."""
    return list(_builtin("sweep"))


def builtin_plans() -> list[str]:
    """Names of the plans of evidence that come with the project."""
    return list(_builtin("plan"))


def builtin_path(name: str) -> Path:
    """The file of a built-in scenario."""
    return data_root() / "scenarios" / f"{name}.yaml"


def described(kind: str) -> list[tuple[str, str]]:
    """(name, description) of all of a kind, of _KINDS; no file is read beyond its description."""
    return [
        (name, first_text(path.read_text(encoding="utf-8"), "description").strip())
        for name, path in _builtin(kind).items()
    ]


def no_such(given: str, kind: str) -> str:
    """What to say of a name that is no built-in `kind`, of _KINDS: perhaps it is of another."""
    names = {kind: list(_builtin(kind)) for kind in _KINDS}
    for other, (_, flies) in _KINDS.items():
        if other != kind and given in names[other]:
            return f"{given} is a {other}, allowed: a {kind}; `beaver-ftc {flies} {given}` flies it"
    says = f"no such file or built-in {kind}: {given[:100]!r}"
    allowed = f"allowed: a file, or one of the {len(names[kind])} names that `beaver-ftc list` prints"
    near = nearest(given, [name for known in (names[kind], *names.values()) for name in known])
    if near is None:
        return f"{says}, {allowed}"
    kinds = "" if near in names[kind] else f"the {next(of for of in _KINDS if near in names[of])} "
    return f"{says}, did you mean {kinds}{near}? {allowed}"


def resolve(name_or_path: str | Path, kind: str = "scenario") -> Path:
    """The file a built-in name of one of _KINDS stands for; anything else is a path already."""
    return _builtin(kind).get(str(name_or_path)) or Path(name_or_path)


def has_key(path_or_name: str | Path, kind: str, key: str) -> bool:
    """Whether a file (or name of a built-in `kind`) that can be read has this key at its top."""
    path = resolve(path_or_name, kind)
    try:
        return path.is_file() and key in parse_document(read_file(path, str(path)), str(path)).data
    except ScenarioError:
        return False


def is_sweep(path_or_name: str | Path) -> bool:
    """Whether a file (or name) that can be read is a sweep: it has a `base`, as no scenario has."""
    return has_key(path_or_name, "sweep", "base")


def looks_like_a_path(given: str) -> bool:
    """A built-in name has no folder and no dot."""
    return any(mark in given for mark in "/\\.")


Found = TypeVar("Found")


class KeptBySections(Generic[Found]):
    """What was found of sections, for further flights that have the same objects.

    Each entry holds its sections, so that their ids stay their own. Of more than `most` entries all are
    dropped.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._entries: dict[tuple[Hashable, ...], tuple[tuple[object, ...], Found]] = {}

    def __len__(self) -> int:
        return len(self._entries)

    def get(self, sections: tuple[object, ...], find: Callable[[], Found], *besides: Hashable) -> Found:
        """What `find` returns for these sections, and for these values besides; called if nothing is kept."""
        key = (*map(id, sections), *besides)
        if key not in self._entries:
            if len(self._entries) >= self._most:
                self._entries.clear()
            self._entries[key] = sections, find()
        return self._entries[key][1]


_MOST = 256
_SEPARATORS = re.compile("[\x85\u2028\u2029]")
_texts: KeptBySections[str] = KeptBySections(_MOST)


class _Dumper(yaml.SafeDumper):
    """Short mappings and lists of numbers on one line, no aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _is_leaf(value: Any) -> bool:
    return not isinstance(value, dict | list)


def _mapping(dumper: yaml.SafeDumper, mapping: dict[str, Any]) -> yaml.Node:
    flow = bool(mapping) and all(map(_is_leaf, mapping.values())) and "description" not in mapping
    return dumper.represent_mapping("tag:yaml.org,2002:map", mapping.items(), flow_style=flow)


def _list(dumper: yaml.SafeDumper, items: list[Any]) -> yaml.Node:
    return dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=all(map(_is_leaf, items)))


def _text(dumper: yaml.SafeDumper, text: str) -> yaml.Node:
    """Line separators of Unicode are escaped: as they are, they read back as a space."""
    style = '"' if _SEPARATORS.search(text) else None
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _text)
_Dumper.add_representer(dict, _mapping)
_Dumper.add_representer(list, _list)


def to_yaml(scenario: BaseModel) -> str:
    """The fully resolved scenario, every default written out; loading it again gives an equal one."""
    data = scenario.model_dump(mode="json", exclude_none=True, by_alias=True)
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=110)


def texts_of(scenario: Any, sections: Iterable[str]) -> tuple[str, ...]:
    """What sections hold, nothing where a scenario has none. Flights of a sweep share those that do not vary,
    whose text is written once."""
    return tuple(_text_of(getattr(scenario, name)) for name in sections)


def _text_of(section: BaseModel | None) -> str:
    if section is None:
        return ""
    return _texts.get((section,), section.model_dump_json)
