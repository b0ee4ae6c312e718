"""The scenarios that come with the project, and how a name on the command line becomes a file."""

from pathlib import Path

from beaver_ftc.documents.paths import data_root


def _folder() -> Path:
    return data_root() / "scenarios"


def builtin_names() -> list[str]:
    """Names of the built-in scenarios, in alphabetical order; a scenario's name is its file's."""
    return sorted(path.stem for path in _folder().glob("*.yaml"))


def builtin_path(name: str) -> Path:
    """The file of a built-in scenario."""
    return _folder() / f"{name}.yaml"


def resolve(name_or_path: str | Path) -> Path:
    """The file a built-in name stands for; anything else is a path already."""
    given = str(name_or_path)
    if not looks_like_a_path(given) and given in builtin_names():
        return builtin_path(given)
    return Path(name_or_path)


def looks_like_a_path(given: str) -> bool:
    """A built-in name has no folder and no dot."""
    return any(mark in given for mark in "/\\.")
