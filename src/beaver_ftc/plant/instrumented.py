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
from beaver_ftc.documents.paths import data_root
from beaver_ftc.plant.model_file import SYSTEMS, copy_of, package

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
_EXTRA_PITCH = """<function name="aero/moment/unanticipated-lbsft">
  <description> The unanticipated fault: extra pitching moment on alpha cubed </description>
  <product> <property> aero/qbar-psf </property> <property> metrics/Sw-sqft </property>
  <property> metrics/cbarw-ft </property> <property> failures/unanticipated/Cm-alpha3 </property>
  <pow> <property> aero/alpha-rad </property> <value> 3 </value> </pow> </product>
</function>"""
_LEVER = """
    <fcs_function name="fcs/actuated-throttle-{i}-norm">
      <function> <property> fcs/actuated-throttle-norm </property> </function>
      <output> fcs/throttle-cmd-norm[{i}] </output>
    </fcs_function>"""
# What FlightGear tells an aircraft of its engines, from which some take lever and governor; {i}: of each.
_FROM_FLIGHTGEAR = {
    "/controls/engines/engine[{i}]/throttle": "fcs/actuated-throttle-norm",
    "/engines/engine[{i}]/mp-inhg": "propulsion/engine[{i}]/map-inhg",
    "/engines/engine[{i}]/rpm": "propulsion/engine[{i}]/engine-rpm",
}
_TOLD = """
    <fcs_function name="fcs/{name}-{i}">
      <function> <property> {of} </property> </function>
      <output> {told} </output>
    </fcs_function>"""
# What else of the aircraft's motion and engines its moments may depend on, dimensionless: name, JSBSim
# property, what it is. The aerodynamics reckon them themselves, so that they are those of the same instant.
_RATE = """<quotient> <product> <property> {rate} </property> <property> metrics/{arm} </property> </product>
    <max> <value> 1 </value>
      <product> <value> 2 </value> <property> velocities/vt-fps </property> </product> </max>
  </quotient>"""
_MOMENT = """<quotient> <property> moments/{axis}-prop-lbsft </property>
    <product> <property> metrics/Sw-sqft </property> <property> metrics/{arm} </property>
      <max> <property> aero/qbar-psf </property> <value> 1 </value> </max> </product> </quotient>"""
SIGNALS = {
    "thrust": ("aero/thrust-coefficient", "thrust of all engines over dynamic pressure and wing area"),
    "alpha_rate": ("aero/alphadot-hat", "rate of the angle of attack times c/2V"),
    "beta_rate": ("aero/betadot-hat", "rate of sideslip times b/2V"),
    "engines_l": ("aero/engines-roll-coefficient", "rolling moment of the engines over q S b"),
    "engines_m": ("aero/engines-pitch-coefficient", "pitching moment of the engines over q S c"),
    "engines_n": ("aero/engines-yaw-coefficient", "yawing moment of the engines over q S b"),
    "mach": ("velocities/mach", "Mach number"),
}
_FUNCTIONS = {
    "alpha_rate": _RATE.format(rate="aero/alphadot-rad_sec", arm="cbarw-ft"),
    "beta_rate": _RATE.format(rate="aero/betadot-rad_sec", arm="bw-ft"),
    "engines_l": _MOMENT.format(axis="l", arm="bw-ft"),
    "engines_m": _MOMENT.format(axis="m", arm="cbarw-ft"),
    "engines_n": _MOMENT.format(axis="n", arm="bw-ft"),
}
_THRUST = """<quotient> <sum> {thrusts} <value> 0 </value> </sum>
    <product> <property> metrics/Sw-sqft </property>
      <max> <property> aero/qbar-psf </property> <value> 1 </value> </max> </product>
  </quotient>"""
_COMMON = """<?xml version="1.0"?>
<system name="envelope and faults">
  ABSENT
  <property value="0"> failures/unanticipated/Cm-alpha3 </property>
  <property value="0"> envelope/airspeed-min-fps </property>
  <property value="1e6"> envelope/airspeed-max-fps </property>
  <property value="-3"> envelope/alpha-min-rad </property>
  <property value="3"> envelope/alpha-max-rad </property>
  <property value="0.7"> fcs/actuated-throttle-norm </property>
  ENGINES
  <channel name="envelope">
    <fcs_function name="aero/envelope-valid">
      <function> <and>
        <ge> <property> velocities/vt-fps </property> <property> envelope/airspeed-min-fps </property> </ge>
        <le> <property> velocities/vt-fps </property> <property> envelope/airspeed-max-fps </property> </le>
        <ge> <property> aero/alpha-rad </property> <property> envelope/alpha-min-rad </property> </ge>
        <le> <property> aero/alpha-rad </property> <property> envelope/alpha-max-rad </property> </le>
      </and> </function>
    </fcs_function>
  </channel>
</system>
"""


