"""What `fdi.bounds` declares is asked of one object: who takes part, and that nobody reads the section."""

import ast
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.design import SEVERITIES, Dryden
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.declared import Declared, _inconclusive, _power, undeclared
from beaver_ftc.scenario.diagnosis import Bounds, failing, of_several, pairs_refused
from beaver_ftc.scenario.schema import load
from flying import declared_in, scenario
from test_architecture import PRODUCTS, modules, tree
from trainer import trainer

ALL = {"fault_class": "all", "statistical": {}}
# They make other bounds of those given, and ask nothing of them.
WRITE = {"beaver_ftc:studies.mismatch.bound", "beaver_ftc:scenario.interventions"}
DECLARED = "beaver_ftc:scenario.declared"


def test_nobody_but_declared_reads_the_bounds():
    """`fdi.bounds.turbulence` and its like, anywhere in the core or a product."""
    readers = {
        f"{package}:{name}: {node.attr}"
        for package in ("beaver_ftc", *PRODUCTS)
        for name, file in modules(package).items()
        if f"{package}:{name}" not in WRITE | {DECLARED} and ".bounds." in file.read_text(encoding="utf-8")
        for node in ast.walk(tree(name, package))
        if isinstance(node, ast.Attribute) and node.attr in Bounds.model_fields
        if isinstance(node.value, ast.Attribute) and node.value.attr == "bounds"
    }
    own = {
        "beaver_ftc:scenario.diagnosis: sensors",
        "beaver_ftc:scenario.pairs: sensors",
    }  # where it is refused
    assert readers <= own


@pytest.mark.parametrize(
    ("keys", "used"),
    [
        ({}, True), ({"statistical": None}, False), ({"authority": "worst-case"}, False),
        ({"fault_class": "published"}, False), ({"scheme": "observer-constant"}, False),
    ],
)  # fmt: skip
def test_who_reads_accelerometers(keys, used):
    """The Beaver's elevator and flap both pitch it: their lift separates them."""
    for substeps in (1, 2):
        scenario = load({"name": "x", "substeps": substeps, "fdi": {**ALL, **keys}})
        assert Declared.of(scenario).uses_accelerometers is (used and substeps == 1)


@pytest.mark.parametrize("severity", SEVERITIES)
def test_still_air_is_none_of_the_severities_but_none(severity):
    declared = declared_in(Bounds(turbulence=severity))
    assert declared.air == Dryden(severity)
    assert declared.air.moves is (severity != "none") is not declared.is_noise_free


def test_coefficients_have_one_share_or_each_its_own():
    one, each = (
        declared_in(Bounds(coefficients=c)).coefficients for c in (0.1, {"Cm_alpha": 0.2, "Cn_r": 0.3})
    )
    assert (one.of("Cm_alpha"), one.largest) == (0.1, 0.1)
    assert (each.of("Cm_alpha"), each.of("Cm_q"), each.largest) == (0.2, 0.0, 0.3)
    aircraft = declared_in(Bounds()).aircraft
    values = np.linspace(-2.0, 2.0, len(aircraft.moments) + 3)
    wanted = [0.2 if t.name == "Cm_alpha" else 0.3 if t.name == "Cn_r" else 0.0 for t in aircraft.moments]
    found = each.absolute(aircraft.moments, values)
    assert found == pytest.approx(np.array(wanted) * np.abs(values[: len(aircraft.moments)]))


def test_a_declared_object_cannot_be_changed():
    declared = declared_in(Bounds())
    with pytest.raises(AttributeError):
        declared.inertia = 0.1


