"""An instrumented copy of an aircraft of the jsbsim package: the failures of the built-in one, put in between
its actuators and its aerodynamics.

The aerodynamics of the copy see the deflections of our own actuators, one system file a surface, in place of
those of the aircraft's flight control; all else is the aircraft's own. The files on disk stay as they are.
"""

import re
from collections.abc import Iterable
from functools import lru_cache
from itertools import product
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant.model_file import SYSTEMS, copy_of, files_of, package

PREFIX = "actuated-"
# What aerodynamics of JSBSim's aircraft call the deflection of each surface, and the sign and shape of it.
_SEEN = {
    "aileron": {
        "fcs/left-aileron-pos-rad": "rad", "fcs/right-aileron-pos-rad": "opposite",
        "fcs/aileron-pos-rad": "rad",
        "fcs/left-aileron-pos-norm": "norm", "fcs/left-aileron-pos-deg": "deg",
    },
    "elevator": {
        "fcs/elevator-pos-rad": "rad", "fcs/mag-elevator-pos-rad": "magnitude",
        "fcs/elevator-pos-norm": "norm",
        "fcs/elevator-pos-deg": "deg",
    },
    "rudder": {
        "fcs/rudder-pos-rad": "rad", "fcs/mag-rudder-pos-rad": "magnitude", "fcs/rudder-pos-norm": "norm",
        "fcs/rudder-pos-deg": "deg",
    },
}  # fmt: skip
_SHAPES = {
    "opposite": "<product> <value> -1 </value> {of} </product>",
    "magnitude": "<abs> {of} </abs>",
    "deg": "<product> <value> 57.29577951308232 </value> {of} </product>",
    # of the travel as built: a scenario, and the search for trim, may move the stops
    "norm": "<quotient> {of} <value> {whole!r} </value> </quotient>",
}
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


def engines_of(source: Path) -> int:
    """How many engines an aircraft has."""
    return _engines(_parsed(source))


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
    source: Path, folder: Path, travel_rad: dict[str, tuple[float, float]], absent: Iterable[str] = (),
    gear_up: bool = False, apart: bool = False,
) -> Path:  # fmt: skip
    """Write the instrumented copy of a model and what is beside it into an empty folder; returns its model.

    travel_rad: of each surface. absent: properties its files read that JSBSim alone does not give: 0 here.
    gear_up: its aerodynamics see a landing gear that is retracted, wherever its own flight control has it.
    apart: the power lever of each engine has a difference of its own.

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
        for element in aerodynamics.iter("property"):
            element.text = (element.text or "").replace(GEAR, RETRACTED)
    _put_in(aerodynamics, folder, travel_rad)
    _add_signals(aerodynamics, _engines(whole))
    _add_pitch_fault(aerodynamics, source.stem)
    common = ElementTree.ElementTree(_common(_engines(whole), read, absent, apart))
    common.write(folder / SYSTEMS / "ftc-common.xml", encoding="utf-8", xml_declaration=True)
    place = list(whole).index(next(iter(whole.iter("aerodynamics"))))
    for i, system in enumerate((*travel_rad, "common")):
        whole.insert(place + i, Element("system", file=f"ftc-{system}"))
    ElementTree.ElementTree(whole).write(model, encoding="utf-8", xml_declaration=True)
    used = {model, *files_of(model)}
    for path in [path for path in folder.rglob("*.xml") if path not in used]:
        path.unlink()  # a file whose content stands in the model by now
    return model


def _engines(whole: Element) -> int:
    propulsion = whole.find("propulsion")
    return 0 if propulsion is None else len(propulsion.findall("engine"))


def _aerodynamics(whole: Element, source: Path) -> Element:
    """The aerodynamics, read in from their own file if they are in one."""
    found = whole.find("aerodynamics")
    if found is None:
        raise BadInput(f"{source.stem}: has no aerodynamics, allowed: an aircraft that flies")
    if found.get("file"):
        named = (source.parent / str(found.get("file"))).with_suffix(".xml")
        place = list(whole).index(found)
        whole[place] = found = _parsed(named)
    return found


def seen_by_aerodynamics(source: Path) -> frozenset[str]:
    """Every property the aerodynamics of a model read."""
    read = (element.text or "" for element in _aerodynamics(_parsed(source), source).iter())
    return frozenset(text.strip().lstrip("-") for text in read if "/" in text)


def surfaces_of(source: Path) -> tuple[str, ...]:
    """The surfaces whose deflection the aerodynamics of a model see."""
    seen = seen_by_aerodynamics(source)
    return tuple(surface for surface, known in _SEEN.items() if seen & set(known))


def others_of(source: Path) -> tuple[str, ...]:
    """What else the aerodynamics of a model see of its flight control, and its landing gear."""
    ours = {name for known in _SEEN.values() for name in known}
    seen = seen_by_aerodynamics(source) - ours
    return tuple(sorted(name for name in seen if name.startswith(("fcs/", "gear/"))))


def _put_in(aerodynamics: Element, folder: Path, travel_rad: dict[str, tuple[float, float]]) -> None:
    """Let the aerodynamics see our deflections, and write the actuators."""
    for surface, travel in travel_rad.items():
        shapes = set()
        for element in aerodynamics.iter():
            text = (element.text or "").strip()
            shape = _SEEN[surface].get(text.lstrip("-"))
            if shape is not None:
                shapes.add(shape)
                element.text = f" {'-' if text.startswith('-') else ''}{_property(surface, shape)} "
        system = actuator_system(surface, *travel, prefix=PREFIX)
        extra = "".join(_component(surface, shape, travel[1]) for shape in sorted(shapes - {"rad"}))
        system = re.sub(r"(\s*</channel>)", lambda end: f"{extra}{end.group(1)}", system)  # noqa: B023
        (folder / SYSTEMS / f"ftc-{surface}.xml").write_text(system, encoding="utf-8")


def _property(surface: str, shape: str) -> str:
    """What the aerodynamics of the copy see."""
    ending = "-effective-rad" if shape == "rad" else f"-effective-{shape}"
    return f"fcs/{PREFIX}{surface}{ending}"


def _component(surface: str, shape: str, whole: float) -> str:
    of = f"<property> {_property(surface, 'rad')} </property>"
    formula = _SHAPES[shape].format(of=of, whole=whole)
    name = _property(surface, shape)
    return f'\n    <fcs_function name="{name}"> <function> {formula} </function> </fcs_function>'


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
