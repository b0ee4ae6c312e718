"""The aircraft's XML is the sourced table, term by term."""

import pytest
from tools.actuators import files

from beaver_ftc.aircraft import load
from beaver_ftc.design.fdc import (
    COEFFICIENTS,
    GEOMETRY,
    MASS,
    SURFACES,
    TERMS,
    TRAVEL,
    coefficient_terms,
)
from beaver_ftc.design.model import inertia_coefficients
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
# 1 slug is 32.17404855... lbm; the international pound and foot are exact.
KG_PER_SLUG = 0.45359237 * 9.80665 / 0.3048
OPERATIONS = ("product", "sum", "max", "ifthen")
SLUG_FT2_PER_KG_M2 = 1 / (KG_PER_SLUG * 0.3048**2)


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
    wanted = {f"aero/coefficient/{term.name}" for term in coefficient_terms(coefficient)}
    if coefficient == "Cm":
        wanted.add("aero/coefficient/Cm_unanticipated")
    (total,) = function.findall("sum")
    listed = [part.get("name") or part.text.strip() for part in total]
    assert set(listed) == wanted
    assert len(listed) == len(wanted)


def test_there_is_no_scalable_term_the_table_lacks(xml):
    scales = {name for name in declared(xml) if name.endswith("-scale") and name.startswith("uncertainty/")}
    assert scales == {f"uncertainty/{name}-scale" for name in TERMS}


def test_each_axis_stands_once(xml):
    assert [axis.get("name") for axis in xml.iter("axis")] == ["X", "Y", "Z", "ROLL", "PITCH", "YAW"]


def test_geometry_and_mass(xml):
    metrics, mass = xml.find("metrics"), xml.find("mass_balance")
    unit = {"wingarea": ("FT2", 0.3048**2), "wingspan": ("FT", 0.3048), "chord": ("FT", 0.3048)}
    wanted = {"wingarea": GEOMETRY.wing_area_m2, "wingspan": GEOMETRY.span_m, "chord": GEOMETRY.chord_m}
    for name, (feet, in_si) in unit.items():
        assert metrics.find(name).get("unit") == feet
        assert float(metrics.find(name).text) * in_si == pytest.approx(wanted[name], rel=1e-15)
    assert float(mass.find("emptywt").text) == MASS.mass_kg


@pytest.mark.parametrize("axes", ["xx", "yy", "zz", "xz"])
def test_inertia(xml, axes):
    table = {"xx": MASS.Ix_kg_m2, "yy": MASS.Iy_kg_m2, "zz": MASS.Iz_kg_m2, "xz": MASS.Jxz_kg_m2}
    element = xml.find("mass_balance").find(f"i{axes}")
    assert element.get("unit") == "SLUG*FT2"
    assert float(element.text) / SLUG_FT2_PER_KG_M2 == pytest.approx(table[axes], rel=1e-15)


def test_reference_lengths_in_the_rates_are_the_table_s(functions):
    assert numbers(functions["aero/q-hat"]) == [GEOMETRY.chord_m]
    for name in ("aero/p-hat", "aero/r-hat", "aero/betadot-hat"):
        assert numbers(functions[name]) == [GEOMETRY.span_m / 2]


@pytest.mark.parametrize(("axis", "name"), [("p", "Pqr"), ("q", "Qpr"), ("r", "Rpq")])
def test_inertia_coupling_error_has_the_table_s_coefficient(functions, axis, name):
    written = numbers(functions[f"uncertainty/{axis}dot-rad_sec2"].find("ifthen/sum"))
    assert written == pytest.approx([getattr(inertia_coefficients(MASS), name)], abs=1e-12)


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