def test_errors_of_an_instrument_in_si_and_how_far_a_reading_can_be_off():
    """A vane with noise of 0.5 deg, bias -2 deg, resolution 0.25 deg and a slope that is 20 % too small."""
    of = {"noise_std_deg": 0.5, "bias_deg": -2.0, "quantum_deg": 0.25, "scale_error": -0.2}
    declared = declared_in({"sensors": {"beta": of, "V": {"noise_std_mps": 3.0}}}).sensors
    beta = declared["beta"]
    assert np.degrees([beta.noise, beta.steady, beta.resolution]) == pytest.approx([0.5, 2.0, 0.25])
    assert beta.slope == 0.2
    assert np.degrees(beta.random) == pytest.approx(np.sqrt(0.25 + 0.0625 / 12.0))
    assert np.degrees(beta.worst) == pytest.approx(4.0 * 0.5 + 2.0 + 0.125)
    # what reads 10 deg is at most 10 + e, of which e is 4.125 deg and a fifth of the truth
    assert np.degrees(beta.of_reading(np.radians(10.0))) == pytest.approx((4.125 + 2.0) / 0.8)
    assert declared.each("noise") == pytest.approx([0, 0, 0, 0, np.radians(0.5), 3.0, 0])
    assert declared.each("slope", ["beta", "p"]) == pytest.approx([0.2, 0.0])
    assert (declared.is_ideal, declared_in({}).sensors.is_ideal) == (False, True)
    truth = load({"sensors": {"beta": of, "p": {"bias_deg_s": 0.1}, "V": {"noise_std_mps": 3.1}}}).sensors
    assert declared.exceeded_by(truth) == ["p", "V"]
    assert declared.exceeded_by(load({"sensors": {"beta": {"bias_deg": 1.9}}}).sensors) == []


def test_each_bound_is_declared_as_what_it_is():
    """All of them different; an angle in radians."""
    given = {
        "inertia_coupling": {"p": 0.11, "q": 0.12, "r": 0.13}, "coefficients": 0.05, "inertia": 0.06,
        "constant_rad_s2": {"p": 0.21, "q": 0.22, "r": 0.23}, "deflection_deg": 9.0, "turbulence": "moderate",
        "vertical_wind_mps": 4.0, "sensors": {"q": {"bias_deg_s": 18.0}},
    }  # fmt: skip
    fdi = {"bounds": given, "fault_class": "all", "statistical": {}}
    for substeps, compares in ((1, True), (2, False)):
        declared = Declared.of(load({"fdi": fdi, "substeps": substeps}))
        assert declared.air == Dryden("moderate")
        assert declared.sensors["q"].steady == pytest.approx(np.radians(18.0))
        assert declared.coefficients.share == 0.05
        assert declared.deflection_rad == pytest.approx(np.radians(9.0))
        assert (declared.inertia, declared.vertical_wind_mps) == (0.06, 4.0)
        assert declared.coupling == (0.11, 0.12, 0.13)
        assert declared.constant_rad_s2 == (0.21, 0.22, 0.23)
        assert declared.uses_statistics
        assert (declared.compares_across, declared.monitors_sensors) == (compares, True)
        assert not declared.is_noise_free
    for alone in ({"turbulence": "light"}, {"sensors": {"q": {"bias_deg_s": 1}}}):
        assert not declared_in(alone).is_noise_free
    assert declared_in({}).is_noise_free


@pytest.mark.parametrize(
    ("keys", "forces", "takes", "by_forces", "by_accelerometers"),
    [
        ({}, ("CY",), True, True, False), ({}, ("CY",), False, True, False), ({}, (), True, False, True),
        ({}, (), False, False, False), ({"sensor_monitor": "always"}, (), True, False, False),
        ({"sensor_monitor": "always"}, ("CZ",), True, True, False),
        ({"statistical": None}, ("CZ",), True, False, False), ({"statistical": None}, (), True, False, False),
        ({"bounds": {"turbulence": "none"}}, ("CZ",), True, False, False),
        ({"bounds": {"turbulence": "none"}}, (), True, False, False),
    ],
)  # fmt: skip
def test_who_follows_gusts(keys, forces, takes, by_forces, by_accelerometers):
    """By forces that the design model has; else by accelerometers, of an aircraft whose damage takes
    surfaces and whose instruments nobody doubts."""
    aircraft = SimpleNamespace(measurable_forces=forces, loses_surfaces=takes)
    fdi = {"bounds": {"turbulence": "light"}, "statistical": {}} | keys
    declared = replace(Declared.of(load({"fdi": fdi})), aircraft=aircraft)
    assert declared.follows_gusts_by_forces is by_forces
    assert declared.follows_gusts_by_accelerometers is by_accelerometers


