"""An aircraft's file: its contract, what it must not say, and what follows from it."""

from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.schema import AircraftFile, writing_property
from kept import keys_of
from trainer import trainer, trainer_file


def test_what_a_file_may_say(changed):
    assert not changed(keys_of(AircraftFile.model_json_schema()))


def term(name="x", of=None, **keys):
    return {"name": name, "value": 1.0, "of": of or {}, **keys}


def box(**keys):
    span = dict.fromkeys(
        ("airspeed_mps", "alpha_rad", "beta_rad", "p_rad_s", "q_rad_s", "r_rad_s", "density_kg_m3"), (0, 1)
    )
    errors = {f"error_{axis}_rad_s2": [[0, 1], [1, 2]] for axis in "pqr"}
    return {
        "model_error_map": {
            "travel_share": [0.5, 1],
            "until_s": [9, 99],
            "boxes": [{**span, **errors, **keys}],
        }
    }


THRUST = {"airspeed_mps": [40, 60], "setting": [0, 900, 3000], "force_n": [[-9, 7, 80], [-30, 5, 60]]}
SHARE = {"throttle": "a/b", "share": 0.5, "right_m": -4.9}
EFFECTORS = {"left": SHARE, "right": SHARE | {"throttle": "a/c", "right_m": 4.8}}
CANNOT = {
    "ends": {"envelope": {"airspeed_mps": [65, 65], "alpha_deg": [14, -4]}},
    "stops": {"surfaces": {"tab": {"travel_rad": [0.2, 0.2]}}},
    "beyond a half turn": {"surfaces": {"tab": {"travel_rad": [-3.21, 3.21]}}},
    "box": box(beta_rad=[1, 0.9]),
    "inertia": {"mass": {"Ix_kgm2": 4.0, "Iz_kgm2": 9.0, "Jxz_kgm2": 6.0}},
    "default below": {"engine": {"settings": {"n": {"property": "a/b", "default": 0.9, "range": [1, 2]}}}},
    "default above": {"engine": {"settings": {"n": {"property": "a/b", "default": 2.1, "range": [1, 2]}}}},
    "short rows": box(error_q_rad_s2=[[0, 1], [1]]),
    "few rows": box(error_r_rad_s2=[[0, 1]]),
    "groups": {"groups": {"lateral": ["aileron", "ruder"], "pitch": ["elevator", "elevator"]}},
    "no group": {"groups": {"lateral": ["aileron", "rudder"], "pitch": None, "none": []}},
    "signals of terms": {"moments": {"Cl": [term(of={"alfa": 1}), term("y", {"betadoth": 1})]}},
    "surfaces of terms": {"forces": {"CY": [term(surface="tab"), term("y", {"betadoth": 1})]}},
    "a rate and a surface": {"moments": {"Cn": [term(of={"qh": 1, "alpha": 1}, surface="rudder")]}},
    "twice": {"forces": {"CX": [term("Cl_p"), term("CX_a"), term("CX_a")]}},
    "too many": {"moments": {"Cm": [term(f"Cm_{i}") for i in range(65)]}},
    "too many forces": {"forces": {"CZ": [term(f"CZ_{i}") for i in range(65)]}},
    "signals of a box": box(signals={"dpt": [0, 1]}),
    "signals not in a box": {**box(), "signals": {"dpt": {"property": "aero/dpt"}}},
    "signals measured anyway": {"signals": {"alpha": {"property": "a/b"}, "betadoth": {"property": "a/b"}}},
    "signals nobody measures": {"signals": {"dpt": {"property": "aero/dpt", "sensed": False}}},
    "together": {
        "trim": {
            "together": {
                "aileron": {"rudder": 1, "tab": 1},
                "elevator": {"rudder": 1, "aileron": 1},
                "fin": {},
            }
        }
    },
    "damage of nothing": {"damage": {"off": {"property": "a/b", "takes": ["rudder", "fin"]}}},
    "effectors alone": {"effectors": EFFECTORS},
    "too much of a share": {
        "engine": {"thrust": THRUST},
        "effectors": {**EFFECTORS, "mid": SHARE | {"share": 0.1}},
    },
    "thrust by no setting": {"engine": {"thrust": THRUST}, "trim": {"throttle": "a/b"}},
    "thrust below the setting": {"engine": {"thrust": THRUST | {"setting": [-1, 900, 2000]}}},
    "thrust above the setting": {"engine": {"thrust": THRUST | {"setting": [0, 900, 3001]}}},
    "thrust of a row too few": {"engine": {"thrust": THRUST | {"force_n": [[-9, 7, 80]]}}},
    "thrust that falls": {"engine": {"thrust": THRUST | {"force_n": [[-9, 7, 80], [-30, 5, 4]]}}},
    "thrust of no mass": {"engine": {"thrust": THRUST}, "mass": {"mass_kg": None}, "forces": None},
    "writing": {"trim": {"throttle": "simulation/do_linearization"}},
}
CAN = {
    "a half turn": {"surfaces": {"tab": {"travel_rad": [-3.2, 3.2]}}},
    "a box of one value": box(beta_rad=[1, 1]),
    "inertia": {"mass": {"Ix_kgm2": 4.0, "Iz_kgm2": 9.0, "Jxz_kgm2": -5.99}},
    "defaults at the ends": {
        "engine": {"settings": {
            "n": {"property": "a/b", "default": 1, "range": [1, 2]},
            "m": {"property": "a/b", "default": 2, "range": [1, 2]},
        }},
    },
    "as many as there may be": {"moments": {"Cm": [term(f"Cm_{i}") for i in range(64)]}},
    "a rate and a surface in a force": {"forces": {"CZ": [term(of={"qh": 1}, surface="elevator")]}},
    "signals of a box": {**box(signals={"dpt": [0, 1]}), "signals": {"dpt": {"property": "aero/dpt"}}},
    "thrust at both ends of its setting": {"engine": {"thrust": THRUST}, "effectors": EFFECTORS},
}  # fmt: skip


