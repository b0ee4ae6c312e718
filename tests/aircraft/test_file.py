"""An aircraft's file: its contract, what it must not say, and what follows from it."""

from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile, writing_property
from given import documents
from kept import keys_of
from trainer import trainer, trainer_file


def test_what_a_file_may_say(changed):
    assert not changed(keys_of(AircraftFile.model_json_schema()))


def terms(axis, n):
    return [{"name": f"{axis}_{i}", "value": 1.0, "of": {}} for i in range(n)]


GIVEN = documents("aircraft_files")[0]
TOO_MANY = {
    "too many": {"moments": {"Cm": terms("Cm", 65)}},
    "too many forces": {"forces": {"CZ": terms("CZ", 65)}},
}


def test_what_contradictions_are_called(changed):
    found = {}
    for case, given in (GIVEN["cannot"] | TOO_MANY).items():
        with pytest.raises(ValidationError) as caught:
            AircraftFile.model_validate(trainer_file(**given))
        found[case] = sorted(
            [".".join(map(str, (*error["loc"], *at))), says]
            for error in caught.value.errors()
            for at, says in error.get("ctx", {}).get("conflicts", [((), error["type"])])
        )
    assert not changed(found)


@pytest.mark.parametrize("given", [*GIVEN["can"].values(), {"moments": {"Cm": terms("Cm", 64)}}])
def test_what_is_just_allowed(given):
    assert trainer(**given).n in (3, 4)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("simulation/write-state-file", "simulation/write-state-file"),
        ("a/do_linearization/b", "simulation/do_linearization"),
        ("fcs/elevator-cmd-rad", ""),
    ],
)
def test_properties_that_write(text, names):
    assert writing_property(text) == names


def test_who_leads_who_stands_in_and_whom_a_force_tells_apart():
    """Two surfaces an axis. A leader goes with no other, and nobody measures the rate of sideslip."""
    many = trainer(**GIVEN["many"])
    assert many.surfaces == ("aileron", "elevator", "rudder", "tab", "flaperon", "fin")
    assert many.dominant_axis == (0, 1, 2, 1, 0, 2)
    assert many.primary == ("aileron", "elevator", "rudder")
    assert many.stand_ins == ("tab",)
    assert many.class_of_losses == ("aileron", "elevator", "rudder", "flaperon", "fin")
    assert dict(many.together) == {
        "aileron": (("aileron", 1.0), ("flaperon", -0.5)), "elevator": (("elevator", 1.0), ("tab", 0.3)),
        "rudder": (("rudder", 1.0),),
    }  # fmt: skip
    assert many.left_by_trim == ("fin",)
    assert many.separated_by_force("CZ") == (1, 3)
    assert many.separated_by_force("CY") == (2, 5)
    assert many.separated_by_force("CX") == ()  # one alone is told from none
    assert many.forces_separate_surfaces
    for left, sees in (("CY", True), ("CZ", True), ("", False)):
        one = {axis: of if axis == left else of[:1] for axis, of in GIVEN["many"]["forces"].items()}
        assert trainer(**{**GIVEN["many"], "forces": one}).forces_separate_surfaces is sees
    other = trainer(**{**GIVEN["many"], "groups": {"lateral": ["rudder", "fin", "flaperon", "aileron"],
                                          "pitch": ["tab", "elevator"]}})  # fmt: skip
    assert other.primary == ("rudder", "tab", "flaperon")
    assert other.stand_ins == ("elevator",)


def test_a_case_of_damage_may_take_nothing():
    of = {"dented": {"property": "a/b"}}
    assert not trainer().loses_surfaces
    assert not trainer(damage=of).loses_surfaces
    assert trainer(damage={**of, "off": {"property": "a/c", "takes": ["rudder"]}}).loses_surfaces


@pytest.mark.parametrize(
    ("term_of_power", "settings", "force_n", "by"),
    [(True, {}, None, "power"), (False, {}, None, "pitch"), (False, {"n": 1}, None, ""),
     (False, {"n": 1}, ((-50.0, 0.0, 51.0), (-40.0, 10.0, 90.0)), "power"),
     (False, {"n": 1}, ((-50.0, 0.0, 151.0), (-40.0, 10.0, 57.0)), "pitch")],
)  # fmt: skip
def test_what_holds_an_airspeed(term_of_power, settings, force_n, by):
    """Power that adds more than a hundredth of the weight (1000 kg: 98.07 N) wherever it adds least."""
    thrust = None if force_n is None else SimpleNamespace(force_n=force_n)
    its = SimpleNamespace(
        terms={"CX_dpt": 1} if term_of_power else {}, mass=SimpleNamespace(mass_kg=1000.0),
        engine=SimpleNamespace(thrust=thrust, settings=settings),
    )  # fmt: skip
    assert Aircraft.airspeed_by.func(its) == by
