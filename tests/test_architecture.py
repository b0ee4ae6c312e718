"""The rules that keep the packages readable: floors, products apart, no circles, one importer of JSBSim.

CONTRIBUTING.md has the same map in words. What a file imports is read from its syntax tree, imports inside
functions, under TYPE_CHECKING and by a string included: an arrow is an arrow.
"""

import ast
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType

import pytest

import beaver_ftc
from beaver_ftc import public
from beaver_ftc.aircraft.aircraft import builtin_names
from beaver_ftc.plant import instrumented

ROOT = Path(beaver_ftc.__file__).parent
PACKAGE = "beaver_ftc"
PRODUCTS = sorted(path.name for path in ROOT.parent.glob(f"{PACKAGE}_*") if path.is_dir())
ROOTS = {
    **{name: ROOT.with_name(name) for name in (PACKAGE, *PRODUCTS)},
    "tools": Path(__file__).parents[1] / "tools",
}

# A product stands beside the others: it imports the core, and another product only for the reason given.
BESIDE = {
    ("beaver_ftc_links", "beaver_ftc_live"): "the live page shows a flight that an autopilot commands",
    ("beaver_ftc_logs", "beaver_ftc_assurance"): "the alarm in a recorded flight gets a certificate",
}

# Folders from the ground up; a folder imports what is below its own floor, and itself.
FLOORS = (
    {"public"},
    {"documents"},
    {"commands", "compiled", "plugins"},
    {"aircraft"},
    {"design"},
    {"scenario"},
    {"plant"},
    {"diagnosis"},
    {"control"},
    {"loop"},
    {"results"},
    {"studies"},
    {"cli", "pytest_plugin"},
)
TOOLS = FLOORS[2]
# Their rows name what is far above them, for those who ask; the same for other packages.
REGISTRIES = {"plugins", "commands"}


@cache
def modules(package: str = PACKAGE) -> dict[str, Path]:
    """Dotted name below the package -> file; a package goes by its folder's name."""
    found = {}
    for path in sorted(ROOTS[package].rglob("*.py")):
        parts = path.relative_to(ROOTS[package]).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(name: str, package: str = PACKAGE) -> ast.Module:
    return ast.parse(modules(package)[name].read_text(encoding="utf-8"))


@cache
def imports(name: str, package: str = PACKAGE) -> frozenset[str]:
    """Every dotted name that a module imports, whole: `numpy`, `beaver_ftc.loop.frame.fly_frame`; those that
    it names in a string included."""
    found = set()
    for node in ast.walk(tree(name, package)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name} imports relatively"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(found if name in REGISTRIES else found | strings(name, package))


def strings(name: str, package: str = PACKAGE) -> set[str]:
    """Every string of a module that names something of our packages: `beaver_ftc.loop.frame:fly_frame`."""
    constants = (node.value for node in ast.walk(tree(name, package)) if isinstance(node, ast.Constant))
    return {
        value.replace(":", ".")
        for value in constants
        if isinstance(value, str) and re.fullmatch(rf"{PACKAGE}(_[a-z]+)?(\.\w+)+(:\w+)?", value)
    }


@cache
def own_imports(name: str, package: str = PACKAGE) -> set[str]:
    """The modules of this package that a module imports."""
    found = set()
    for target in imports(name, package):
        if not target.startswith(f"{package}."):
            continue
        inner = target.removeprefix(f"{package}.")
        if inner not in modules(package):
            inner = inner.rpartition(".")[0]
        if inner in modules(package):  # else it names no module: a group of entry points, a logger
            found.add(inner)
    return found - {name, ""}


def floor_of(name: str) -> int:
    """The floor of a module, or of the folder it is in."""
    (floor,) = (i for i, rooms in enumerate(FLOORS) if name.partition(".")[0] in rooms)
    return floor


def test_every_room_is_on_the_plan():
    rooms = {name.partition(".")[0] for name in modules() if name}
    assert rooms <= set().union(*FLOORS)


def test_imports_run_downwards_only():
    upwards = []
    for name in filter(None, modules()):
        room = name.partition(".")[0]
        for target in own_imports(name):
            other = target.partition(".")[0]
            if not (other == room or floor_of(other) < floor_of(room) or {room, other} <= TOOLS):
                upwards.append(f"{name} imports {other}")
    assert upwards == []


