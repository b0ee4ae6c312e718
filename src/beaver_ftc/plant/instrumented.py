"""An instrumented copy of an aircraft of the jsbsim package: the failures of the built-in one, put in between
its actuators and its aerodynamics.

The aerodynamics of the copy see the deflections of our own actuators, one system file a surface, in place of
those of the aircraft's flight control; all else is the aircraft's own. The files on disk stay as they are.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import product
from math import degrees, isfinite, nan
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.model_file import SYSTEMS, copy_of, file_of, files_of, package

PREFIX = "actuated-"
SURFACES = ("aileron", "elevator", "rudder")
# What aerodynamics of JSBSim's aircraft call the deflection of a surface: of which side, in which unit.
_NAMED = re.compile(r"fcs/(?:(left|right|mag)-)?(aileron|elevator|rudder)-pos-(rad|deg|norm)")
_NAME = re.compile(r"/?[\w.-]+(\[\d+\])?(/[\w.-]+(\[\d+\])?)+")  # of a property; words may have a / as well
_UNIT = re.compile(r"(rad|deg|norm)(?=[^a-z]*$)", re.IGNORECASE)
# A number of the aerodynamics as a function of a deflection in rad: a factor, or points between which it is
# a straight line, and beyond which it goes on as one.
View = float | tuple[tuple[float, float], ...]
Views = Mapping[str, Mapping[str, View]]  # of each surface, by what the aerodynamics call it
_FARTHEST_RAD = 20.0  # the search for trim moves the stops to half of it
# What else of the aircraft's motion and engines its moments may depend on, dimensionless: name, and JSBSim
# property. The aerodynamics compute them themselves, so that they are those of the same instant.
SIGNALS = {
    "thrust": "aero/thrust-coefficient",
    "alpha_rate": "aero/alphadot-hat",
    "beta_rate": "aero/betadot-hat",
    "engines_l": "aero/engines-roll-coefficient",
    "engines_m": "aero/engines-pitch-coefficient",
    "engines_n": "aero/engines-yaw-coefficient",
    "mach": "velocities/mach",
}
ENGINE_SIGNALS = ("engines_l", "engines_m", "engines_n")  # moments of the engines, in the order of the axes

LEVER, DIFFERENCE = "fcs/actuated-throttle-norm", "fcs/actuated-throttle-{i}-difference"
AT_IDLE = "failures/engine-{i}-at-idle"
GEAR, RETRACTED = "gear/gear-pos-norm", "gear/retracted-pos-norm"
_OF_THE_FLOW = ("alpha_rate", "beta_rate")  # an aircraft without engines has not the properties of others

# What stands before all functions in aerodynamics, by JSBSim's own schema.
_BEFORE_FUNCTIONS = ("description", "alphalimits", "hysteresis_limits", "aero_ref_pt_shift_x")


@lru_cache
def _template(name: str) -> str:
    return (data_root() / "aircraft" / name).read_text(encoding="utf-8")


def _parts() -> Element:
    """What is put into a copy, to be changed at will."""
    return ElementTree.fromstring(_template("instrumented.xml"))


# Surfaces whose plain commands it has without being told.
KNOWN_TO_JSBSIM = ("aileron", "elevator", "rudder", "flap", "spoiler", "speedbrake")


def actuator_system(surface: str, low_rad: float, high_rad: float, prefix: str = "") -> str:
    """A system file for a surface that travels from low_rad to high_rad, by `aircraft/actuator.xml`.

    prefix: begins the names of its signals, `fcs/<prefix><surface>-cmd-rad`, in an aircraft whose own flight
    control uses the plain ones.
    """
    template = _template("actuator.xml")
    text = template[template.index("<system") :].replace("fcs/SURFACE-", f"fcs/{prefix}SURFACE-")
    if prefix or surface not in KNOWN_TO_JSBSIM:
        command = f'<property value="0"> fcs/{prefix}SURFACE-cmd-norm </property>'
        text = text.replace("<property", f"{command}\n  <property", 1)
    text = text.replace("SURFACE", surface)
    for end, stop_rad in (("min", low_rad), ("max", high_rad)):
        stop = f'"> actuators/{surface}/position-{end}-rad </property>'
        text = re.sub(rf'[^"]*(?={stop})', f"{stop_rad!r}", text, count=1)
    return f'<?xml version="1.0"?>\n<!-- From aircraft/actuator.xml: change that. -->\n{text}'


def _parsed(path: Path) -> Element:
    """The root of an XML file. Raises BadInput, naming it, if it is none."""
    try:
        return ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise BadInput(f"{path.name}: {error}, allowed: a JSBSim model") from None


def names() -> tuple[str, ...]:
    """Names of the aircraft the jsbsim package ships."""
    return tuple(sorted(p.parent.name for p in package().glob("aircraft/*/*.xml") if p.stem == p.parent.name))


def source_of(name: str) -> Path:
    """The model of one of them. Raises BadInput if there is none."""
    if name not in names():
        raise BadInput(f"jsbsim:{name}: the jsbsim package has no such aircraft{suggestion(name, names())}")
    return package() / "aircraft" / name / f"{name}.xml"


def _common(engines: int, read: str, absent: Iterable[str], apart: bool) -> Element:
    """Envelope, the unanticipated fault, and one power lever for all engines; read: the aircraft's files;
    absent: what they read and nothing gives; apart: each engine has a difference of its own."""
    parts = _parts()
    system, levers = parts.find("system"), parts.findall("each/*" if apart else "lever/*")
    assert system is not None
    if apart:
        absent = (*absent, *(of.format(i=i) for i in range(engines) for of in (DIFFERENCE, AT_IDLE)))
        for read_it in parts.iterfind("told//property"):
            read_it.text = (read_it.text or "").replace(LEVER, "fcs/actuated-throttle-{i}-norm")
    for name in reversed(tuple(absent)):
        zero = Element("property", value="0")
        zero.text = name
        system.insert(0, zero)
    if engines:
        power = Element("channel", name="power")
        power.extend(_of_engine(lever, i) for i, lever in product(range(engines), levers))
        told = (_of_engine(word, i) for i, word in product(range(engines), parts.findall("told/*")))
        power.extend(word for word in told if _told(word) in read or _told(word).replace("[0]", "") in read)
        system.insert(len(system) - 1, power)
    return system


def _of_engine(part: Element, i: int) -> Element:
    """What is put in once an engine, for engine i."""
    return ElementTree.fromstring(ElementTree.tostring(part, "unicode").replace("{i}", f"{i}"))


def _told(word: Element) -> str:
    """The property by which FlightGear would tell the aircraft a word."""
    return (word.findtext("output") or "").strip()


def is_told(name: str) -> bool:
    """Whether the copy has a property of FlightGear's, from its own lever and engines."""
    plain = re.sub(r"\[\d+\]", "", name)
    return plain in {_told(word).replace("[{i}]", "") for word in _parts().findall("told/*")}


