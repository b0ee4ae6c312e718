"""The generated reference: what stands in it is there, each key is whole, and each example loads."""

import json
from functools import cache

import pytest
import yaml
from tools.docs.reference import columns, keys, page
from tools.docs.reference.schema import ITEM, NAME, Sections

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import load_text
from beaver_ftc.scenario.signals import Signal
from beaver_ftc.scenario.sweeps import Variation, load_sweep_text
from beaver_ftc_assurance.evidence.plan import load_plan
from beaver_ftc_logs.vehicle import Vehicle
from scenario.damageable import damageable

LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.4, "at_s": 12}
PROFILE = {"altitude_m": [{"value": 1900}], "airspeed_mps": [{"value": 45}], "heading_deg": [{"value": 90}]}
CASE = "left-wing-tip-off"  # the example's
REQUIREMENT = {"id": "A", "over": ["elevator-stuck"], "expect": {"no_departure": True}}
NO_TERMS = {"Cl": [], "Cm": [], "Cn": []}
# What a file says besides the key in question.
BEAVER = yaml.safe_load((load().folder / "aircraft.yaml").read_text())
THRUST = {"airspeed_mps": [40, 60], "setting": [10, 20], "force_n": [[0, 900], [0, 500]]}
AROUND = {
    "scenario-keys": {"": {"name": "x"}, "expect": {"faults": [LOSS], "autopilot": PROFILE}},
    "sweep-keys": {"": {"name": "x", "runs": 10, "base": "elevator-partial-loss"}},
    "plan-keys": {"": {"name": "x", "requirements": [REQUIREMENT]}},
    "aircraft-keys": {
        "": BEAVER | {"engine": BEAVER["engine"] | {"thrust": THRUST}},
        "moments": {"moments": NO_TERMS},
        "forces": {"moments": NO_TERMS, "forces": {}},
    },
    "vehicle-keys": {},
}
NAMES = {"surfaces": "elevator", "vary": "faults[0].magnitude"}  # what stands for NAME; else any name


@cache
def sections(kind):
    return Sections(keys.KINDS[kind].schema())


EVERY = [
    pytest.param(kind, section, id=f"{kind}:{section.title}")
    for kind in keys.KINDS
    for section in sections(kind)
]


def lacks(section, key):
    """What is not said of a key: its meaning, its example, range and unit of its numbers."""
    lacking = [] if key.says else ["meaning"]
    lacking += [] if key.sections or key.example is not None else ["example"]
    if key.number is None or key.sections:
        return lacking
    lacking += [] if key.range else ["range"]
    pure = key.number["type"] == "integer" or key.name == "options"  # each option has its own unit
    return lacking + ([] if pure or all(key.unit(place) for place in section.places) else ["unit"])


@pytest.mark.parametrize(("kind", "section"), EVERY)
def test_each_key_is_whole(kind, section):
    assert [(key.name, lacking) for key in section.keys if (lacking := lacks(section, key))] == []


# Sections that are nothing without one of several keys: what is taken, and the keys that stand without it.
LEAST = {
    "Signal": {"step": {"amplitude_deg_s": 2}},
    "Change": {"law": "nominal"},
    "AltitudeLeg": {"value": 1900},
    "AirspeedLeg": {"value": 45},
    "HeadingLeg": {"value": 90},
    "BankLeg": {"value": 20},
    "Variation": {"uniform": [0.2, 0.4]},
    "ErrorBox": {"signals": {"dpt": [0, 1]}},
    "Requirement": {"expect": {"no_departure": True}},
    "Level": {"at_most": 1},
    "QuantileLevel": {"at_most": 1},
}
ALONE = {"hold", "expect", "formula", "bar", *Signal.model_fields, *Variation.model_fields}


def required(schema, section):
    """Examples of the keys that the section cannot do without."""
    return {key.name: value_of(schema, section, key) for key in section.keys if key.required}


def value_of(schema, section, key):
    """The example of a key; of one that holds sections, the least that may stand there."""
    if not key.sections or key.example is not None:
        return key.example
    below, here = schema.found[key.sections[0]], (*section.places[0].path, key.name)
    value = required(schema, below) | LEAST.get(below.title, {})
    inside = next(place.path for place in below.places if place.path[: len(here)] == here)[len(here) :]
    return wrapped(schema, inside, here, value)


