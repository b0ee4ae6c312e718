"""What a name in prose may be: read from the code, the files, the command line and the aircraft."""

import ast
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yaml

from tools.docs.pages import ROOT

CODE = ("src", "tools", "benchmarks", "examples")
_NAMING = {ast.FunctionDef, ast.ClassDef, ast.arg, ast.keyword, ast.Name, ast.Attribute, ast.alias}
_NAME = re.compile(r"[A-Za-z_][\w-]*")
_WHOLE = re.compile(r"[\w./<>:=+*-]+")  # a text of the code that can be a name
_TARGET = re.compile(r"^([a-z][\w-]*):", re.MULTILINE)
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same in C, several times as fast
Schema = Mapping[str, Any]


@dataclass
class Code:
    """What Python files define and say. patterns: texts with parts that are filled in (`{axis}_rad_s`)."""

    words: set[str] = field(default_factory=set)
    texts: set[str] = field(default_factory=set)
    patterns: set[str] = field(default_factory=set)
    members: dict[str, set[str]] = field(default_factory=dict)  # of modules, classes

    def read(self, path: Path) -> None:
        """Take in a file."""
        tree = ast.parse(path.read_text(encoding="utf-8"))
        described: set[int] = set()
        for node in ast.walk(tree):  # a body before what stands in it
            described.update(map(id, _docstring(node)))
            if type(node) in _NAMING:
                self.words.update(_names_of(node))
            if isinstance(node, ast.ClassDef):
                self.members.setdefault(node.name, set()).update(_defined(node.body))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in described:
                self._read_text(node.value)
            elif isinstance(node, ast.JoinedStr):
                self._read_pattern(node)
        self.members.setdefault(path.stem, set()).update(_defined(tree.body))
        self.words.add(path.stem)

    def _read_text(self, text: str) -> None:
        """A text that is a name as a whole, or a line of names (a record's fields, YAML, a template)."""
        self.texts.update(_WHOLE.findall(text) if len(text) > 200 else [text])
        if _WHOLE.fullmatch(text):
            self.words.update(_NAME.findall(text))
        else:
            self.words.update(re.findall(r"(?<![\w/])(?=\w*[_-])[A-Za-z_][\w-]*\w|\b[A-Z][A-Z_]+\b", text))

    def _read_pattern(self, node: ast.JoinedStr) -> None:
        parts = [part.value if isinstance(part, ast.Constant) else None for part in node.values]
        said = "".join(str(part) for part in parts if part is not None)
        if re.search("[a-z]{3}", said) and _WHOLE.fullmatch(said):
            self.patterns.add(
                "".join(r"([\w.<>-]+)" if part is None else re.escape(str(part)) for part in parts)
            )


def _docstring(node: ast.AST) -> Iterator[ast.AST]:
    """The text that a module, a class or a function begins with."""
    body = getattr(node, "body", None)
    if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
        yield body[0].value


def _names_of(node: ast.AST) -> list[str]:
    """The identifiers that a node of the tree has itself."""
    found = [getattr(node, key, None) for key in ("name", "arg", "id", "attr", "asname")]
    return [part for name in found if isinstance(name, str) for part in name.split(".")]