@pytest.mark.parametrize(
    ("given", "changes"),
    [
        ({"scheme": "rls-monitor"}, {"weighs_chance": False, "monitors_sensors": False}),
        ({"statistical": None}, {"weighs_chance": False}),
        ({"fault_class": "published"}, {"looks_across": False, "monitors_sensors": False}),
        ({"fault_class": "published", "sensor_monitor": "always"}, {"looks_across": False}),
        ({"pairs": True}, {"looks_across": False}),
        ({"authority": "worst-case"}, {"looks_across": False}),
        ({"authority": "statistical"}, {}),
        ({"sensor_monitor": "never"}, {"monitors_sensors": False}),
        ({"sensor_monitor": "auto"}, {}),
    ],
)  # fmt: skip
def test_what_a_diagnosis_takes_part_in(given, changes):
    fdi = load({"fdi": {**ALL, **given}}).fdi
    expected = {"weighs_chance": True, "looks_across": True, "monitors_sensors": True} | changes
    assert fdi.weighs_chance is expected["weighs_chance"]
    assert fdi.looks_across is expected["looks_across"]
    assert [fdi.compares_across(substeps) for substeps in (1, 2)] == [expected["looks_across"], False]
    assert fdi.monitors_sensors is expected["monitors_sensors"]
    assert fdi.assumes_sound_sensors is (fdi.diagnoses and not expected["monitors_sensors"])


def test_another_scheme_keeps_what_is_said_but_the_published_one_is_the_papers():
    fdi = load({"fdi": {
        **ALL, "pairs": True, "sensor_monitor": "always", "probing": {}, "authority": "statistical",
        "forgetting_time_s": 7.0, "thresholds": "interval",
    }}).fdi  # fmt: skip
    other = fdi.with_scheme("rls-monitor", {"gain": 2.0})
    assert other == fdi.model_copy(update={"scheme": "rls-monitor", "options": {"gain": 2.0}})
    published = fdi.with_scheme("zhang2005", {})
    said = {"scheme": "zhang2005", "forgetting_time_s": 7.0, "sensor_monitor": "never"}
    assert published == load({"fdi": said}).fdi
    assert (published.is_published, published.is_ours, published.diagnoses) == (True, False, True)
    assert (other.is_published, other.is_ours, other.diagnoses) == (False, False, False)
    assert set(published.sharpen.model_dump().values()) == {False}
    assert published.thresholds == "published"


LOST = {"type": "loss_of_effectiveness", "magnitude": 0.4}
TWO = "faults on several surfaces at once: the diagnosis looks for one"


def of_two(*spans, **keys):
    """A scenario whose faults are (surface, from, to)."""
    faults = [{**LOST, "actuator": surface, "at_s": at_s, "end_s": end_s} for surface, at_s, end_s in spans]
    return load({"faults": faults, "duration_s": 20.0, **keys})


def test_surfaces_fail_when_their_first_fault_comes():
    broken = of_two(("flap", 5, None), ("rudder", 7, 8), ("flap", 3, 4), ("rudder", 9, None))
    assert failing(broken) == {"flap": 3.0, "rudder": 7.0}
    instrument = {"sensor": "p", "type": "freeze", "at_s": 1}
    assert failing(load({"faults": [instrument, {**LOST, "actuator": "flap", "at_s": 2}]})) == {"flap": 2.0}


@pytest.mark.parametrize(
    ("spans", "at_once"),
    [
        ([("flap", 5, None)], False), ([("flap", 5, None), ("flap", 6, None)], False),
        ([("flap", 5, 6), ("rudder", 6, 7)], False), ([("flap", 5, 6.1), ("rudder", 6, 7)], True),
        ([("flap", 5, None), ("rudder", 19.9, None)], True), ([("rudder", 9, 12), ("flap", 5, 9.5)], True),
        ([("rudder", 9, 12), ("flap", 5, 9)], False),
    ],
)  # fmt: skip
def test_surfaces_fail_at_once_where_their_faults_overlap(spans, at_once):
    assert of_several(of_two(*spans)) == (
        f"{TWO}; set fdi: {{fault_class: all, pairs: true}}" if at_once else ""
    )


