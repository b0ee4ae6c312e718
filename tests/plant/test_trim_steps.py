"""The steps of trim one by one, what is said where there is none, and the truth's slopes about it."""

import sys
from dataclasses import replace
from math import asin, cos, inf, nan, sin
from types import SimpleNamespace

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.aircraft import Travel, load
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plant import trim as steps
from beaver_ftc.plant.adapter import FlightState, Plant
from beaver_ftc.plant.conditions import trimmed
from beaver_ftc.plant.linear import LinearModel, differences, engine_slope, own
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.schema import load as load_scenario
from trainer import trainer


def said(call, *arguments, error=BadInput):
    with pytest.raises(error) as caught:
        call(*arguments)
    return str(caught.value)


@pytest.mark.parametrize(
    ("step", "taken"),
    [([0.1, -0.2], [0.1, -0.2]), ([0.1, -0.4], [0.05, -0.2]), ([0.0, 0.0], [0.0, 0.0]), ([2.0], [0.2])],
)
def test_a_long_step_is_shortened_in_its_direction(step, taken):
    assert steps._shortened(np.array(step)) == pytest.approx(taken)


def test_a_newton_step_solves_or_fits_or_is_none():
    J = np.array([[2.0, 1.0], [0.0, 4.0]])
    assert steps._newton_step(J, np.array([4.0, 8.0])) == pytest.approx([-1.0, -2.0])
    tall = np.array([[1.0], [1.0]])
    assert steps._newton_step(tall, np.array([1.0, 3.0])) == pytest.approx([-2.0])
    for J_wrong, here in ((J * nan, [1.0, 1.0]), (J, [inf, 1.0])):
        assert np.isnan(steps._newton_step(J_wrong, np.array(here))).tolist() == [True, True]


@pytest.mark.parametrize(("given", "is_allowed"), [(1.0, True), (2.0, True), (0.99, False), (2.01, False)])
def test_a_range_includes_its_ends(given, is_allowed):
    if is_allowed:
        assert steps._check("x", given, (1.0, 2.0), "m") is None
    else:
        assert said(steps._check, "x", given, (1.0, 2.0), "m") == f"x is {given:g} m, allowed: 1 to 2 m"


@pytest.mark.parametrize(
    ("left", "says"),
    [
        ([1, -5, 0, 2, 2, 2], " (-5 m/s2 to the right cannot be balanced)"),
        ([1, 0, 2.54, 0, 0, 0], " (2.5 m/s2 downward cannot be balanced)"),
        ([0, 0, 0, -0.5, 0, 0], " (-0.5 rad/s2 in roll cannot be balanced)"),
        ([3, 0, 0, 0, 0, 0], " (3 m/s2 forward cannot be balanced)"),
        ([0, 0, 0, 0, 1, 0], " (1 rad/s2 in pitch cannot be balanced)"),
        ([0, 0, 0, 0, 0, 1], " (1 rad/s2 in yaw cannot be balanced)"),
        ([0, 0, 0, nan, 0, 1], " (its accelerations are not finite)"),
    ],
)
def test_what_keeps_it_from_flying_steadily_is_the_largest(left, says):
    assert steps._left_over(np.array(left, float)) == says


TRAVEL = dict.fromkeys(load().surfaces, Travel(-0.5, 0.25))


@pytest.mark.parametrize(
    ("state", "says"),
    [
        ({"elevator_rad": 0.25, "rudder_rad": -0.5, "alpha_rad": 0.6}, None),
        ({"elevator_rad": 0.26}, "trim at 40 m/s and 900 m needs elevator 14.9 deg, allowed: -28.6 to 14.3 "),
        ({"rudder_rad": -0.51}, "trim at 40 m/s and 900 m needs rudder -29.2 deg, allowed"),
        ({"rudder_rad": -1.6}, "trim at 40 m/s and 900 m needs rudder -91.7 deg, allowed"),
        ({"rudder_rad": -1.61}, "no steady straight flight at 40 m/s, 900 m with this engine and surface "
                               "setting (no rudder within its travel, -28.6 to 14.3 deg, balances it), "),
        ({"alpha_rad": 0.61}, "angle of attack in trim is 0.61 rad, allowed: -0.6 to 0.6 rad"),
    ],
)  # fmt: skip
def test_a_trim_that_nobody_could_fly_is_refused(state, says):
    solution = FlightState(40.0, 900.0, **state)
    if says is None:
        assert steps._check_solution(solution, TRAVEL, load()) is None
    else:
        assert said(steps._check_solution, solution, TRAVEL, load()).startswith(says)


def test_the_climb_angle_is_that_of_the_velocity():
    state = FlightState(40.0, 900.0, alpha_rad=0.1, beta_rad=0.2, theta_rad=0.3)
    assert steps._climb_angle(state) == pytest.approx(asin(cos(0.2) * sin(0.3 - 0.1)))


