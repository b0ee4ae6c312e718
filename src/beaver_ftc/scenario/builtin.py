"""The scenarios that come with the project, and how a name on the command line becomes a file."""

from pathlib import Path

from beaver_ftc.documents.errors import nearest, suggestion
from beaver_ftc.documents.paths import data_root


def _folder() -> Path:
    return data_root() / "scenarios"


def builtin_names() -> list[str]:
    """Names of the built-in scenarios, in alphabetical order; a scenario's name is its file's."""
    return sorted(path.stem for path in _folder().glob("*.yaml"))


def builtin_sweeps() -> list[str]:
    """Names of the sweeps that come with the project."""
    return sorted(path.stem for path in (_folder() / "sweeps").glob("*.yaml"))


def builtin_path(name: str) -> Path:
    """The file of a built-in scenario."""
    return _folder() / f"{name}.yaml"


def no_such(given: str, kind: str) -> str:
    """What to say of a name that is no built-in `kind`, "scenario" or "sweep": perhaps it is of the other."""
    names = {"scenario": builtin_names(), "sweep": builtin_sweeps()}
    other, flies = ("sweep", "sweep") if kind == "scenario" else ("scenario", "run")
    if given in names[other]:
        return f"{given} is a {other}, allowed: a {kind}; `beaver-ftc {flies} {given}` flies it"
    says = f"no such file or built-in {kind}: {given[:100]!r}"
    near = nearest(given, names[kind] + names[other])
    if near in names[other]:
        return f"{says}, did you mean the {other} {near}? allowed: {', '.join(names[kind])}"
    return f"{says}{suggestion(given, names[kind])}"


def resolve(name_or_path: str | Path) -> Path:
    """The file a built-in name stands for; anything else is a path already."""
    given = str(name_or_path)
    if not looks_like_a_path(given) and given in builtin_names():
        return builtin_path(given)
    return Path(name_or_path)


def looks_like_a_path(given: str) -> bool:
    """A built-in name has no folder and no dot."""
    return any(mark in given for mark in "/\\.")
