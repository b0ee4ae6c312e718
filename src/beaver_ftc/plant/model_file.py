"""The files a JSBSim model is made of: found as JSBSim finds them, and refused where they are more than data.

JSBSim obeys what a model says: `<output>` writes files and connects, `<input>` listens, `file` names any file
of the machine. An aircraft may come from a third party, so all that is looked for before JSBSim sees it, with
the parser JSBSim has (expat, without namespaces): both see the same elements.
"""

import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from beaver_ftc.aircraft.schema import writing_property
from beaver_ftc.documents.document import MAX_PROBLEMS
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import UnreadableError, read_bytes
from beaver_ftc.documents.report import one_line

SCRIPT = "runscript"
ENGINES, SYSTEMS = "Engines", "Systems"
_KINDS = "engine", "systems"
_ENGINE_FOLDERS = (ENGINES, "engines", "Engine", "engine")  # beside a model; JSBSim knows all four
# Where JSBSim looks beside a model for what an element names, in its order; of others as for systems.
_OF_ENGINES = {
    "engine": _ENGINE_FOLDERS, "thruster": _ENGINE_FOLDERS, "propulsion": (".", *_ENGINE_FOLDERS)
}  # fmt: skip
_MAX_BYTES = 20_000_000
_MOST_IN_A_FOLDER, _MAX_BYTES_OF_A_FOLDER = 1000, 40_000_000
_DEEPEST = 100  # elements in elements; JSBSim's own aircraft have 21, and JSBSim recurses without a bound
_LONGEST = 160
# Properties that start a trim or a reset from within a frame, which JSBSim may not survive.
_CONTROLLING = ("simulation/reset", "simulation/do_simple_trim", "simulation/do_trim")
_NAMING = {"use": ("aircraft", "initialize")}  # what names files beside `file`
_LEFT_OUT = ("output", "input")  # of a copy: no part of the aircraft
_FORBIDDEN = {
    "output": "writes files or connects, allowed: no <output> here; what flies is logged by beaver-ftc",
    "input": "listens on a port, allowed: no <input> here; what flies is commanded by beaver-ftc",
    "child": "loads another aircraft, allowed: no <child>",
}


def package() -> Path:
    """Where the jsbsim package keeps its aircraft, engines and systems. Found without importing it."""
    found = find_spec("jsbsim")
    return Path(found.origin).parent if found and found.origin else Path()


def shared(folder: Path, kind: str) -> Path:
    """Where JSBSim looks last for what a model in this folder names; kind: engine or systems."""
    own = folder / (SYSTEMS if kind == "systems" else ENGINES)
    return own if own.is_dir() else package() / kind


@dataclass
class _File:
    """What a file says: its root, what it names (element, file, line), what it must not say (line, what is
    wrong, and the element where a copy leaves it out)."""

    root: str = ""
    names: list[tuple[str, str, int]] = field(default_factory=list)
    wrong: list[tuple[int, str, str]] = field(default_factory=list)


def check_model_has_no_side_effects(model: Path, copied: bool = False) -> None:
    """Raise BadInput where a model, a file it is made of or a script beside it would act on the machine.

    A line for each: FILE:LINE: what it says, what is allowed. Engines and systems that the jsbsim package
    shares among aircraft are not looked at. copied: a copy of it flies, with files as of `copy_of`.
    """
    lines = list(islice(_side_effects(model.resolve(), copied), MAX_PROBLEMS))
    if lines:
        raise BadInput("\n".join(lines))


def _side_effects(model: Path, copied: bool) -> Iterator[str]:
    folder = model.parent
    homes = [folder, *(_of_layout(folder, kind) for kind in _KINDS if copied)]
    used = dict.fromkeys((model, *files_of(model, layout=copied)))
    for path in used:
        if path.parent not in (package() / "engine", package() / "systems"):
            yield from _wrong_with(path, homes, copied)
    if (folder / "aircraft.yaml").is_file():  # what is beside a single model may be anything
        beside = sorted(folder.rglob("*.xml"))
        if says := _too_much(beside):
            yield f"{one_line(str(folder), 4096)}:1: {says}"
            return
        for path in beside:
            if path not in used and (path.is_symlink() or _read(path).root == SCRIPT):
                yield from _wrong_with(path, homes)