def instrument(
    source: Path, folder: Path, travel_rad: Mapping[str, tuple[float, float]], absent: Iterable[str] = (),
    gear_up: bool = False, apart: bool = False, views: Views | None = None,
) -> Path:  # fmt: skip
    """Write the instrumented copy of a model and what is beside it into an empty folder; returns its model.

    travel_rad: of each surface. absent: properties its files read that JSBSim alone does not give: 0 here.
    gear_up: its aerodynamics see a landing gear that is retracted, wherever its own flight control has it.
    apart: the power lever of each engine has a difference of its own. views: what of each surface's
    deflection the aerodynamics see, by what they call it; without, what these names usually mean.

    Raises BadInput where the failures cannot be put in, naming what is in the way.
    """
    whole = _parsed(source)
    if whole.tag != "fdm_config":
        raise BadInput(f"{source.name}: is {whole.tag}, allowed: a JSBSim model, fdm_config")
    model = copy_of(source, folder)
    whole = _parsed(model)
    (folder / SYSTEMS).mkdir(exist_ok=True)
    read = "".join(path.read_text("utf-8", "replace") for path in sorted(folder.rglob("*.xml")))
    aerodynamics = _aerodynamics(whole, source)
    if gear_up:
        absent = (*absent, RETRACTED)
        for element in aerodynamics.iter():
            sign, name = _property_in(element.text)
            if name == GEAR:
                element.text = f" {sign}{RETRACTED} "
    if views is None:
        seen = surfaces_of(source)
        views = {s: {name: usual_view(name, of) for name in seen.get(s, ())} for s, of in travel_rad.items()}
    _put_in(aerodynamics, folder, travel_rad, views)
    engines = _engines(whole, model)
    _add_signals(aerodynamics, engines)
    _add_pitch_fault(aerodynamics, source.stem)
    common = ElementTree.ElementTree(_common(engines, read, absent, apart))
    common.write(folder / SYSTEMS / "ftc-common.xml", encoding="utf-8", xml_declaration=True)
    place = list(whole).index(next(iter(whole.iter("aerodynamics"))))
    for i, system in enumerate((*travel_rad, "common")):
        whole.insert(place + i, Element("system", file=f"ftc-{system}"))
    ElementTree.ElementTree(whole).write(model, encoding="utf-8", xml_declaration=True)
    used = {model, *files_of(model)}
    for path in [path for path in folder.rglob("*.xml") if path not in used]:
        path.unlink()  # a file whose content stands in the model by now
    return model


