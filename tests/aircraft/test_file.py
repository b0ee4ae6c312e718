"""An aircraft's file: its contract, what it must not say, and what follows from it."""

from math import isnan, radians
from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from beaver_ftc.aircraft import Aircraft, load
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
TAB = {"tab": {"travel_rad": [-0.1, 0.2]}}
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


# A tab that does nothing; one that pitches more than the elevator; a rudder above the wing, that rolls more
# than it yaws; ailerons that hardly roll.
BUILDS = {
    "trainer": {},
    "tab of nothing": {"surfaces": TAB},
    "strong tab": {"surfaces": TAB,
                   "moments": {"Cm": [term("a", surface="elevator"), term("b", surface="tab")]},
                   "groups": {"pitch": ["tab", "elevator"]}},
    "high rudder": {"moments": {"Cn": [term("a", surface="rudder"), term("b", {"beta": 1})],
                                "Cl": [term("c", surface="rudder"), term("d", surface="aileron")]}},
    "elevator that yaws more than the rudder": {"moments": {
        "Cl": [term("c", surface="rudder", value=8.0), term("d", surface="aileron")],
        "Cm": [term("e", surface="elevator", value=9.0)],
        "Cn": [term("a", surface="rudder"), term("f", surface="elevator", value=1.5), term("b", {"beta": 1})],
    }},
    "rudder of alpha": {**box(alpha_rad=[0.1, 0.3]), "moments": {
        "Cl": [term("a", {"alpha": 2}, surface="aileron"), term("b", {"alpha": 1}, surface="rudder")],
        "Cn": [term("c", {"alpha": 1}, surface="aileron"), term("d", surface="rudder")],
    }},
    "signals": {**box(signals={"dpt": [0.2, 0.6]}), "signals": {"dpt": {"property": "aero/dpt"}},
                "start": {"airspeed_mps": 44.0}, "model_error_rad_s2": {"p": 1, "q": 2, "r": 3}},
    "no forces": {"forces": None, "mass": {"mass_kg": None}},
    "sideslip's rate": {"forces": {"CY": [term("CY_betadot", {"betadoth": 1}), term("CY_p", {"ph": 1})]}},
}  # fmt: skip


def told(aircraft):
    """What follows from a file."""
    terms = {
        kind: [[term.name, *term.factors] for term in getattr(aircraft, kind)]
        for kind in ("moments", "forces", "measurable_forces")
    }
    return terms | {
        "surfaces": aircraft.surfaces, "axes": aircraft.dominant_axis, "primary": aircraft.primary,
        "groups": dict(aircraft.groups), "signals": aircraft.signal_names,
        "usual": dict(aircraft.usual_signals),
        "travel": {name: (of.min_rad, of.max_rad) for name, of in aircraft.travel.items()},
        "mass": vars(aircraft.mass), "usual_airspeed_mps": aircraft.usual_airspeed_mps,
        "model_error_rad_s2": aircraft.model_error_rad_s2,
        "engine instruments": aircraft.has_engine_instruments,
        "named": list(aircraft.terms),
    }  # fmt: skip


@pytest.mark.parametrize("build", [*BUILDS, "beaver"])
def test_what_follows_from_a_file(build, changed):
    assert not changed(told(load() if build == "beaver" else trainer(**BUILDS[build])))


def test_where_a_term_stands_and_what_a_coefficient_is():
    aircraft = trainer()
    assert [aircraft.index(name) for name in ("Cl_constant", "Cl_beta", "Cm_0", "Cn_rudder")] == [0, 1, 7, 19]
    of = {"alpha": 0.2, "beta": 0.1, "qh": 0.01, "elevator": -0.3}
    expected = 0.045 - 0.72 * 0.2 - 11.5 * 0.01 - 0.35 * 0.1**2 - 1.15 * -0.3 + 0.9 * 0.2 * -0.3
    assert aircraft.coefficient("Cm", of) == pytest.approx(expected)
    scaled = aircraft.coefficient("Cm", of, {"Cm_q": 3.0, "Cm_0": 0.0})
    assert scaled == pytest.approx(expected - 0.045 - 2 * 11.5 * 0.01)
    assert aircraft.alpha_rad == (radians(-4), radians(14))
    assert isnan(trainer(mass={"mass_kg": None}).mass.mass_kg)


def test_ends_of_a_box_in_their_order():
    names = ("p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad", "airspeed_mps", "density_kg_m3")
    spans = {name: (i, i + 0.5) for i, name in enumerate(names)}
    signals = {"a": (7, 8), "b": (8, 9)}
    given = trainer_file(
        **box(**spans, signals=signals), signals={name: {"property": "a/b"} for name in signals}
    )
    made = AircraftFile.model_validate(given).model_error_map.boxes[0]
    assert made.ends(["b", "a"]) == [*spans.values(), (8, 9), (7, 8)]


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


def test_level_flight_is_in_the_innermost_box_and_engines_are_known_if_they_are_in_all():
    boxes = [box(alpha_rad=[0.1, 0.3])["model_error_map"]["boxes"][0], box()["model_error_map"]["boxes"][0]]
    for known in ((None, None), (0.1, None), (None, 0.2), (0.1, 0.2)):
        both = [of | ({} if e is None else {"engines_apart": e}) for of, e in zip(boxes, known, strict=True)]
        aircraft = trainer(model_error_map=box()["model_error_map"] | {"boxes": both})
        assert aircraft.usual_signals["alpha"] == pytest.approx(0.2)
        assert aircraft.file.model_error_map.knows_engines is (None not in known)


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