def _forbidden_property(text: str) -> tuple[str, str]:
    """The property in a text that must not be named, and what is wrong with it; empty if none is."""
    if name := writing_property(text):
        return name, "writes a file, allowed: other properties"
    if name := next((name for name in _CONTROLLING if name in text), ""):
        return name, "controls JSBSim itself, allowed: other properties"
    return "", ""


def _too_much(paths: list[Path]) -> str:
    """What is wrong with the number or the size of a folder's files; empty if nothing is."""
    if len(paths) > _MOST_IN_A_FOLDER:
        return f"has {len(paths)} XML files, allowed: up to {_MOST_IN_A_FOLDER}"
    size = sum(path.stat().st_size for path in paths if path.is_file())
    most = f"{_MAX_BYTES_OF_A_FOLDER / 1e6:g} MB"
    return f"has {size / 1e6:.3g} MB of XML, allowed: up to {most}" if size > _MAX_BYTES_OF_A_FOLDER else ""


def _wrong_with(path: Path, homes: Iterable[Path], copied: bool = False) -> Iterator[str]:
    where = one_line(str(path), 4096)
    if not any(path.resolve().is_relative_to(home) for home in homes):
        yield f"{where}:1: is a link out of the folder, allowed: files of the aircraft's own folder"
    else:
        for line, says, left_out in _read(path).wrong:
            if not (copied and left_out):
                yield f"{where}:{line}: {says}"


def files_of(model: Path, first: bool = False, layout: bool = False) -> dict[Path, Path]:
    """What a model is made of beside itself, and where each belongs beside a copy of the model.

    Every file that has a name the model says, wherever JSBSim looks; or only the `first` of each name, which
    it takes. layout: it may lie as JSBSim's own aircraft do, aircraft/X/X.xml, with engine/ and systems/
    beside aircraft/.
    """
    found: dict[Path, Path] = {}
    ahead = [model]
    while ahead:
        for element, name, _ in _read(ahead.pop()).names:
            candidates = _candidates(model.parent, element, name, layout)
            there = [(path, place) for path, place in candidates if path.is_file()]
            new = {path: place for path, place in there[: 1 if first else None] if path not in found}
            found |= new
            ahead += new
    return found


def _of_layout(folder: Path, kind: str) -> Path:
    """Where an author who keeps JSBSim's layout keeps what aircraft share."""
    return folder.parent.parent / kind


def _candidates(folder: Path, element: str, name: str, layout: bool) -> Iterator[tuple[Path, Path]]:
    """Where JSBSim looks for what an element names, in its order, and where that belongs."""
    if _leaves(name):
        return  # refused by name
    file = Path(name if name.endswith(".xml") else f"{name}.xml")
    for place in _OF_ENGINES.get(element, (".", SYSTEMS)):
        yield folder / place / file, Path(place) / file
    kind, home = ("engine", ENGINES) if element in _OF_ENGINES else ("systems", SYSTEMS)
    shares = [_of_layout(folder, kind), package() / kind] if layout else [shared(folder, kind)]
    yield from ((share / file, Path(home) / file) for share in shares)


def file_of(model: Path, element: str, name: str) -> Path:
    """The file that an element of a model names. Raises BadInput if there is none."""
    for path, _ in _candidates(model.parent, element, name, layout=False):
        if path.is_file():
            return path
    raise BadInput(f"{model.name}: needs {name} for its {element}, which is not there")


def copy_of(model: Path, folder: Path, layout: bool = False) -> Path:
    """Copy a model and the files it is made of, no others, into a folder; returns the copy.

    What a file of the jsbsim package would do on the machine is left out of its copy, and what writes,
    connects or listens of any. layout: as of `files_of`.
    """
    for path, place in {model: Path(model.name), **files_of(model, first=True, layout=layout)}.items():
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        if not _read(path).wrong:
            shutil.copyfile(path, folder / place)
            continue
        tree = ElementTree.parse(path)
        for element in [each for each in tree.getroot() if each.tag in _FORBIDDEN]:
            tree.getroot().remove(element)
        tree.write(folder / place, encoding="utf-8", xml_declaration=True)
    return folder / model.name


def left_out_of_copy(model: Path) -> list[str]:
    """What `copy_of` leaves out of a model and its files, in words."""
    used = (model, *files_of(model, first=True, layout=True))
    found = ((line, path.name, left) for path in used for line, _, left in _read(path).wrong if left)
    return [f"<{left}> of {name}, line {line}" for line, name, left in found]


