"""The aircraft folder: JSBSim model, systems, start, scripts, the licence's notice, and our own file."""

import shutil
from math import radians
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import yaml

from beaver_ftc.aircraft import AIRCRAFT_FILE as FILE
from beaver_ftc.aircraft import KG_PER_LB, M_PER_FT, MAX_SURFACES
from beaver_ftc_aircraft.derive.sample import Envelope, Moves
from beaver_ftc_aircraft.gtm.aerodynamics import aerodynamics
from beaver_ftc_aircraft.gtm.database import WHERE, Database
from beaver_ftc_aircraft.gtm.elements import triple
from beaver_ftc_aircraft.gtm.masses import LBS_PER_SLUG, mass_balance, mass_of, structural_in
from beaver_ftc_aircraft.gtm.parameters import cases, parameters
from beaver_ftc_aircraft.gtm.steady import ALTITUDE_FT, HEADING_DEG, LATITUDE_DEG, LONGITUDE_DEG, Steady
from beaver_ftc_aircraft.gtm.systems import THROTTLE, damage_property, external_reactions, systems

NAME = "gtm"
_SAYS = "NASA Generic Transport Model T2: wind-tunnel tables, 17 surfaces, two jets, six cases of damage"


def write_model(base: Database, folder: Path) -> Path:
    """Write model and systems into a folder; returns the model."""
    (folder / "Systems").mkdir(parents=True, exist_ok=True)
    files = systems()
    for name, text in files.items():
        (folder / "Systems" / f"{name}.xml").write_text(text, encoding="utf-8")
    of = parameters()["geometry"]
    reference = triple(structural_in(of["reference_ft"]))
    names = "AERORP", "EYEPOINT", "VRP"
    points = "".join(f'<location name="{name}" unit="IN">{reference}</location>' for name in names)
    text = (
        '<?xml version="1.0"?>\n<fdm_config name="GTM T2" version="2.0" release="PRODUCTION">\n'
        "<fileheader><author>beaver-ftc</author>"
        f"<description>{escape(_SAYS)}</description></fileheader>\n"
        f'<metrics><wingarea unit="FT2">{of["area_ft2"]!r}</wingarea>'
        f'<wingspan unit="FT">{of["span_ft"]!r}</wingspan>'
        f'<chord unit="FT">{of["chord_ft"]!r}</chord>{points}</metrics>\n'
        f"{mass_balance()}\n<ground_reactions/>\n{external_reactions()}\n<propulsion/>\n"
        + "".join(f'<system file="{name}"/>\n' for name in files)
        + aerodynamics(base)
        + "\n</fdm_config>\n"
    )
    model = folder / f"{NAME}.xml"
    model.write_text(text, encoding="utf-8")
    return model


_KG_M2 = KG_PER_LB * LBS_PER_SLUG * M_PER_FT**2  # of a slug ft2
# Where the design model is found: about level flight, attached flow.
_ENVELOPE = {"airspeed_mps": [33.0, 60.0], "alpha_deg": [-1.0, 12.0]}
# Parts of it, airspeed in m/s and angle of attack in deg: from half the weight to a turn of 45 deg.
_REGIONS = (
    ((33.0, 39.0), (2.5, 12.0)), ((38.0, 44.0), (1.5, 9.5)), ((43.0, 49.0), (0.5, 8.0)),
    ((48.0, 54.0), (-0.5, 6.5)), ((53.0, 60.0), (-1.0, 5.5)),
)  # fmt: skip
_SIDESLIP_RAD, _ALTITUDE_M = 0.2, (0.0, 1500.0)


# Tables of elevators and rudders are straight to a third of their travel, of ailerons to half of it; level
# flight in light turbulence takes a fifth. What stands in stays within a twentieth of that.
MOVES = Moves((0.12, 0.18, 0.25, 0.35, 0.65, 1.0), 0.05)


def regions() -> list[Envelope]:
    """Parts of the envelope, each about a steady flight of its own."""
    return [
        Envelope(speed, (radians(low), radians(high)), _SIDESLIP_RAD, _ALTITUDE_M, of_region=True)
        for speed, (low, high) in _REGIONS
    ]