def test_a_first_guess_carries_the_weight_with_no_pitching_moment():
    truth = Plant(rate_hz=100)
    aircraft, wanted = truth.aircraft, FlightState(45.0, 1000.0)
    guess = steps._first_guess(wanted, truth)
    of = {"alpha": guess.alpha_rad, "dpt": truth.read("aero/dpt"), **guess.surfaces_rad}
    of |= dict.fromkeys(("beta", "ph", "qh", "rh", "betadoth"), 0.0)
    assert aircraft.coefficient("Cm", of) == pytest.approx(0.0, abs=1e-12)
    assert guess.theta_rad == guess.alpha_rad
    linear = {name: 0.0 for name, term in aircraft.terms.items() if dict(term.of).get("alpha", 0) > 1}
    lift = -aircraft.coefficient("CZ", of | {"elevator": 0.0}, linear)
    weight = 2288.231 * truth.read("accelerations/gravity-ft_sec2") * 0.3048
    assert lift * truth.read("aero/qbar-psf") * 47.880259 * 23.23 == pytest.approx(weight, rel=1e-6)
    assert steps._first_guess(FlightState(5.0, 1000.0), truth).alpha_rad == 0.6
    light = trainer(forces={"CZ": [{"name": "CZ_0", "value": -90.0, "of": {}},
                                   {"name": "CZ_alpha", "value": -4.7, "of": {"alpha": 1}}]})  # fmt: skip
    assert (
        steps._first_guess(FlightState(50.0, 1000.0, aircraft=light), Plant(100, aircraft=light)).alpha_rad
        == -0.6
    )
    beyond = trainer(forces={"CZ": [{"name": "CZ_0", "value": 1e308, "of": {}},
                                    {"name": "CZ_alpha", "value": -4.7, "of": {"alpha": 1}}]})  # fmt: skip
    assert (  # beside such a number no slope is left
        steps._first_guess(FlightState(50.0, 1000.0, aircraft=beyond), Plant(100, aircraft=beyond)).alpha_rad
        == 0.05
    )
    bare = trainer(forces=None)
    assert (
        steps._first_guess(FlightState(50.0, 1000.0, aircraft=bare), Plant(100, aircraft=bare)).alpha_rad
        == 0.05
    )


def test_an_elevator_that_cannot_is_guessed_at_its_stop():
    for value, stop in ((0.9, 0.35), (-0.9, -0.45)):
        per_rad = {"name": "Cm_elevator", "value": -1.15, "of": {}, "surface": "elevator"}
        aircraft = trainer(moments={"Cm": [{"name": "Cm_0", "value": value, "of": {}}, per_rad]})
        guess = steps._first_guess(
            FlightState(50.0, 1000.0, aircraft=aircraft), Plant(100, aircraft=aircraft)
        )
        assert guess.elevator_rad == stop


def test_an_aircraft_that_no_surface_turns_in_pitch_is_refused_before_a_trim_is_searched():
    aircraft = trainer(moments={"Cm": [{"name": "Cm_0", "value": 0.1, "of": {}}]})
    with pytest.raises(BadInput, match="no surface turns it in pitch, allowed: in `moments`"):
        trim(50.0, 1000.0, plant=Plant(100, aircraft=aircraft))


def test_a_quick_look_is_the_full_start_s_accelerations():
    truth = Plant(rate_hz=100)
    point = trim(45.0, 1000.0, plant=truth)
    names = ("alpha_rad", "beta_rad", "theta_rad", "aileron_rad", "elevator_rad", "rudder_rad")
    look = steps._looking(truth, point)
    off = np.array([0.01, 0.02, -0.03, 0.04, -0.05, 0.06])
    x = np.array([getattr(point, name) for name in names]) + off
    for _ in range(3):  # the side force of betadot lags a look
        quick = look(x)
    truth.start(replace(point, **dict(zip(names, x.tolist(), strict=True))))
    assert quick == pytest.approx([truth.read(n) * factor for n, factor in steps.ACCELERATIONS], abs=1e-5)
    assert len(steps.ACCELERATIONS) == 6


def test_slopes_are_those_of_each_unknown():
    A = np.array([[1.0, -2.0], [0.5, 3.0], [-1.0, 0.25]])
    x = np.array([0.3, -0.2])
    assert steps._jacobian(lambda x: A @ x, x, A @ x) == pytest.approx(A, rel=1e-6)


def test_trims_and_slopes(changed):
    """With what a scenario says is wrong of the truth."""
    plant, point = trimmed(load_scenario({"uncertainty": {"mass": 1.1}, "initial": {"flap_deg": 10}}))
    assert isinstance(point, TrimPoint)
    model = differences(plant, point)
    assert not changed({
        "A": np.round(model.A, 6).tolist(), "B": np.round(model.B, 6).tolist(),
        "names": [*model.states, *model.inputs], "engine": np.round(engine_slope(plant, point), 6).tolist(),
        "point": {name: round(value, 8) for name, value in point.as_dict().items() if name != "residual"},
    })  # fmt: skip
    pitch = model.of(("q", "alpha"))
    at = [model.states.index(name) for name in ("q", "alpha")]
    assert pitch.A.tolist() == [[model.A[i, j] for j in at] for i in at]
    assert pitch.B.tolist() == model.B[at].tolist()
    assert (pitch.states, pitch.inputs) == (("q", "alpha"), model.inputs)


