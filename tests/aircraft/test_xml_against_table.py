"""The aircraft's XML is the sourced table, term by term."""

import pytest
from tools.actuators import files

from beaver_ftc.aircraft import load
from beaver_ftc.design.fdc import (
    COEFFICIENTS,
    SURFACES,
    TERMS,
    TRAVEL,
)
from beaver_ftc.plant.model_file import with_systems

PROPERTY_OF = {
    "alpha": "aero/alpha-rad",
    "beta": "aero/beta-rad",
    "ph": "aero/p-hat",
    "qh": "aero/q-hat",
    "rh": "aero/r-hat",
    "betadoth": "aero/betadot-hat",
    "aileron": "fcs/aileron-effective-rad",
    "elevator": "fcs/elevator-effective-rad",
    "rudder": "fcs/rudder-effective-rad",
    "flap": "fcs/flap-effective-rad",
    "dpt": "aero/dpt",
}
OPERATIONS = ("product", "sum", "max", "ifthen")


@pytest.fixture(scope="module")
def xml():
    return with_systems(load().jsbsim)


@pytest.fixture(scope="module")
def functions(xml):
    """What can be read as a property: functions, and operations inside one that have a name."""
    named = [e for e in xml.iter() if e.tag in ("function", *OPERATIONS) and "name" in e.attrib]
    assert len({function.get("name") for function in named}) == len(named), "a function is defined twice"
    return {function.get("name"): function for function in named}


def properties(element):
    return [each.text.strip() for each in element.iter("property")]


def numbers(element):
    return [float(each.text) for each in element.iter("value")]


def declared(xml):
    valued = [each for each in xml.iter("property") if "value" in each.attrib]
    return {each.text.strip(): float(each.get("value")) for each in valued}


@pytest.mark.parametrize("name", TERMS)
def test_term_is_value_times_factors_times_its_scale(functions, xml, name):
    term, function = TERMS[name], functions[f"aero/coefficient/{name}"]
    assert function.tag == "product" or [child.tag for child in function] == ["description", "product"]
    assert numbers(function) == [term.value]
    wanted = [PROPERTY_OF[factor] for factor in term.factors] + [f"uncertainty/{name}-scale"]
    assert sorted(properties(function)) == sorted(wanted)
    assert f"[{term.source}]" in function.find("description").text
    assert declared(xml)[f"uncertainty/{name}-scale"] == 1


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_coefficient_is_the_sum_of_its_terms(functions, coefficient):
    function = functions[f"aero/coefficient/{coefficient}"]
    wanted = {f"aero/coefficient/{name}" for name, term in TERMS.items() if term.coefficient == coefficient}
    if coefficient == "Cm":
        wanted.add("aero/coefficient/Cm_unanticipated")
    (total,) = function.findall("sum")
    listed = [part.get("name") or part.text.strip() for part in total]
    assert set(listed) == wanted
    assert len(listed) == len(wanted)


def test_there_is_no_scalable_term_the_table_lacks(xml):
    scales = {name for name in declared(xml) if name.endswith("-scale") and name.startswith("uncertainty/")}
    assert scales == {f"uncertainty/{name}-scale" for name in TERMS}


def test_envelope_is_the_table_s(functions):
    limits = numbers(functions["aero/envelope-valid"])
    assert limits == pytest.approx([*load().envelope.airspeed_mps, *load().alpha_rad], abs=1e-9)


@pytest.mark.parametrize("surface", SURFACES)
def test_travel_is_the_table_s(xml, surface):
    ends = [declared(xml)[f"actuators/{surface}/position-{end}-rad"] for end in ("min", "max")]
    assert ends == [TRAVEL[surface].min_rad, TRAVEL[surface].max_rad]


def test_the_actuators_are_written_from_their_template():
    """JSBSim has no macros: the files are copies of one text, and stay copies."""
    assert {path.stem for path in files() if path.is_relative_to(load().folder)} == set(SURFACES)
    for path, text in files().items():
        assert path.read_text() == text, "run python -m tools.actuators"