def test_what_a_diagnosis_makes_of_two_surfaces_at_once():
    both, noise = (("flap", 5, None), ("rudder", 3, None)), {"p": {"noise_std_deg_s": 0.01}}
    which = "fdi.pairs, which looks for two,"
    until = "names the first until the second contradicts it, and then says unanticipated"
    vary = "not available with errors of the gyros that vary declared in fdi.bounds.sensors"
    later = [{"at_s": 4, "law": "lqr"}, {"at_s": 6, "declared_sensors": noise}]
    for keys, says in (
        ({"fdi": {"fault_class": "all"}}, f"{TWO}; set fdi.pairs: true"),
        ({"fdi": {"scheme": "rls-monitor"}},
         f"{TWO}; {which} is of scheme adaptive-estimators alone"),
        ({"fdi": {"bounds": {"sensors": noise}}}, f"{TWO}, {until}; {which} is {vary}"),
        ({"changes": later}, f"{TWO}, {until}; {which} is {vary}"),
    ):  # fmt: skip
        assert of_several(of_two(*both, **keys)) == says
    steady = load({"fdi": {"bounds": {"sensors": {"p": {"bias_deg_s": 1}}}}}).fdi.bounds.sensors
    beaver = declared_in({}).aircraft
    assert pairs_refused(steady, beaver) == ""
    for axes, n in (((0, 1, 2, 1), 5), ((0, 1, 2, 2), 4), ((1, 1, 1, 0), 4)):
        other = SimpleNamespace(dominant_axis=axes, surfaces=range(n), name="kite")
        assert pairs_refused(steady, other) == (
            "not available: kite has not two surfaces in pitch, two in roll and yaw"
        )
    with pytest.raises(BadInput) as refused:
        load({"fdi": {"fault_class": "all", "pairs": True}, "changes": later})
    allowed = "allowed: errors that do not vary, or fdi.pairs: false"
    assert str(refused.value) == f"changes[1].declared_sensors: fdi.pairs is {vary}, {allowed}"


def test_surfaces_that_fail_in_turn_are_warned_of_unless_that_is_expected():
    both = (("flap", 5, None), ("rudder", 3, None))
    says = "faults: on several surfaces at once: the diagnosis looks for one; set fdi.pairs: true"
    ours = {"fdi": {"fault_class": "all"}}
    assert of_two(*both, **ours).warnings() == (says,)
    assert (
        of_two(("flap", 3, None), ("rudder", 3, None), **ours).warnings() == ()
    )  # no name before the second
    for quiet in (
        ours | {"expect": {"isolated_as": "unanticipated"}},
        ours | {"expect": {"isolated_as": ["rudder", "unanticipated"]}},
        {"fdi": {"fault_class": "all", "pairs": True}}, {"fdi": {"scheme": "rls-monitor"}},
    ):  # fmt: skip
        assert of_two(*both, **quiet).warnings() == ()
    assert of_two(*both, **ours, expect={"isolated_as": ["rudder", "flap"]}).warnings() == (says,)


MAP = {
    "travel_share": [0.5, 1.0], "until_s": [120, 900],
    "boxes": [{
        "p_rad_s": [-0.3, 0.2], "q_rad_s": [-0.1, 0.15], "r_rad_s": [-0.25, 0.35], "alpha_rad": [0.02, 0.21],
        "beta_rad": [-0.12, 0.11], "airspeed_mps": [20.0, 31.5], "density_kg_m3": [1.0065, 1.1116],
        **{f"error_{axis}_rad_s2": [[0.01, 0.02], [0.03, 0.04]] for axis in "pqr"},
    }],
}  # fmt: skip