def test_slopes_by_jsbsim_itself_are_those_by_differences():
    scenario = load_scenario({})
    plant, point = trimmed(scenario)
    level = replace(point, beta_rad=0.0)
    theirs = own(scenario, level)
    ours = differences(plant, level)
    states = ("airspeed", "alpha", "p", "q", "r", "phi", "theta", "psi", "altitude")
    found, expected = theirs.of(states), ours.of(states)
    np.testing.assert_allclose(found.A, expected.A, atol=2e-2)
    np.testing.assert_allclose(found.B, expected.B[:, :3], atol=2e-2)
    assert theirs.states[-3:] != ours.states[-3:]
    over_ground = theirs.of(
        ("north", "east", "airspeed", "psi")
    ).A  # it flies to the north, level but for a bit
    V = cos(level.gamma_rad) * level.airspeed_mps
    assert over_ground[0, 2] * level.airspeed_mps == pytest.approx(V, rel=5e-3)
    assert over_ground[1, 3] == pytest.approx(V, rel=5e-3)
    assert (over_ground[0, 3], over_ground[1, 2]) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert found.inputs == ("aileron", "elevator", "rudder")
    assert (
        said(own, scenario, point, error=SimulationFailed)
        == "JSBSim linearises rightly only with no sideslip"
    )


def test_a_linear_model_as_python_control_is_given_it(monkeypatch):
    model = LinearModel(np.diag([1.0, 2.0]), np.array([[3.0], [4.0]]), ("alpha", "airspeed"), ("flap",))
    given = []
    monkeypatch.setitem(
        sys.modules, "control", SimpleNamespace(ss=lambda *of, **names: given.append((of, names)))
    )
    model.state_space()
    ((matrices, names),) = given
    assert [of.tolist() for of in matrices] == [[[1, 0], [0, 2]], [[3], [4]], [[1, 0], [0, 1]], [[0], [0]]]
    states = ["alpha_rad", "airspeed_mps"]
    assert names == {"states": states, "inputs": ["flap_rad"], "outputs": states}
    monkeypatch.setitem(sys.modules, "control", None)  # as where it is not installed
    assert said(model.state_space).startswith("python-control is not installed, allowed: pip install")


@pytest.mark.parametrize("given", [{"flap": 0.1}, {"wing_rad": 0.1}, {"engine": 3}, {"_rad": 1}])
def test_what_a_flight_condition_does_not_have(given):
    with pytest.raises(TypeError, match=r"a flight condition has no"):
        FlightState(45.0, 1000.0, **given)


def test_a_flight_condition_by_names():
    state = FlightState(45.0, 1000.0, flap_rad=0.1, engine_rpm=1700.0, q_rad_s=0.2)
    found = state.as_dict()
    assert list(found)[:4] == ["airspeed_mps", "altitude_m", "alpha_rad", "beta_rad"]
    assert [found[name] for name in ("flap_rad", "engine_rpm", "q_rad_s", "psi_rad")] == [
        0.1,
        1700.0,
        0.2,
        0.0,
    ]
    assert (state.flap_rad, state.engine_rpm) == (0.1, 1700.0)
    for name in ("wing_rad", "rpm"):
        with pytest.raises(AttributeError, match=name):
            getattr(state, name)
    made = TrimPoint.of(state, gamma_rad=0.3)
    assert (made.flap_rad, made.gamma_rad, made.q_rad_s, made.envelope_valid) == (0.1, 0.3, 0.2, True)


def test_a_trim_from_python_names_what_is_wrong():
    assert bf.trim(flap_deg=10.0).flap_rad == pytest.approx(np.radians(10.0))
    assert said(lambda: bf.trim(flaps_deg=1.0)).startswith(
        "initial.flaps_deg: unknown key, did you mean flap_deg?"
    )


def test_an_engine_s_setting_or_limit_without_words_goes_by_its_name():
    of = {"property": "propulsion/thrust-n", "range": [0, 3000]}
    for section, default in (("settings", 4000.0), ("limits", 2000.0)):
        named = {"settings": {"thrust_n": {**of, "default": 2000.0}}, "limits": {}}
        named[section] = {"push": {**of, "range": [0, 1000 if section == "limits" else 3000], "unit": "N"}}
        if section == "settings":
            named[section]["push"]["default"] = 3000.0
        aircraft = trainer(engine=named)
        plant = Plant(100, aircraft=aircraft)
        given = {"push": default} if section == "settings" else {}
        most = 3000 if section == "settings" else 1000
        assert said(lambda plant=plant, given=given: trim(50.0, 500.0, plant, **given)) == (
            f"push is {default:g} N, allowed: 0 to {most} N"
        )