def _defined(body: Iterable[ast.stmt]) -> Iterator[str]:
    """What the statements of a module or a class give a name to."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        for target in getattr(node, "targets", [getattr(node, "target", None)]):
            yield from (name.id for name in ast.walk(target) if isinstance(name, ast.Name)) if target else ()
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from (alias.asname or alias.name for alias in node.names)
        if isinstance(node, ast.FunctionDef) and node.name == "__init__":
            yield from (part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute))
        yield from _defined(getattr(node, "body", [])) if isinstance(node, ast.If) else ()


class Known:
    """Everything a name may be. Each part is read when it is first asked for."""

    @cached_property
    def files(self) -> frozenset[str]:
        """Files and folders of the repository, as git lists them."""
        command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split(
            "\n"
        )
        found = set(listed) or {path.relative_to(ROOT).as_posix() for path in ROOT.glob("**/*")}
        return frozenset(found | {str(parent) for name in found for parent in Path(name).parents} - {"", "."})

    @cached_property
    def code(self) -> Code:
        """Of the package, its tools, benchmarks and examples."""
        code = Code()
        for folder in CODE:
            for path in sorted((ROOT / folder).rglob("*.py")):
                code.read(path)
        for path in (ROOT / "tests").rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            code.words.update(re.findall(r"(?<=^def )test_\w+|(?<=\")BEAVER_FTC_\w+", text, re.MULTILINE))
        return code

    @cached_property
    def words(self) -> frozenset[str]:
        """Single names: of the code, of YAML and TOML files, of files and folders, of scripts of pages."""
        found = set(self.code.words) | set(self.columns)
        found.update(_NAME.findall((ROOT / "Makefile").read_text(encoding="utf-8")))
        for name in self.files:
            path = ROOT / name
            found.update((path.name, path.stem))
            if path.suffix in (".yaml", ".yml") and not name.startswith(("tests/", "tools/")):
                found.update(_of_yaml(path))
            elif path.suffix in (".js", ".html", ".toml", ".xml", ".json") and name.startswith(
                ("src/", "pyp")
            ):
                found.update(_NAME.findall(path.read_text(encoding="utf-8")))
        found.update(word for schema in self.schemas for word in _of_schema(schema))
        found.update(word for name in self.properties for word in re.split("[/.]", name))
        return frozenset(found | {word for words in self.commands.values() for word in words})

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Of a log with everything in it, of every built-in aircraft."""
        from beaver_ftc.aircraft import builtin_names, load
        from beaver_ftc.control.autopilot import COLUMNS
        from beaver_ftc.diagnosis.isolation import estimator_names
        from beaver_ftc.plant.channels import log_columns

        found: dict[str, None] = {}
        for name in builtin_names():
            aircraft = load(name)
            estimators = estimator_names("all", aircraft)
            found.update(
                dict.fromkeys(log_columns(aircraft, estimators, 3, aircraft.power_setting, COLUMNS, True))
            )
        return tuple(found)

    @cached_property
    def properties(self) -> frozenset[str]:
        """Of the built-in aircraft in JSBSim, JSBSim's own included."""
        from beaver_ftc.plant.adapter import Plant

        listed: Any = Plant(100).fdm.query_property_catalog("")
        return frozenset(line.split(" ")[0] for line in listed.splitlines())

    @cached_property
    def schemas(self) -> tuple[Schema, ...]:
        """Of scenario, sweep, aircraft and vehicle files, and of plans."""
        from beaver_ftc.aircraft.schema import AircraftFile
        from beaver_ftc.scenario.schema import Scenario
        from beaver_ftc.scenario.sweeps import SweepFile
        from beaver_ftc_assurance.evidence.plan import PlanFile
        from beaver_ftc_logs.vehicle import Vehicle

        files = (Scenario, SweepFile, AircraftFile, Vehicle, PlanFile)
        return tuple(model.model_json_schema() for model in files)

    @cached_property
    def commands(self) -> dict[str, frozenset[str]]:
        """{command: its options}, and of scripts of the repository under the empty name."""
        from beaver_ftc.cli.main import every_command

        found: dict[str, frozenset[str]] = {}
        for name, command in every_command().items():
            found[name] = frozenset(
                word
                for parameter in command.params
                for word in (*parameter.opts, *parameter.secondary_opts, parameter.metavar or "")
            )
        shared = {"--help", "-h", "--version", "--install-completion", "--show-completion"}
        scripts = {text for text in self.code.texts if re.fullmatch(r"--[a-z][a-z-]*", text)}
        return {**found, "": frozenset(shared | scripts)}

    @cached_property
    def targets(self) -> frozenset[str]:
        """Of the Makefile."""
        return frozenset(_TARGET.findall((ROOT / "Makefile").read_text(encoding="utf-8")))

    def resolves(self, path: str) -> bool:
        """Whether a dotted path of keys leads somewhere in a schema, from its top or from any section."""
        parts = [part for part in path.replace("[]", ".0").split(".") if part]
        for schema in self.schemas:
            parts_of = schema.get("$defs", {})
            if any(_leads(node, parts, parts_of) for node in (schema, *parts_of.values())):
                return True
        return False

    def is_section(self, key: str) -> bool:
        """Whether it is a key of a scenario that has keys below it."""
        scenario = self.schemas[0]
        node = scenario["properties"].get(key)
        return node is not None and any(
            "properties" in form for form in _forms(node, scenario["$defs"]) if isinstance(form, dict)
        )


@cache
def known() -> Known:
    """The one of this process."""
    return Known()


def _of_yaml(path: Path) -> Iterator[str]:
    def words(node: Any) -> Iterator[str]:
        if isinstance(node, dict):
            for key, value in node.items():
                yield from re.split(r"[.]", str(key))
                yield from words(value)
        elif isinstance(node, list):
            for value in node:
                yield from words(value)
        elif isinstance(node, str) and " " not in node:
            yield node

    try:
        yield from words(yaml.load(path.read_text(encoding="utf-8"), _LOADER))
    except yaml.YAMLError:
        return


def _of_schema(node: Any) -> Iterator[str]:
    """Keys and choices."""
    if isinstance(node, dict):
        yield from (key for key in node.get("properties", {}) if isinstance(node["properties"], dict))
        yield from (str(choice) for choice in node.get("enum", ()))
        yield from [str(node["const"])] if "const" in node else []
        for value in node.values():
            yield from _of_schema(value)
    elif isinstance(node, list):
        for value in node:
            yield from _of_schema(value)


def _forms(node: Schema, parts_of: Schema) -> Iterator[Schema]:
    """The node itself and every alternative of it, references followed."""
    if "$ref" in node:
        yield from _forms(parts_of[node["$ref"].rpartition("/")[2]], parts_of)
    yield node
    for kind in ("anyOf", "oneOf", "allOf"):
        for branch in node.get(kind, ()):
            yield from _forms(branch, parts_of)


def _leads(node: Schema, parts: list[str], parts_of: Schema) -> bool:
    """Whether keys lead from a node to something; an item of a list has no key, or its index."""
    if not parts:
        return True
    first, rest = parts[0], parts[1:]
    for form in _forms(node, parts_of):
        below = form.get("properties", {})
        if first in below and _leads(below[first], rest, parts_of):
            return True
        other = form.get("additionalProperties")
        if isinstance(other, dict) and _leads(other, rest, parts_of):
            return True
        names = form.get("propertyNames", {}).get("enum")
        if names and first in names and (other is True or other is None):
            return True
        item = form.get("items")
        if isinstance(item, dict) and _leads(item, rest if first.isdigit() else parts, parts_of):
            return True
    return False
