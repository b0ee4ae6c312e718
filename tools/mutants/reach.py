"""The tests that execute a line, and the time that each of them takes."""

import hashlib
import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tools.mutants.making import Mutant
from tools.mutants.scope import KEPT, ROOT, tests
from tools.mutants.syntax import assigned, runs_at_import, uses


class Reach:
    """The lines that the tests of some files execute, their times, and how many tests are left out, by
    reason."""

    def __init__(self, files: Iterable[dict]) -> None:
        self.seconds: dict[str, float] = {}
        self.left_out: Counter[str] = Counter()
        self._lines: dict[str, dict[int, set[str]]] = {}
        for file in files:
            self.seconds |= file["seconds"]
            self.left_out.update(file["left_out"])
            for name, lines in file["lines"].items():
                known = self._lines.setdefault(name, {})
                for line, of in lines.items():
                    known.setdefault(int(line), set()).update(of)

    def reaching(self, mutant: Mutant) -> dict[str, float]:
        """The tests that execute the changed line, and the time of each, s."""
        reached = self.of(mutant.file.relative_to(ROOT).as_posix(), mutant.lines)
        return {test: self.seconds[test] for test in sorted(reached)}

    def of(self, name: str, lines: Iterable[int]) -> set[str]:
        """The tests that execute the first of the lines. For a line that runs at import: the tests that
        read its constants. For a module without functions: all tests that execute a module which imports
        it.
        """
        by_line, lines = self._lines.get(name), list(lines)
        if not by_line:
            users = [file for file in self._lines if _imports(ROOT / file, name)]
            return {test for file in users for test in self._any(file)}
        if all(runs_at_import(ROOT / name, line) for line in lines):
            return self._readers(name, assigned(ROOT / name, lines[-1])) or self._any(name)
        return next((of for line in lines if (of := by_line.get(line))), set())

    def _readers(self, name: str, constants: set[str]) -> set[str]:
        """The tests that execute a line which reads one of the constants of a module; none if another module
        computes something from it at import.
        """
        found: set[str] = set()
        for file in self._lines:
            if file == name or _imports(ROOT / file, name):
                lines = uses(ROOT / file, constants)
                if any(runs_at_import(ROOT / file, line) for line in lines):
                    return set()
                found.update(test for line in lines for test in self._lines[file].get(line, ()))
        return found

    def _any(self, name: str) -> set[str]:
        return {test for of in self._lines[name].values() for test in of}


def _imports(file: Path, name: str) -> bool:
    """Whether a module imports a name from another one, that of a file below src/."""
    module = ".".join(Path(name).with_suffix("").parts[1:])
    return file.exists() and f"from {module} import" in file.read_text()


def kept_so_far(mode: str) -> Reach:
    """The kept results of the tests of a mode; sources may have changed since. No test is run."""
    files = [kept_file(mode, file) for file in tests(mode)]
    return Reach(json.loads(file.read_text(encoding="utf-8")) for file in files if file.exists())


def kept_file(mode: str, file: Path) -> Path:
    return KEPT / mode / file.relative_to(ROOT / "tests").with_suffix(".json")


def known(mode: str, file: Path) -> dict | None:
    kept = kept_file(mode, file)
    found = json.loads(kept.read_text()) if kept.exists() else None
    return found if found and found["sources"] == digests(found["sources"]) else None


def digests(sources: Iterable[str]) -> dict[str, str]:
    def digest(file: Path) -> str:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:16] if file.exists() else ""

    return {name: digest(ROOT / name) for name in sorted(sources)}
