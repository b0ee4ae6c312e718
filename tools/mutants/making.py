"""The mutants of a module: small changes of it, each as new source."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

# Operators of Python's syntax tree, and what could stand in their place.
SWAPS = {
    "Add": "Sub", "Sub": "Add", "Mult": "Div", "Div": "Mult", "FloorDiv": "Mult", "Mod": "Mult",
    "Pow": "Mult", "Lt": "LtE GtE", "LtE": "Lt Gt", "Gt": "GtE LtE", "GtE": "Gt Lt", "Eq": "NotEq",
    "NotEq": "Eq", "In": "NotIn", "NotIn": "In", "Is": "IsNot", "IsNot": "Is", "And": "Or", "Or": "And",
}  # fmt: skip
# Keywords whose value no caller can see: zip's check of its own arguments, a record's padding.
UNSEEN = {"strict", "align"}
# Keywords of what draws, whose value only the eye can judge.
LOOKS = {
    "bbox_to_anchor", "capsize", "columnspacing", "dashes", "dpi", "elinewidth", "figsize", "fontsize",
    "framealpha", "frameon", "gridspec_kw", "height_ratios", "labelsize", "linewidth", "markersize", "pad",
    "rotation", "shrink", "width_ratios", "xytext", "zorder",
}  # fmt: skip
MARKS = "mutants_marks"  # the module that marked sources call
FUNCTIONS = {"min": "max", "max": "min", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    """One change of a module. place: number of the node in the order of a walk; number: of its change."""

    file: Path
    place: int
    number: int
    kind: str
    lines: tuple[int, int]  # of the node, and of the statement it is in
    before: str
    after: str
    within: str  # the line of source, and of its like in this module which one it is

    def name(self, package: Path) -> str:
        """A name that does not depend on other changes of the module."""
        return f"{self.file.relative_to(package).as_posix()}: {self.within}: {self.before} -> {self.after}"

    def source(self) -> str:
        """The source of the module with the change."""
        tree = _parsed(self.file.read_text())
        target = list(ast.walk(tree))[self.place]
        _, new = list(_changes(target))[self.number]
        changed = ast.fix_missing_locations(_Replace(target, new).visit(tree))
        return ast.unparse(changed)


def mutants(file: Path) -> list[Mutant]:
    """All mutants of a module."""
    text = file.read_text()
    tree, lines = _parsed(text), text.splitlines()
    apart, statement = _no_code(tree), _statements(tree)
    seen: Counter[tuple[str, str, str]] = Counter()
    found = []
    for place, node in enumerate(ast.walk(tree)):
        if node not in statement or node in apart:
            continue
        for number, (kind, new) in enumerate(_changes(node)):
            before, after, line = ast.unparse(node), ast.unparse(new), lines[node.lineno - 1].strip()
            seen[line, before, after] += 1
            which = seen[line, before, after]
            within = f"{line} #{which}" if which > 1 else line
            at = (node.lineno, statement[node])
            found.append(Mutant(file, place, number, kind, at, before, after, within))
    return found


def marked(file: Path, lines: Mapping[int, int]) -> str:
    """The source of a module that notes which of its statements it executes. lines: of each number to note
    the first line of the statement. A statement outside of all functions is not marked.
    """
    tree = _parsed(file.read_text())
    numbers: dict[int, list[ast.stmt]] = defaultdict(list)
    for n, line in lines.items():
        numbers[line] += ast.parse(f"__import__('{MARKS}').reached({n})").body
    functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))
    for node in chain.from_iterable(map(ast.walk, functions)):
        for name in ("body", "orelse", "finalbody"):
            if isinstance(of := getattr(node, name, None), list):
                setattr(node, name, [new for each in of for new in (*numbers.pop(each.lineno, ()), each)])
    return ast.unparse(ast.fix_missing_locations(tree))


def _parsed(text: str) -> ast.Module:
    """The tree of a module. Numbers that are the length of an array of a record are marked, since a longer
    array changes no result."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name("record"), keywords=fields):
                for inner in chain.from_iterable(ast.walk(field) for field in fields):
                    inner.is_length = True  # type: ignore[attr-defined]
    return tree


def _no_code(tree: ast.Module) -> set[ast.AST]:
    """Nodes in annotations and decorators, and those that change no result."""
    unseen = UNSEEN | LOOKS
    roots = [node for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg in unseen]
    for node in ast.walk(tree):
        roots += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        roots += getattr(node, "decorator_list", [])
    return {inner for root in roots if root is not None for inner in ast.walk(root)}


def _statements(tree: ast.Module) -> dict[ast.AST, int]:
    """The first line of the innermost statement around each node that has a line."""
    found: dict[ast.AST, int] = {}
    for outer in ast.walk(tree):
        if isinstance(outer, ast.stmt):
            found |= {node: outer.lineno for node in ast.walk(outer) if hasattr(node, "lineno")}
    return found


class _Replace(ast.NodeTransformer):
    def __init__(self, target: ast.AST, new: ast.AST) -> None:
        self._target, self._new = target, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._target else self.generic_visit(node)


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the kind of each change of a node, and the new node."""
    yield from _of_operators(node)
    yield from _of_numbers(node)
    if _is_of_effect(node):
        yield "line", ast.Pass()


def _of_operators(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Another sign, operator, comparison or function."""
    match node:
        case ast.UnaryOp(op=ast.USub()):
            yield "sign", node.operand
        case ast.UnaryOp(op=ast.Not()):
            yield "operator", node.operand
        case ast.AugAssign(op=ast.Add()):
            yield "sign", ast.AugAssign(node.target, ast.Sub(), node.value)
        case ast.BinOp(op=op) | ast.BoolOp(op=op):
            for new in _swapped(op):
                yield "operator", _with_fields(node, op=new)
        case ast.Compare(ops=[op]):
            for new in _swapped(op):
                yield "comparison", _with_fields(node, ops=[new])
        case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
            yield "operator", _with_fields(node, func=ast.Name(FUNCTIONS[name], ast.Load()))


def _swapped(operator: ast.AST) -> Iterator[ast.AST]:
    for name in SWAPS.get(type(operator).__name__, "").split():
        yield getattr(ast, name)()


def _with_fields(node: ast.AST, **changed: object) -> ast.AST:
    """A node with other fields, without a place in the source."""
    return type(node)(**{**dict(ast.iter_fields(node)), **changed})


def _of_numbers(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Another index or constant."""
    match node:
        case ast.Subscript(slice=ast.Constant(value=int(at))) if not isinstance(at, bool):
            yield "index", ast.Subscript(node.value, ast.Constant(at - 1 if at > 0 else at + 1), node.ctx)
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "constant", ast.Constant(value - 1 if hasattr(node, "is_length") else value + 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(2.0 * value if value else 1.0)


def _is_of_effect(node: ast.AST) -> bool:
    """Whether the other lines run without this one. A local name without a value would fail in any test."""
    match node:
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]) | ast.AugAssign():
            return True
        case ast.Expr(value=ast.Call()):
            return True
    return False