def _engines(whole: Element, source: Path) -> int:
    propulsion = _section(whole, "propulsion", source)
    return 0 if propulsion is None else len(propulsion.findall("engine"))


def _aerodynamics(whole: Element, source: Path) -> Element:
    found = _section(whole, "aerodynamics", source)
    if found is None:
        raise BadInput(f"{source.stem}: has no aerodynamics, allowed: an aircraft that flies")
    return found


def _section(whole: Element, name: str, source: Path) -> Element | None:
    """A section of a model, read in from its own file if it is in one."""
    found = whole.find(name)
    if found is not None and found.get("file"):
        path = file_of(source, name, str(found.get("file")))
        place = list(whole).index(found)
        whole[place] = found = _parsed(path)
    return found


def seen_by_aerodynamics(source: Path) -> frozenset[str]:
    """Every property the aerodynamics of a model read."""
    read = (_property_in(element.text)[1] for element in _aerodynamics(_parsed(source), source).iter())
    return frozenset(name for name in read if _NAME.fullmatch(name))


def _property_in(text: str | None) -> tuple[str, str]:
    """(sign, name) of the property that an element reads, if it reads one; `x[0]` is x."""
    name = (text or "").strip()
    return ("-", name[1:].strip()) if name.startswith("-") else ("", name.removesuffix("[0]"))


def surfaces_of(source: Path, named: Mapping[str, Sequence[str]] | None = None) -> dict[str, tuple[str, ...]]:
    """The surfaces whose deflection the aerodynamics of a model see, and what they call it; named: what they
    call that of a surface, if not as JSBSim's own aircraft."""
    seen, by_name = sorted(seen_by_aerodynamics(source)), named or {}
    found = {}
    for surface in SURFACES:
        usual = [name for name in seen if (of := _NAMED.fullmatch(name)) and of[2] == surface]
        if names := tuple(by_name.get(surface, usual)):
            found[surface] = names
    return found


def others_of(source: Path, ours: Iterable[str]) -> tuple[str, ...]:
    """What else the aerodynamics of a model see of its flight control, and its landing gear; ours: what they
    call the deflections of surfaces."""
    seen = seen_by_aerodynamics(source) - set(ours)
    return tuple(sorted(name for name in seen if name.startswith(("fcs/", "gear/"))))


def unit_of(name: str) -> float:
    """How much of the unit that a name says a radian is; nan where it says a share of the travel."""
    found = _UNIT.search(name)
    return {"rad": 1.0, "deg": degrees(1.0), "norm": nan}[found[1].lower() if found else "rad"]