def where_files_lie(model: Path) -> dict[str, str]:
    """The files that a copy of a model has beside itself, and the folder of each as seen from the model."""
    return {
        str(place): "the jsbsim package" if path.is_relative_to(package()) else
        os.path.relpath(path.parent, model.parent)
        for path, place in files_of(model, first=True, layout=True).items()
    }  # fmt: skip


def _read(path: Path) -> _File:
    """What a file says; read again when it has changed."""
    try:
        status = path.stat()
    except OSError:
        return _File(wrong=[(1, "cannot be read, allowed: an XML file", "")])
    return _read_at(path, status.st_mtime_ns, status.st_size, status.st_ino)


@lru_cache(maxsize=1024)
def _read_at(path: Path, *_state: int) -> _File:
    says, depth, text, parser = _File(), 0, [], expat.ParserCreate()  # type: ignore[var-annotated]

    def forbid(what: str, left_out: str = "") -> None:
        says.wrong.append((parser.CurrentLineNumber, what, left_out))

    def flush() -> None:
        named, says_of_it = _forbidden_property("".join(text))
        if named:
            forbid(f"{named} {says_of_it}")
        text.clear()

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        flush()
        says.root = says.root or name
        shown = one_line(" ".join([name, *(f'{key}="{of}"' for key, of in attributes.items())]), _LONGEST)
        acts = depth <= 1 and name in _FORBIDDEN
        if acts:
            forbid(f"<{shown}> {_FORBIDDEN[name]}", shown if depth and name in _LEFT_OUT else "")
        for key in ("file", *_NAMING.get(name, ())):
            if key in attributes and not acts:
                says.names.append((name, attributes[key], parser.CurrentLineNumber))
                if _leaves(attributes[key]):
                    forbid(f"<{shown}> leaves the folder, allowed: a file of the aircraft's own folder")
        for value in attributes.values():
            named, says_of_it = _forbidden_property(value)
            if named:
                forbid(f"<{shown}> {says_of_it}")
        depth += 1
        if depth == _DEEPEST + 1:
            forbid(f"<{shown}> is in more than {_DEEPEST} elements, allowed: up to {_DEEPEST}")

    def end(_name: str) -> None:
        nonlocal depth
        flush()
        depth -= 1

    def doctype(name: str, *_: object) -> None:
        forbid(f"<!DOCTYPE {one_line(name, _LONGEST)}> may define entities, allowed: XML without a DOCTYPE")

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text.append, doctype
    parser.DefaultHandler = lambda _: None  # so that expat expands no entity of the document's own
    try:
        parser.Parse(read_bytes(path, _MAX_BYTES), True)
    except UnreadableError as error:
        says.wrong.append((error.line or 1, str(error), ""))
    except (expat.ExpatError, ValueError) as error:
        what = f"is no XML ({error}), allowed: a JSBSim file"
        says.wrong.append((getattr(error, "lineno", 1), what, ""))
    return says


def _leaves(name: str) -> bool:
    """Whether what names a file may lead elsewhere, on any system."""
    return name.startswith(("/", "~")) or any(sign in name for sign in "\\:") or ".." in Path(name).parts


def with_systems(model: Path) -> Element:
    """The root of a model; each `<system file="x"/>` of the folder `Systems` beside it is replaced by x.

    JSBSim's schema lets only functions have a description: a comment that stands first in an operation reads
    as one here.
    """
    root = _described(model)
    for place, element in enumerate(list(root)):
        name = element.get("file")
        path = model.parent / SYSTEMS / f"{name}.xml"
        if element.tag == "system" and name and path.is_file():
            root[place] = _described(path)
    return root


def _described(path: Path) -> Element:
    builder = ElementTree.TreeBuilder(insert_comments=True)
    root: Element = ElementTree.parse(path, ElementTree.XMLParser(target=builder)).getroot()
    for element in list(root.iter()):
        for place, comment in reversed([*enumerate(element)]):
            if comment.tag is ElementTree.Comment:
                element.remove(comment)
                if place == 0 and element.get("name") and element.find("description") is None:
                    says = Element("description")
                    says.text = comment.text
                    element.insert(0, says)
    return root