def test_what_contradictions_are_called(changed):
    found = {}
    for case, given in CANNOT.items():
        with pytest.raises(ValidationError) as caught:
            AircraftFile.model_validate(trainer_file(**given))
        found[case] = sorted(
            [".".join(map(str, (*error["loc"], *at))), says]
            for error in caught.value.errors()
            for at, says in error.get("ctx", {}).get("conflicts", [((), error["type"])])
        )
    assert not changed(found)


@pytest.mark.parametrize("case", CAN)
def test_what_is_just_allowed(case):
    assert trainer(**CAN[case]).n in (3, 4)


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


PLACE = {"travel_rad": [-0.2, 0.3]}
MANY = {
    "surfaces": {"tab": PLACE, "flaperon": PLACE, "fin": PLACE},
    "groups": {"lateral": ["aileron", "rudder", "fin", "flaperon"], "pitch": ["elevator", "tab"]},
    "moments": {
        "Cl": [term("a", surface="aileron"), term("b", surface="flaperon")],
        "Cm": [term("c", surface="elevator"), term("d", surface="tab")],
        "Cn": [term("e", surface="rudder"), term("f", surface="fin")],
    },
    "forces": {
        "CX": [term("g", surface="flaperon")],
        "CY": [
            term("h", surface="rudder"), term("i", surface="fin"),
            term("j", {"betadoth": 1}, surface="aileron"),
        ],
        "CZ": [term("k", surface="elevator"), term("l", surface="tab"), term("m", surface="rudder")],
    },
    "trim": {"together": {"aileron": {"flaperon": -0.5}, "elevator": {"tab": 0.3, "rudder": 0.2}}},
}  # fmt: skip


def test_who_leads_who_stands_in_and_whom_a_force_tells_apart():
    """Two surfaces an axis. A leader goes with no other, and nobody measures the rate of sideslip."""
    many = trainer(**MANY)
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
        one = {axis: of if axis == left else of[:1] for axis, of in MANY["forces"].items()}
        assert trainer(**{**MANY, "forces": one}).forces_separate_surfaces is sees
    other = trainer(**{**MANY, "groups": {"lateral": ["rudder", "fin", "flaperon", "aileron"],
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