def usual_view(name: str, travel_rad: tuple[float, float]) -> View:
    """What the name of a deflection says of it: its sign, its unit, of which side."""
    found, unit = _NAMED.fullmatch(name), unit_of(name)
    # of the travel as built: a scenario, and the search for trim, may move the stops
    size = unit if isfinite(unit) else 1.0 / travel_rad[1]
    side, surface = (found[1], found[2]) if found else (None, "")
    if side == "mag":
        return tuple((rad, size * abs(rad)) for rad in (travel_rad[0], 0.0, travel_rad[1]))
    return -size if side == "right" and surface == "aileron" else size


def view_property(name: str, views: Views) -> str:
    """What the aerodynamics of the copy see in place of a property."""
    return next((_property(surface, name, of[name]) for surface, of in views.items() if name in of), name)


def _put_in(
    aerodynamics: Element, folder: Path, travel_rad: Mapping[str, tuple[float, float]], views: Views
) -> None:
    """Let the aerodynamics see our deflections, and write the actuators."""
    for surface, travel in travel_rad.items():
        of_it, used = views[surface], set()
        for element in aerodynamics.iter():
            sign, name = _property_in(element.text)
            if name in of_it:
                used.add(name)
                element.text = f" {sign}{_property(surface, name, of_it[name])} "
        system = actuator_system(surface, *travel, prefix=PREFIX)
        shown = (_component(surface, name, of_it[name]) for name in sorted(used) if of_it[name] != 1.0)
        extra = "".join(shown)
        system = re.sub(r"(\s*</channel>)", lambda end: f"{extra}{end.group(1)}", system)  # noqa: B023
        (folder / SYSTEMS / f"ftc-{surface}.xml").write_text(system, encoding="utf-8")


def _property(surface: str, name: str, view: View) -> str:
    """What the aerodynamics of the copy see in place of what they call a deflection."""
    own = re.sub(r"[^\w-]", "-", name.removeprefix("fcs/"))
    return f"fcs/{PREFIX}{surface}-effective-rad" if view == 1.0 else f"fcs/effective-{own}"


def _component(surface: str, name: str, view: View) -> str:
    of = f"<property> fcs/{PREFIX}{surface}-effective-rad </property>"
    if isinstance(view, float):
        formula = f"<product> <value> {view!r} </value> {of} </product>"
    else:
        rows = "\n".join(f"      {at!r} {value!r}" for at, value in _gone_on(view))
        var = of.replace("<property>", '<independentVar lookup="row">').replace(
            "</property>", "</independentVar>"
        )
        formula = f"<table> {var} <tableData>\n{rows}\n    </tableData> </table>"
    shown = _property(surface, name, view)
    return f'\n    <fcs_function name="{shown}"> <function> {formula} </function> </fcs_function>'


def _gone_on(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Points, and one beyond either end on the straight line there."""

    def beyond(at: float, end: tuple[float, float], inner: tuple[float, float]) -> tuple[float, float]:
        return at, end[1] + (at - end[0]) * (end[1] - inner[1]) / (end[0] - inner[0])

    first, last = beyond(-_FARTHEST_RAD, *points[:2]), beyond(_FARTHEST_RAD, *points[:-3:-1])
    return first, *points, last


def _add_signals(aerodynamics: Element, engines: int) -> None:
    """Let the aerodynamics compute the signals first."""
    functions = {function.get("name"): function for function in _parts().iter("function")}
    thrusts = functions["aero/thrust-coefficient"].find("quotient/sum")
    assert thrusts is not None
    thrusts[:0] = [_of_engine(thrusts[0], i) for i in range(engines)]
    thrusts.remove(thrusts[engines])
    first = sum(element.tag in _BEFORE_FUNCTIONS for element in aerodynamics)
    for signal, name in SIGNALS.items():
        if name in functions and (engines or signal in _OF_THE_FLOW):
            aerodynamics.insert(first, functions[name])


def _add_pitch_fault(aerodynamics: Element, name: str) -> None:
    axis = next((axis for axis in aerodynamics.iter("axis") if axis.get("name") == "PITCH"), None)
    if axis is None:
        raise BadInput(f"{name}: its aerodynamics have no pitch axis, allowed: one that has")
    axis.extend(_parts().findall("pitch/function"))