_START = {"airspeed_mps": 50.0, "altitude_m": round(ALTITUDE_FT * M_PER_FT, 2)}
_LEADS = {
    "left_inboard_elevator": dict.fromkeys(
        ("right_inboard_elevator", "left_outboard_elevator", "right_outboard_elevator"), 1.0
    ),
    "right_aileron": {"left_aileron": -1.0},
    "upper_rudder": {"lower_rudder": 1.0},
}
END_S = 15.0  # of a script
_STEERS = ("elevator", "aileron", "rudder")


def aircraft_file() -> dict[str, Any]:
    """Our own file without its terms: as many surfaces as an aircraft may have, what steers first."""
    surfaces = dict([*parameters()["surfaces"].items()][:MAX_SURFACES])
    # In flight spoilers, flaps and stabiliser stay where they are until what steers has been lost.
    steers = [name for name, of in surfaces.items() if of["kind"] in _STEERS and name not in _LEADS]
    first, *others = _LEADS
    groups = {"steers": [*others, *steers]}
    groups["stands_in"] = [first, *(s for s in surfaces if s not in groups["steers"] and s != first)]
    whole, geometry = mass_of(), parameters()["geometry"]
    inertia = whole.inertia * _KG_M2
    setting = {"property": THROTTLE, "says": "throttle of both engines", "unit": "share of 1", "default": 0.4}
    signal = {"property": "aero/thrust-coefficient", "sensed": True}
    return {
        "name": NAME,
        "description": _SAYS,
        "jsbsim": f"{NAME}.xml",
        "surfaces": {name: _surface(name, of["travel_deg"]) for name, of in surfaces.items()},
        "groups": groups,
        "signals": {"thrust": signal},
        "mass": {
            "mass_kg": whole.weight_lbf * KG_PER_LB,
            **{f"I{axis}_kgm2": float(inertia[i, i]) for i, axis in enumerate("xyz")},
            "Jxz_kgm2": -float(inertia[0, 2]),
        },
        "geometry": {
            "wing_area_m2": geometry["area_ft2"] * M_PER_FT**2,
            "span_m": geometry["span_ft"] * M_PER_FT,
            "chord_m": geometry["chord_ft"] * M_PER_FT,
        },
        "moments": {
            "Cl": [{"name": "Cl_aileron", "value": -0.05, "surface": "right_aileron"}],
            "Cm": [{"name": "Cm_elevator", "value": -0.4, "surface": "left_inboard_elevator"}],
            "Cn": [{"name": "Cn_rudder", "value": -0.05, "surface": "upper_rudder"}],
        },
        "envelope": _ENVELOPE,
        "trim": {"throttle": THROTTLE, "together": _LEADS},
        "engine": {"settings": {"throttle": setting | {"range": [0.0, 1.0]}}},
        "start": _START,
        "damage": {
            name: {"property": damage_property(name), "takes": [s for s in of["takes"] if s in surfaces]}
            for name, of in cases().items()
        },
    }


def _surface(name: str, travel_deg: list[float]) -> dict[str, Any]:
    says = {kind: f"fcs/{name}-{ending}-rad" for kind, ending in _ENDINGS.items()}
    return says | {"travel_rad": [round(radians(end), 9) for end in travel_deg]}


_ENDINGS = {"command": "cmd", "position": "pos", "effective": "effective"}


def write_outline(folder: Path) -> None:
    """Our own file as far as it is known before the terms are found."""
    text = yaml.safe_dump(aircraft_file(), sort_keys=False, default_flow_style=None, width=120)
    (folder / FILE).write_text(text, encoding="utf-8")


def write_start(folder: Path, steady: Steady) -> None:
    """The steady flight that scripts begin with."""
    u, v, w = steady.velocity_fps
    places = {
        "latitude": ("DEG", LATITUDE_DEG), "longitude": ("DEG", LONGITUDE_DEG),
        "altitudeMSL": ("FT", ALTITUDE_FT), "phi": ("DEG", steady.phi_deg),
        "theta": ("DEG", steady.theta_deg), "psi": ("DEG", HEADING_DEG),
        "ubody": ("FT/SEC", u), "vbody": ("FT/SEC", v), "wbody": ("FT/SEC", w),
    }  # fmt: skip
    kinds = {"latitude": ' type="geodetic"'}
    lines = [
        f'  <{name} unit="{unit}"{kinds.get(name, "")}> {number:.9g} </{name}>'
        for name, (unit, number) in places.items()
    ]
    says = f"<!-- Steady level flight at {steady.alpha_deg:g} deg; the script sets surfaces and throttle. -->"
    text = "\n".join(
        ['<?xml version="1.0"?>', says, '<initialize name="reset00">', *lines, "</initialize>\n"]
    )
    (folder / "reset00.xml").write_text(text, encoding="utf-8")