def wrapped(schema, path, above, value):
    """A value at a path below `above`, each section on the way with what it cannot do without."""
    for i in reversed(range(len(path))):
        before = (*above, *path[:i])
        if path[i] == ITEM:
            value = [value]
        elif path[i] == NAME:
            value = {NAMES.get(before[-1], "any"): value}
        else:
            section = next(one for one in schema if any(place.path == before for place in one.places))
            value = required(schema, section) | {path[i]: value}
    return value


def document(kind, section, key):
    """A file that has the key's example at the first place of its section, and what it cannot do without."""
    schema = sections(kind)
    least = {} if key.name in ALONE else LEAST.get(section.title, {})
    value = {**required(schema, section), **least, **key.needs, key.name: value_of(schema, section, key)}
    path = section.places[0].path
    around = {**AROUND[kind].get("", {}), **AROUND[kind].get(path[0] if path else "", {})}
    made = merged(around, wrapped(schema, path, (), value))
    damaged = any(
        fault.get("type") == "damage" for fault in made.get("faults", ()) if kind == "scenario-keys"
    )
    return made | ({"aircraft": "./plane"} if damaged else {})


def merged(one, other):
    """Mappings merged, the second one's values before the first one's."""
    if not isinstance(one, dict) or not isinstance(other, dict):
        return other
    return {**one, **{name: merged(one.get(name), value) for name, value in other.items()}}


def loaded_plan(text, folder):
    if '"type": "sweep"' in text:  # such a bar is of a sweep
        text = text.replace('"elevator-stuck"', '"certain-aileron-loss"')
    for name in json.loads(text).get("flights", {}):  # each is flown for a requirement
        text = text.replace('"elevator-stuck"', f'"{name}"')
    (folder / "plan.yaml").write_text(text)
    return load_plan(str(folder / "plan.yaml"))


LOADERS = {
    "scenario-keys": lambda text, folder: load_text(text, folder=folder),
    "sweep-keys": lambda text, folder: load_sweep_text(text, folder=folder),
    "plan-keys": loaded_plan,
    "aircraft-keys": lambda text, folder: AircraftFile.model_validate(yaml.safe_load(text)),
    "vehicle-keys": lambda text, folder: Vehicle.model_validate(yaml.safe_load(text)),
}


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """A folder with the files that examples name."""
    folder = tmp_path_factory.mktemp("beside")
    (folder / "pilot.csv").write_text("t_s,q_deg_s,rate_deg_s\n0,0,0\n1,2,2\n")
    damageable(folder / "plane", {CASE: {"property": f"failures/damage/{CASE}"}})
    return folder


@pytest.mark.parametrize(("kind", "section"), EVERY)
def test_each_example_loads(kind, section, beside):
    refused = {}
    for key in section.keys:
        try:
            LOADERS[kind](json.dumps(document(kind, section, key)), beside)
        except (ValueError, BadInput) as error:
            refused[key.name] = str(error)
    assert refused == {}


@pytest.mark.parametrize("kind", keys.KINDS)
def test_the_example_of_a_whole_file_loads(kind, tmp_path):
    text = (keys.EXAMPLES / f"{kind}.yaml").read_text()
    assert any(f"```yaml\n{text}```" in page(name) for name, of in keys.PAGES.items() if kind in of[2])
    if kind == "plan-keys":
        (tmp_path / "plan.yaml").write_text(text)
        load_plan(str(tmp_path / "plan.yaml"))
    else:
        LOADERS[kind](text, tmp_path)


def test_every_column_of_a_log_has_a_meaning():
    patterns = yaml.safe_load(columns.TEXTS.read_text())["log"]["columns"]
    for name in ("elevator-partial-loss", "aileron-stuck"):
        flight = bf.fly(bf.load(name).with_({"duration_s": 0.1, "faults": [], "expect": {}}))
        for column in flight.log.columns:
            assert columns.pattern_of(column, patterns), column


@pytest.mark.parametrize("table", columns.tables())
def test_every_meaning_is_of_a_column(table):
    patterns = yaml.safe_load(columns.TEXTS.read_text())[table]["columns"]
    used = {columns.pattern_of(name, patterns) for name in columns.tables()[table]}
    assert used == set(patterns)
