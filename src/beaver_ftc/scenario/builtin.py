"""Files as text: the scenarios, sweeps and plans of evidence that come with the project, by name; none is
checked here."""

from pathlib import Path

from beaver_ftc.documents.document import first_text
from beaver_ftc.documents.errors import nearest
from beaver_ftc.documents.files import data_root
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import parse_document, text_of

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
