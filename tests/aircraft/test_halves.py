"""The Beaver with halves by side: what one side does, and that both together are the Beaver."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES, MOMENTS
from beaver_ftc.diagnosis.isolation import list_estimators
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from samples import samples
from tools import split

SIDES = ("left", "right")
ANGLE = st.floats(-0.3, 0.3)


@pytest.fixture(scope="module")
def halves():
    return load("beaver-split")


def test_its_files_are_what_the_tool_writes(halves):
    for name, text in split.split_beaver().items():
        assert (halves.folder / name).read_text(encoding="utf-8") == text, "run python -m tools.split"


@settings(max_examples=samples(40), deadline=None)
@given(st.lists(ANGLE, min_size=11, max_size=11))
def test_both_sides_moved_as_one_are_the_whole(state):
    whole, halves = load(), load("beaver-split")
    names = (*whole.signal_names, "betadoth", *whole.surfaces)
    of = dict(zip(names, state, strict=True))
    of |= {"aileron_left": -of["aileron"], "aileron_right": of["aileron"]}
    of |= {f"flap_{side}": of["flap"] for side in SIDES}
    for name in (*FORCES, *MOMENTS):
        assert halves.coefficient(name, of) == pytest.approx(whole.coefficient(name, of), abs=1e-12)


@settings(max_examples=samples(20), deadline=None)
@given(ANGLE, ANGLE)
def test_the_sides_are_mirror_images(deflection, alpha):
    """Trailing edge down on one side or the other: the same lift and pitch, the opposite roll and yaw."""
    halves = load("beaver-split")
    still = dict.fromkeys((*halves.signal_names, "betadoth", *halves.surfaces), 0.0) | {"alpha": alpha}
    for surface in ("aileron", "flap"):
        one, other = (still | {f"{surface}_{side}": deflection} for side in SIDES)
        for name, sign in (("CX", 1), ("CZ", 1), ("Cm", 1), ("Cl", -1), ("Cn", -1)):
            by_one, by_other, none = (halves.coefficient(name, of) for of in (one, other, still))
            assert by_one - none == pytest.approx(sign * (by_other - none), abs=1e-12)


def test_lift_acts_where_the_half_is(halves):
    """Of the right aileron: roll is lift times its arm, by the source's roll; pitch that of a section."""
    terms = halves.terms
    lift = -terms["CZ_da_right"].value
    assert terms["Cl_da_right"].value == pytest.approx(-lift * 0.775 * 0.5)
    assert terms["Cl_da_right"].value == pytest.approx(-0.09917 / 2)
    assert terms["Cm_da_right"].value / lift == pytest.approx(split.section_moment())
    assert split.section_moment() == pytest.approx(-0.1697, abs=1e-4)  # thin aerofoil, hinge at 3/4 chord


def test_the_truth_flies_as_the_whole(halves):
    """Both in trim at 45 m/s, which one aileron changes a little, then surfaces moved alike."""
    plants = {name: Plant(100, aircraft=load(name)) for name in ("beaver", "beaver-split")}
    angles = {"aileron": 0.05, "elevator": -0.08, "rudder": 0.03, "flap": 0.1}
    by_side = {"aileron_left": -0.05, "aileron_right": 0.05, "flap_left": 0.1, "flap_right": 0.1}
    found = []
    for name, plant in plants.items():
        trim(45.0, 1828.8, plant=plant)
        for surface, rad in (angles if name == "beaver" else {**angles, **by_side}).items():
            if surface in plant.aircraft.surfaces:
                plant.write(f"fcs/{surface}-cmd-rad", rad)
        plant.run()
        found.append([plant.read(f"aero/coefficient/{c}") for c in (*FORCES, *MOMENTS)])
    assert found[1] == pytest.approx(found[0], abs=4e-3)


def test_the_published_class_has_both_ailerons_and_no_stand_in(halves):
    assert halves.stand_ins == ("flap_left", "flap_right")
    assert {name for name, _, _ in list_estimators("published", halves)} == {
        "aileron_left", "aileron_right", "elevator", "rudder",
    }  # fmt: skip
