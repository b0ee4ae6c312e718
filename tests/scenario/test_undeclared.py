"""What the truth does and the diagnosis was not told is said, one line each."""

from pathlib import Path

import pytest

from beaver_ftc.documents.document import Document
from beaver_ftc.loop.loop import Loop, fly
from beaver_ftc.scenario.declared import Kind, Reader, Undeclared, declares_all, undeclared
from beaver_ftc.scenario.schema import Scenario, load_text, validate_scenario

TOLD = """
fdi: {bounds: {sensors: tactical-grade, turbulence: light, coefficients: {Cm_alpha: 0.05}, inertia: 0.05}}
"""


def warnings(text):
    return load_text(f"name: x\n{text}").warnings()


@pytest.mark.parametrize(
    ("truth", "says"),
    [
        ("sensors: {q: {noise_std_deg_s: 0.1}}", "sensors.q: "),
        ("sensors: {alpha: {delay_s: 0.01}}", "sensors.alpha: "),
        ("sensors: {az: {bias_mps2: 0.05}}", "sensors.az: "),
        ("environment: {turbulence: dryden, severity: moderate}", "environment.severity: moderate"),
        ("uncertainty: {coefficients: {Cm_alpha: 1.06}}", "uncertainty.coefficients.Cm_alpha: 1.06"),
        ("uncertainty: {coefficients: {Cm_q: 1.01}}", "uncertainty.coefficients.Cm_q: 1.01"),
        ("uncertainty: {inertia: {Iy: 0.9}}", "uncertainty.inertia.Iy: 0.9"),
        ("uncertainty: {cg_m: [0.01, 0, 0]}", "uncertainty.cg_m: "),
    ],
)
def test_an_error_beyond_the_declared_is_said(truth, says):
    (line,) = warnings(f"{TOLD}{truth}\n")
    assert line.startswith(says)


@pytest.mark.parametrize(
    "truth",
    [
        "sensors: tactical-grade",
        "environment: {turbulence: dryden, severity: light}",
        "uncertainty: {coefficients: {Cm_alpha: 0.95, CX_0: 1.3}, inertia: {Ix: 1.05}, mass: 1.1}",
        "actuators: servo",
    ],
)
def test_an_error_within_the_declared_is_not(truth):
    assert warnings(f"{TOLD}{truth}\n") == ()


WEIGHED = """
fdi: {fault_class: all, statistical: {}, bounds: {coefficients: 0.05}}
"""


@pytest.mark.parametrize(
    ("truth", "says"),
    [
        ("coefficients: {CZ_alpha: 1.06}", "uncertainty.coefficients.CZ_alpha: 1.06 is beyond"),
        ("coefficients: {CY_beta: 0.9, CX_0: 1.3}", "uncertainty.coefficients.CY_beta: 0.9 is beyond"),
        ("mass: 1.06", "uncertainty.mass: 1.06 is off the designer's"),
    ],
)
def test_where_accelerometers_are_read_forces_and_mass_count(truth, says):
    (line,) = warnings(f"{WEIGHED}uncertainty: {{{truth}}}\n")
    assert line.startswith(says)
    assert warnings(f"{WEIGHED}uncertainty: {{{truth}}}\nsubsteps: 2\n") == ()


def test_a_mass_the_designer_knows_is_no_error():
    assert warnings(f"{WEIGHED}uncertainty: {{mass: 1.2}}\ndesign_model: {{mass: 1.2}}\n") == ()


@pytest.mark.parametrize(
    "key", ["fault_class: published", "authority: worst-case", "pairs: true", "scheme: multiple-models"]
)
def test_where_they_are_not_read_only_moments_do(key):
    given = (
        WEIGHED.replace("fault_class: all", key) if "class" in key else WEIGHED.replace("all", f"all, {key}")
    )
    assert warnings(f"{given}uncertainty: {{coefficients: {{CZ_alpha: 1.2}}, mass: 1.2}}\n") == ()