# What stands before all functions in aerodynamics, by JSBSim's own schema.
_BEFORE_FUNCTIONS = ("description", "alphalimits", "hysteresis_limits", "aero_ref_pt_shift_x")


@lru_cache
def _template() -> str:
    return (data_root() / "aircraft" / "actuator.xml").read_text(encoding="utf-8")


def actuator_system(surface: str, low_rad: float, high_rad: float, prefix: str = "") -> str:
    """A system file for a surface that travels from low_rad to high_rad, by `aircraft/actuator.xml`.

    prefix: begins the names of its signals, `fcs/<prefix><surface>-cmd-rad`, in an aircraft whose own flight
    control uses the plain ones.
    """
    start = _template().index("<system")
    text = _template()[start:].replace("fcs/SURFACE-", f"fcs/{prefix}SURFACE-")
    if prefix:  # JSBSim knows the plain ones without being told
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


def _common(engines: int, read: str, absent: Iterable[str]) -> str:
    """Envelope, the unanticipated fault, and one power lever for all engines; read: the aircraft's files;
    absent: what they read and nothing gives."""
    levers = "".join(_LEVER.format(i=i) for i in range(engines))
    power = f'<channel name="power">{levers}{_told(engines, read)}</channel>'
    zeros = "\n  ".join(f'<property value="0"> {name} </property>' for name in absent)
    return _COMMON.replace("ENGINES", power if engines else "").replace("ABSENT", zeros)


def _told(engines: int, read: str) -> str:
    """What FlightGear would tell the aircraft, of that which its files read."""
    told = []
    for i, (name, of) in product(range(engines), _FROM_FLIGHTGEAR.items()):
        known_as = {name.format(i=i), name.format(i=i).replace("[0]", "")}
        if any(each in read for each in known_as):
            ending = f"told-{name.rpartition('/')[2]}"
            told.append(_TOLD.format(name=ending, i=i, of=of.format(i=i), told=name.format(i=i)))
    return "".join(told)


def is_told(name: str) -> bool:
    """Whether the copy has a property of FlightGear's, from its own lever and engines."""
    plain = re.sub(r"\[\d+\]", "", name)
    return plain in {of.replace("[{i}]", "") for of in _FROM_FLIGHTGEAR}


def instrument(
    source: Path, folder: Path, travel_rad: dict[str, tuple[float, float]], absent: Iterable[str] = ()
) -> Path:
    """Write the instrumented copy of a model and what is beside it into an empty folder; returns its model.

    travel_rad: of each surface. absent: properties its files read that JSBSim alone does not give: 0 here.

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
    surfaces = _put_in(aerodynamics, folder, travel_rad)
    _add_signals(aerodynamics, _engines(whole))
    _add_pitch_fault(aerodynamics, source.stem)
    (folder / SYSTEMS / "ftc-common.xml").write_text(_common(_engines(whole), read, absent), "utf-8")
    place = list(whole).index(next(iter(whole.iter("aerodynamics"))))
    for i, system in enumerate((*(f"ftc-{surface}" for surface in surfaces), "ftc-common")):
        whole.insert(place + i, Element("system", file=system))
    ElementTree.ElementTree(whole).write(model, encoding="utf-8", xml_declaration=True)
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


def _put_in(aerodynamics: Element, folder: Path, travel_rad: dict[str, tuple[float, float]]) -> Iterable[str]:
    """Let the aerodynamics see our deflections, and write the actuators; returns the surfaces."""
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
    return tuple(travel_rad)


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
    """Let the aerodynamics reckon the signals first of all."""
    thrusts = " ".join(f"<property> propulsion/engine[{i}]/thrust-lbs </property>" for i in range(engines))
    functions = {"thrust": _THRUST.format(thrusts=thrusts), **_FUNCTIONS}
    if not engines:  # nor has the aircraft the properties
        functions = {signal: functions[signal] for signal in ("alpha_rate", "beta_rate")}
    first = sum(element.tag in _BEFORE_FUNCTIONS for element in aerodynamics)
    for signal, formula in functions.items():
        name, says = SIGNALS[signal]
        text = f'<function name="{name}"> <description> {says} </description> {formula} </function>'
        aerodynamics.insert(first, ElementTree.fromstring(text))


def _add_pitch_fault(aerodynamics: Element, name: str) -> None:
    axis = next((axis for axis in aerodynamics.iter("axis") if axis.get("name") == "PITCH"), None)
    if axis is None:
        raise BadInput(f"{name}: its aerodynamics have no pitch axis, allowed: one that has")
    axis.append(ElementTree.fromstring(_EXTRA_PITCH))