@pytest.mark.parametrize("package", [PACKAGE, *PRODUCTS])
def test_products_stand_apart(package):
    """The core imports none, and a product no other but for a stated reason."""
    others = set(PRODUCTS) - {package} - {other for one, other in BESIDE if one == package}
    found = {
        f"{name} imports {target}"
        for name in modules(package)
        for target in imports(name, package)
        if target.partition(".")[0] in others
    }
    assert found == set()


@pytest.mark.parametrize("package", PRODUCTS)
def test_products_use_public_names_of_the_core_alone(package):
    """Of a folder what its __init__.py publishes, of a module beside the folders what is in its __all__."""
    private = {
        f"{name}: {target}"
        for name in modules(package)
        for target in imports(name, package)
        if target.startswith(f"{PACKAGE}.") and not is_public(target.removeprefix(f"{PACKAGE}."))
    }
    assert private == set()


def is_public(target: str) -> bool:
    """Whether `plant.Plant` or `load` is a public name of the core. A module in a folder is none."""
    place, _, name = target.rpartition(".")
    if name.startswith("_") or (place and place not in modules()):
        return False
    listed = getattr(import_module(f"{PACKAGE}.{place}".rstrip(".")), "__all__", None)
    if listed is None and modules()[place].name == "__init__.py":
        return name in {*published_by(place), *defined_in(place)}
    return name in (listed or ())


def published_by(folder: str) -> dict[str, tuple[str, str]]:
    return public.published(import_module(f"{PACKAGE}.{folder}").__name__)


def defined_in(folder: str) -> set[str]:
    """What an __init__.py defines or imports itself."""
    found = set()
    for node in tree(folder).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            found |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign):
            found |= {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
    return found


@pytest.mark.parametrize(
    "folder", [name for name, path in modules().items() if path.name == "__init__.py" and name]
)
def test_every_public_name_exists_is_used_by_a_product_and_has_a_docstring(folder):
    used = {target for package in PRODUCTS for name in modules(package) for target in imports(name, package)}
    used |= {target for name in modules() for target in imports(name)}
    package = import_module(f"{PACKAGE}.{folder}")
    for name in published_by(folder):
        found = getattr(package, name)
        assert f"{PACKAGE}.{folder}.{name}" in used or not PRODUCTS, name
        assert found.__doc__ or not isinstance(found, type | FunctionType), name
        assert name in dir(package)
    with pytest.raises(AttributeError, match=f"module 'beaver_ftc.{folder}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018


@pytest.mark.parametrize("package", ROOTS)
def test_no_two_modules_import_each_other_in_a_circle(package):
    assert circles(package) == []


def circles(package: str) -> list[set[str]]:
    """Sets of modules each of which reaches all others by imports (Tarjan's strongly connected ones)."""
    order, low, stack, found = {}, {}, [], []

    def visit(name):
        order[name] = low[name] = len(order)
        stack.append(name)
        for target in own_imports(name, package):
            if target not in order:
                visit(target)
            if target in stack:
                low[name] = min(low[name], low[target])
        if low[name] == order[name]:
            circle = set(stack[stack.index(name) :])
            del stack[stack.index(name) :]
            if len(circle) > 1:
                found.append(circle)

    for name in modules(package):
        if name not in order:
            visit(name)
    return found


def test_only_the_plant_imports_jsbsim():
    importers = {
        (package, name.partition(".")[0])
        for package in (PACKAGE, *PRODUCTS)
        for name in modules(package)
        if any(i.partition(".")[0] == "jsbsim" for i in imports(name, package))
    }
    assert importers == {(PACKAGE, "plant")}


def test_no_line_of_python_names_an_aircraft():
    """But for the built-in one, once: the default of a scenario. Documentation may."""
    names = {*builtin_names(), *instrumented.names()}
    named = []
    for path in sorted(ROOT.parent.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if names.isdisjoint(re.findall(r"(?<!-)\b[\w-]+", text)):
            continue
        tree = ast.parse(text)
        documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documents:
                words = re.findall(r"(?<!-)\b[\w-]+", node.value)
                named += [(path.relative_to(ROOT.parent).as_posix(), word) for word in words if word in names]
    assert named == [("beaver_ftc/aircraft/aircraft.py", "beaver")]