def write_scripts(folder: Path, steady: Steady) -> None:
    """A doublet of elevators, ailerons and rudders, and each case of damage, for plain JSBSim."""
    (folder / "scripts").mkdir(exist_ok=True)
    commands = steady.commands()
    kinds = (("elevator", -2.0, 1.0), ("rudder", 2.0, 4.0), ("aileron", 2.0, 7.0))
    events = []
    for kind, size_deg, at_s in kinds:
        for name, add_deg, time_s in (
            ("first", size_deg, at_s),
            ("second", -size_deg, at_s + 0.5),
            ("end of", 0.0, at_s + 1.0),
        ):
            values = {
                command: number + radians(_sign(command) * add_deg)
                for command, number in commands.items()
                if command.endswith(f"{kind}-cmd-rad")
            }
            events.append(_event(f"{kind} doublet, {name}", time_s, values))
    _script(folder, "doublets", commands, events)
    for case in cases():
        _script(folder, case, commands, [_event(case, 10.0, {damage_property(case): 1.0})])


def _sign(command: str) -> float:
    return -1.0 if command.startswith("fcs/left_aileron") else 1.0


_SAID = ("velocities/vt-fps", "aero/alpha-deg", "aero/beta-deg", *(f"velocities/{x}-rad_sec" for x in "pqr"))


def _event(name: str, at_s: float, values: dict[str, float]) -> str:
    sets = "".join(f'<set name="{prop}" value="{number:.9g}"/>' for prop, number in values.items())
    said = "".join(f"<property>{prop}</property>" for prop in _SAID)
    condition = f"<condition>simulation/sim-time-sec ge {at_s - 0.0025:g}</condition>"
    return f'    <event name="{name}">{condition}{sets}<notify>{said}</notify></event>'


def _script(folder: Path, name: str, commands: dict[str, float], events: list[str]) -> None:
    events = [*events, _event("the end", END_S - 0.01, {})]
    lines = [
        '<?xml version="1.0"?>',
        "<!-- For JSBSim's own runner; the root is the folder above aircraft/gtm. -->",
        f'<runscript name="GTM {name}">',
        f'  <use aircraft="{NAME}" initialize="reset00"/>',
        f'  <run start="0" end="{END_S:g}" dt="0.005">',
        *(f'    <property value="{number:.9g}">{command}</property>' for command, number in commands.items()),
        *events,
        "  </run>",
        "</runscript>\n",
    ]
    (folder / "scripts" / f"{name}.xml").write_text("\n".join(lines), encoding="utf-8")


NOTICE, AGREEMENT = "LICENSE.md", "LicenseAgreement.pdf"
_NOTICE = f"""# What this folder is made of

The tables in `{NAME}.xml` are those of NASA's GTM_DesignSim (LAR-17625-1),
{WHERE}:
extended along straight lines, split and rewritten for JSBSim by beaver-ftc. The numbers of mass, engines,
actuators and damage are of the same source. These are changes; NASA endorses none of them.

The source is under the **NASA Open Source Agreement, version 1.3**, {AGREEMENT} of that repository, which
must travel with each copy of the software and any part of it: it is beside this file if it was beside the
data base, else put it there before you pass the folder on. It allows use, copying, changing and passing on,
royalty-free, and disclaims all warranties.

> Copyright 2009 United States Government as represented by the Administrator of the National and Aeronautics
> and Space Administration. No copyright is claimed in the United States under Title 17, U.S. Code. All Other
> Rights Reserved.
"""


def write_notice(folder: Path, database: Path) -> None:
    """The licence's notice, and the agreement where it is beside the data base."""
    (folder / NOTICE).write_text(_NOTICE, encoding="utf-8")
    if (database.parent / AGREEMENT).is_file():
        shutil.copyfile(database.parent / AGREEMENT, folder / AGREEMENT)