SINUSOID = {"q": {"amplitude_rad_s2": 0.03, "frequency_rad_s": 20}}
GUST = {"at_s": 1, "velocity_mps": [0, 0, 5]}


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        (
            {"uncertainty": {"inertia_coupling": {"p": -0.3}}},
            ["uncertainty.inertia_coupling.p: -0.3 is beyond"],
        ),
        ({"uncertainty": {"sinusoid": SINUSOID}}, ["uncertainty.sinusoid.q: 0.03 rad/s2 is beyond"]),
        (
            {"uncertainty": {"sinusoid": SINUSOID}, "fdi": {"statistical": {}}},
            ["uncertainty.sinusoid.q: 0.03 rad/s2 is", "uncertainty.sinusoid.q: 20 rad/s is faster than"],
        ),
        ({"environment": {"gust": GUST}}, ["environment.gust: what a gust does"]),
        (
            {"environment": {"gust": GUST}, "fdi": {"statistical": {}, "bounds": {"turbulence": "light"}}},
            ["environment.gust: what a gust does", "environment.gust: JSBSim's does not rotate"],
        ),
        (
            {
                "environment": {"turbulence": "dryden", "severity": "light"},
                "initial": {"altitude_m": 500},
                "fdi": {"bounds": {"turbulence": "light"}},
            },
            [],
        ),
        (
            {"environment": {"wind_mps": [3, -2, 1.5]}, "fdi": {"sensor_monitor": "always"}},
            ["environment: vertical wind of 1.5 m/s is more than fdi.bounds.vertical_wind_mps, 1:"],
        ),
        (
            {
                "environment": {"wind_mps": [3, -2, -1.5]},
                "fdi": {"sensor_monitor": "always", "bounds": {"vertical_wind_mps": 1.6}},
            },
            [],
        ),
        (
            {
                "environment": {"wind_mps": [0, 0, 0.7], "gust": {**GUST, "velocity_mps": [1, 2, 0.4]}},
                "fdi": {"sensor_monitor": "always"},
            },
            ["environment.gust: what a gust does", "environment: vertical wind of 1.1 m/s is more than"],
        ),
    ],
)
def test_all_that_is_undeclared_is_said_where_there_is_a_diagnosis(keys, says):
    said = Scenario.model_validate({"name": "x", **keys}).warnings()
    assert [line[: len(start)] for line, start in zip(said, says, strict=True)] == says
    silent = {**keys, "fdi": {**keys.get("fdi", {}), "scheme": "none"}}
    assert Scenario.model_validate({"name": "x", **silent}).warnings() == ()


def test_a_sharp_gust_is_taken_for_one_that_rotates_where_turbulence_is_declared():
    def alarm(turbulence):
        gust = {"at_s": 0.5, "velocity_mps": [0, 6, 0], "rise_s": 0.2}
        fdi = {"statistical": {}, "bounds": {"turbulence": turbulence}}
        given = {"name": "x", "duration_s": 1, "environment": {"gust": gust}, "fdi": fdi}
        return fly(Scenario.model_validate(given)).detection_time_s

    assert alarm("light") is not None
    assert alarm("none") is None


ALL = {"fault_class": "all", "statistical": {}}
TRAINER = {"name": "x", "aircraft": "./trainer", "fdi": ALL}
FOLDER = Path(__file__).parents[1] / "data" / "aircraft"


def of_trainer(**keys):
    """A flight of an aircraft whose forces separate no surfaces: accelerometers have no part in it."""
    return validate_scenario(Document({**TRAINER, **keys}), folder=FOLDER)


def test_where_forces_separate_no_surfaces_no_error_of_them_counts():
    assert not Loop(of_trainer()).frames["fdi"]["statistical"]["forces"]["in_use"].any()
    heavy = of_trainer(uncertainty={"mass": 1.06, "coefficients": {"CZ_alpha": 1.2}})
    assert list(undeclared(heavy)) == []
    assert heavy.warnings() == ()


def test_a_mass_that_nothing_reads_takes_no_guarantee_away():
    """The designer has the right inertia and another mass, which only accelerometers would show."""
    kept = {"mass": 0.9, "inertia": dict.fromkeys(("Ix", "Iy", "Iz", "Jxz"), 1 / 0.9)}
    fault = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.9, "at_s": 1.0}
    given = {
        "duration_s": 4.0, "faults": [fault], "initial": {"airspeed_mps": 30},
        "reference": {"q": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.5}}]},
    }  # fmt: skip
    light, right = fly(of_trainer(**given, design_model=kept)), fly(of_trainer(**given))
    assert right.guaranteed_delay_s is not None
    assert light.guaranteed_delay_s == pytest.approx(right.guaranteed_delay_s)
    assert light.detection_time_s == pytest.approx(right.detection_time_s)


def test_flights_that_share_their_sections_are_told_apart_by_their_class():
    """A vertical wind is beyond what is declared only where sensors are in doubt: then the sensor monitor
    reads the altimeter. The answer to the first flight is kept for the third, not for the second."""
    sound = Scenario.model_validate({"name": "x", "environment": {"wind_mps": [0, 0, 2.0]}})
    doubted = sound.with_({"fdi.fault_class": "all"})
    assert doubted.environment is sound.environment
    assert [declares_all(each) for each in (sound, doubted, sound)] == [True, False, True]
    other = sound.with_({"uncertainty.mass": 1.2, "fdi": {"bounds": {}, **ALL}})
    assert not declares_all(other)


def test_a_fact_says_what_by_how_much_and_who_reads_it():
    scenario = Scenario.model_validate({"name": "x", "uncertainty": {"mass": 1.2}, "fdi": ALL})
    (fact,) = undeclared(scenario)
    assert (fact.key, fact.value, fact.read_by) == ("uncertainty.mass", 1.2, Reader.ACCELEROMETERS)
    assert fact.excess == pytest.approx(0.15)
    assert (str(fact),) == scenario.warnings()


@pytest.mark.parametrize("kind", Kind)
def test_every_kind_of_fact_has_a_sentence(kind):
    fact = Undeclared(kind, "a.key", "a.bound", names=("one", "two"), cure="cure it")
    assert str(fact).startswith("a.key")
    assert "{" not in str(fact)