def test_where_a_model_was_not_measured_is_said_of_each_key_that_leads_there():
    """Densities of the standard atmosphere at 2000 and 1000 m."""
    signals = trainer().signals
    boxes = [{**MAP["boxes"][0], "signals": {name: [0.1, 0.4] for name in signals}}]
    aircraft = trainer(model_error_map={**MAP, "boxes": boxes})

    def leg(value):
        return SimpleNamespace(value=value)

    def planned(**keys):
        given = {
            "fdi": SimpleNamespace(scheme="adaptive-estimators", diagnoses=True), "airframe": aircraft,
            "initial": SimpleNamespace(altitude_m=1500.0, airspeed_mps=25.0), "duration_s": 900.0,
            "autopilot": None,
        }  # fmt: skip
        return list(_inconclusive(SimpleNamespace(**given | keys)))

    assert planned() == []
    altitude = "outside the altitudes at which this model was measured: 1,000 to 2,000 m"
    airspeed = "outside the airspeeds at which this model was measured: 20 to 31.5 m/s"
    autopilot = SimpleNamespace(
        altitude_m=[leg(1200.0), leg(None), leg(900.0)], airspeed_mps=[leg(19.0), leg(31.5), leg(31.6)]
    )
    assert planned(
        initial=SimpleNamespace(altitude_m=2100.0, airspeed_mps=32.0), autopilot=autopilot, duration_s=901.0
    ) == [
        f"initial.altitude_m: 2100: nothing can be detected or named {altitude}",
        f"initial.airspeed_mps: 32: nothing can be detected or named {airspeed}",
        f"autopilot.altitude_m[2].value: 900: nothing can be detected or named {altitude}",
        f"autopilot.airspeed_mps[0].value: 19: nothing can be detected or named {airspeed}",
        f"autopilot.airspeed_mps[2].value: 31.6: nothing can be detected or named {airspeed}",
        "duration_s: 901: nothing can be detected or named "
        "later than this model was measured: after 900 s of flight",
    ]  # fmt: skip
    other = SimpleNamespace(scheme="rls-monitor", diagnoses=False)
    assert planned(duration_s=901.0, fdi=other) == []


@pytest.mark.parametrize(("rad_s2", "rad_s", "faster"), [(0.0, 20.0, 0), (1e-3, 20.0, 1), (1e-3, 15.0, 0)])
def test_a_sinusoid_is_faster_than_the_statistics_admit_only_if_there_is_one(rad_s2, rad_s, faster):
    sinusoid = {"p": {"amplitude_rad_s2": rad_s2, "frequency_rad_s": rad_s}}
    beyond = undeclared(scenario(uncertainty={"sinusoid": sinusoid}, fdi={"statistical": {}}))
    assert [fact.key for fact in beyond] == ["uncertainty.sinusoid.p"] * faster


@pytest.mark.parametrize(
    ("default", "legs", "thrust", "warns"),
    [(9.9, [1], True, True), (9.84, [1], True, False), (9.9, [], True, False), (9.9, [1], False, False)],
)
def test_an_altitude_is_wanted_of_an_aircraft_that_flies_level_at_full_power(default, legs, thrust, warns):
    """Of a lever from 2 to 10 full power is what lies above 9.84."""
    settings = {"idle": None, "lever": SimpleNamespace(default=default, range=(2.0, 10.0))}
    aircraft = SimpleNamespace(
        name="kite", power_setting="lever", usual_airspeed_mps=31.0,
        engine=SimpleNamespace(thrust=object() if thrust else None, settings=settings),
        file=SimpleNamespace(start=SimpleNamespace(altitude_m=700.0)),
    )  # fmt: skip
    scenario = SimpleNamespace(airframe=aircraft, autopilot=SimpleNamespace(altitude_m=legs))
    says = (
        "autopilot.altitude_m: kite takes all the power it has at 31 m/s and 700 m: it sinks where that is "
        "not enough, and keeps its airspeed"
    )
    assert list(_power(scenario)) == ([says] if warns else [])
    assert list(_power(SimpleNamespace(airframe=aircraft, autopilot=None))) == []
