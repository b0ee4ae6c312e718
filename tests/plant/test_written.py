"""What is written into the aircraft, property by property: its start, a scenario's truth, the air, gusts."""

from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop.loop import Cockpit, Loop
from beaver_ftc.plant import channels
from beaver_ftc.plant.adapter import FlightState, Plant, _Errors, bare, body_axes, translated
from beaver_ftc.plant.model_file import copy_of, package
from beaver_ftc.plant.trial import probe
from beaver_ftc.plant.trim import NEVER, GustSchedule, _actuators, configure, take_off, trim_of
from beaver_ftc.scenario.airframe import Gust
from beaver_ftc.scenario.schema import load
from trainer import FOLDER, trainer

BANKED = {
    "alpha_rad": 0.1, "beta_rad": -0.05, "p_rad_s": 0.3, "q_rad_s": -0.2, "r_rad_s": 0.15, "phi_rad": 0.4,
    "theta_rad": -0.1, "psi_rad": 1.1, "aileron_rad": 0.06, "elevator_rad": -0.08, "rudder_rad": 0.07,
    "flap_rad": 0.2, "engine_rpm": 1900.0, "manifold_pressure_inhg": 22.0,
}  # fmt: skip
SEEN = ("velocities/u-fps", "velocities/v-fps", "velocities/w-fps", "velocities/v-north-fps",
        "velocities/h-dot-fps",
        "accelerations/udot-ft_sec2", "accelerations/vdot-ft_sec2", "accelerations/wdot-ft_sec2",
        "accelerations/pdot-rad_sec2", "accelerations/qdot-rad_sec2", "accelerations/rdot-rad_sec2",
        "simulation/sim-time-sec", "position/lat-geod-deg", "aero/dpt")  # fmt: skip


SURFACES = ("aileron", "elevator", "rudder", "flap")


class Noted(Plant):
    """An aircraft that notes what is written: some properties of JSBSim read 0 whatever they are."""

    def __init__(self, *of, **more):
        self.written = {}
        super().__init__(*of, **more)

    def write(self, name, value):
        self.written[name] = value
        super().write(name, value)

    def write_all(self, names, values):
        self.written |= zip(names, values, strict=True)
        super().write_all(names, values)


def written(plant):
    return dict(sorted(plant.written.items()))


def seen(plant):
    return {name: round(plant.read(name), 6) for name in SEEN}


def banked(**more):
    return FlightState(50.0, 1500.0, **{**BANKED, **more})


@pytest.mark.parametrize("wind_mps", [(0, 0, 0), (8, -3, 1)])
def test_a_start_says_everything_of_its_state(wind_mps, changed):
    plant = Noted(rate_hz=50)
    plant.run()
    plant.start(banked(), wind_mps)
    assert not changed({**written(plant), **seen(plant)})


def test_a_hold_changes_what_it_is_given_and_stands_still():
    plant, other = Plant(rate_hz=50), Plant(rate_hz=50)
    plant.start(FlightState(45.0, 1000.0, engine_rpm=1900.0, manifold_pressure_inhg=22.0))
    plant.hold(banked())
    other.start(banked())
    assert seen(plant) == pytest.approx(seen(other), rel=1e-6, abs=1e-6)


def test_a_hold_ends_once_the_aircraft_is_still():
    """At the second run, which changes nothing here: the rates of the flow change no moment of the Beaver."""
    plant, other, runs = Plant(rate_hz=50), Plant(rate_hz=50), []
    for each in (plant, other):
        each.start(FlightState(45.0, 1000.0, engine_rpm=1900.0, manifold_pressure_inhg=22.0))
    plant.run = lambda: runs.append(plant.fdm.run())
    plant.hold(banked(), still_rad_s2=1e-6)
    other.hold(banked())
    assert len(runs) == 2
    assert plant.read_all(SEEN[8:11]) == pytest.approx(other.read_all(SEEN[8:11]), rel=0.0, abs=1e-7)


def test_settling_leaves_the_turbulence_as_it_was():
    plant = Plant(rate_hz=50)
    plant.start(banked())
    plant.write("atmosphere/turb-type", 4.0)
    plant.settle()
    assert plant.read("atmosphere/turb-type") == 4.0
    assert plant.read("simulation/sim-time-sec") == 0.0


def test_body_axes_turn_by_yaw_then_pitch_then_roll():
    axes = body_axes(banked())
    assert axes @ axes.T == pytest.approx(np.eye(3))
    nose, right, down = axes
    assert nose == pytest.approx([np.cos(0.1) * np.cos(1.1), np.cos(0.1) * np.sin(1.1), np.sin(0.1)])
    assert down[2] == pytest.approx(np.cos(0.4) * np.cos(0.1))
    assert right[2] == pytest.approx(np.sin(0.4) * np.cos(0.1))
    yawed = FlightState(45.0, 0.0, psi_rad=pi / 2)
    assert body_axes(yawed) @ [1.0, 2.0, 3.0] == pytest.approx([2.0, -1.0, 3.0])


TRUTH = {
    "uncertainty": {
        "inertia_coupling": {"p": 0.1, "q": -0.2, "r": 0.3},
        "sinusoid": {
            axis: {"amplitude_rad_s2": 0.1 * i, "frequency_rad_s": 5 + i} for i, axis in enumerate("pqr", 1)
        },
        "coefficients": {"Cm_alpha": 1.1, "CX_0": 0.9}, "mass": 1.05,
        "inertia": {"Ix": 1.1, "Iy": 0.9, "Iz": 1.2},
        "cg_m": [0.1, -0.05, 0.02],
    },
    "actuators": {"bandwidth_rad_s": 20, "rate_limit_deg_s": 60, "flap": {"travel_deg": [-5, 40]}},
    "environment": {"turbulence": "dryden", "severity": "severe", "wind_mps": [3, -2, 0.5]},
    "seed": 2**31 + 5, "initial": {"flap_deg": 5},
}  # fmt: skip


def test_a_scenario_s_truth_is_written_and_trimmed_and_takes_off_in_its_air(changed):
    plant, scenario = Noted(rate_hz=50), load(TRUTH)
    configure(plant, scenario)
    assert not changed(written(plant), part="truth")
    point = trim_of(scenario, plant)
    assert not changed(
        {key: value for key, value in point.as_dict().items() if key != "residual"}, part="trim"
    )
    take_off(plant, scenario, point)
    assert not changed({**written(plant), **seen(plant)}, part="air")


@pytest.mark.parametrize(
    ("uncertainty", "says"),
    [
        ({"inertia_coupling": {"q": 0.1}}, "uncertainty.inertia_coupling.q: trainer has no property"),
        ({"coefficients": {"Cm_q": 1.1}}, "uncertainty/Cm_q-scale, allowed: 1"),
        ({"sinusoid": {"r": {"amplitude_rad_s2": 0.1}}}, "uncertainty.sinusoid.r: .*amplitude-rad_sec2, all"),
    ],
)  # fmt: skip
def test_an_error_of_the_truth_that_an_aircraft_cannot_have_is_refused(uncertainty, says):
    class Without(Plant):
        def has(self, name):
            return not name.startswith("uncertainty/") and super().has(name)

    plant = Without(rate_hz=50, aircraft=trainer(start={"altitude_m": 500}))
    neutral = {"coefficients": dict.fromkeys(uncertainty.get("coefficients", ()), 1.0)}
    for given, refused in ((neutral, False), (uncertainty, True)):
        scenario = load({"aircraft": "beaver", "uncertainty": given})
        if refused:
            with pytest.raises(BadInput, match=says):
                configure(plant, scenario)
        else:
            configure(plant, scenario)


def test_gusts_are_set_off_in_their_frames(changed):
    plant = Noted(rate_hz=50)
    gusts = [
        Gust(at_s=0.0, velocity_mps=(3, -4, 12), rise_s=0.5, hold_s=0.25, fade_s=0.75),
        Gust(at_s=2.001, velocity_mps=(0, 0, -2)), Gust(at_s=9.0, velocity_mps=(0, 0, 0)),
    ]  # fmt: skip
    schedule = GustSchedule(gusts, plant, 50)
    assert [schedule.next_change(k) for k in (-1, 0, 100, 101)] == [0, 101, 101, NEVER]
    schedule.apply(1)
    assert written(plant) == {}
    schedule.apply(0)
    assert not changed(written(plant))
    schedule.apply(101)
    assert plant.written["atmosphere/cosine-gust/magnitude-ft_sec"] == pytest.approx(2 / 0.3048)


def test_turbulence_turns_with_the_heading():
    plant = Plant(rate_hz=50)
    plant.start(banked())
    Cockpit(plant, Loop(load({})).frames).turn_air()
    assert plant.read("atmosphere/psiw-rad") == pytest.approx(-1.1, abs=1e-6)


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ([], "no reason given"),
        (["a\n  b", "c "], "a bc"),
        (["x Could not open file: /there/none.xml here"], "it needs the file none.xml, which is not there"),
        (["In file /there/below/model.xml: line 3"], "In file model.xml: line 3"),
        (["r" * 400], "r" * 300),
    ],
)
def test_what_went_wrong_is_one_line_without_paths(said, reason):
    errors = _Errors()
    errors.said += said
    assert errors.reason == reason


def test_a_model_to_look_at_stands_at_a_place_and_what_nothing_gives_is_zero(tmp_path):
    fdm = bare(FOLDER / "trainer.xml", ["fcs/nobody-gives-it"])
    found = [fdm[name] for name in ("position/h-sl-ft", "velocities/vc-kts", "fcs/nobody-gives-it")]
    assert found == pytest.approx([5000.0, 100.0, 0.0], rel=1e-3)
    probe(FOLDER / "trainer.xml")
    model = tmp_path / "none" / "none.xml"
    model.parent.mkdir()
    model.write_text("<fdm_config/>")
    with pytest.raises(SimulationFailed, match=r"^JSBSim cannot load none/none.xml: \S"):
        probe(model)


@pytest.mark.parametrize(("flown", "name"), [("x", "x"), (FOLDER / "trainer.xml", "trainer/trainer.xml")])
def test_what_jsbsim_raises_is_one_line(flown, name):
    import jsbsim

    with pytest.raises(SimulationFailed, match=f"^JSBSim cannot fly {name}: a b$"), translated(flown):
        raise jsbsim.BaseError("a\n b")


@pytest.fixture
def engined(tmp_path):
    """Makes aircraft of the jsbsim package's c172x whose engine is started so."""
    model = copy_of(package() / "aircraft" / "c172x" / "c172x.xml", tmp_path)
    throttle = {"throttle": {"property": "fcs/throttle-cmd-norm", "default": 0.7, "range": [0, 1]}}
    surfaces = {name: {"command": f"fcs/{name}-cmd-norm", "position": f"fcs/{name}-pos-norm",
                       "effective": f"fcs/{name}-pos-norm", "travel_rad": [-0.3, 0.3]}
                for name in ("aileron", "elevator", "rudder")}  # fmt: skip

    def made(start):
        aircraft = trainer(engine={"settings": throttle, "start": start}, surfaces=surfaces)
        return aircraft, Plant(100, aircraft=aircraft, model=model)

    return made


RPM = "propulsion/engine/engine-rpm"


def test_engines_are_run_up_with_the_aircraft_where_it_is(engined):
    aircraft, plant = engined("run_up")
    state = FlightState(50.0, 1000.0, alpha_rad=0.05, theta_rad=0.05, aircraft=aircraft)
    plant.start(state)
    first = plant.read(RPM)
    assert first > 1500
    assert plant.read("simulation/sim-time-sec") == 0.0
    assert plant.read("position/h-sl-ft") * 0.3048 == pytest.approx(1000.0, abs=0.01)
    assert [plant.read(f"fcs/{lever}-cmd-norm[0]") for lever in ("advance", "throttle")] == [1, 0.7]
    runs = []
    plant.run = lambda run=plant.run: runs.append(run())
    plant.start(state)
    assert len(runs) == 5  # they run already: it settles
    plant.start(FlightState(50.0, 1000.0, aircraft=aircraft, throttle=0.2))
    assert len(runs) == 10 + 100 * 10
    assert plant.read(RPM) < 0.9 * first
    for place in ((50.0, 2500.0), (44.0, 2500.0)):  # elsewhere they come to another speed
        runs.clear()
        plant.start(FlightState(*place, aircraft=aircraft, throttle=0.2))
        assert len(runs) == 5 + 100 * 10


@pytest.mark.parametrize(("start", "runs"), [("steady", 10), ("off", 5)])
def test_engines_run_steadily_at_once_or_not_at_all(engined, start, runs):
    aircraft, plant = engined(start)
    counted, told, write = [], [], plant.write
    plant.write = lambda name, value: (told.append((name, value)), write(name, value))
    plant.run = lambda run=plant.run: counted.append(run())
    for throttle in (0.9, 0.3):
        plant.start(FlightState(50.0, 1000.0, aircraft=aircraft, throttle=throttle))
        counted.append(round(plant.read(RPM)))
        assert plant.read("fcs/throttle-cmd-norm") == throttle
    assert [place for place, of in enumerate(counted) if type(of) is int] == [runs, 2 * runs + 1]
    fast, slow = counted[runs], counted[-1]
    assert (fast > 1.2 * slow > 600) == (start == "steady")
    assert told.count(("propulsion/set-running", -1)) == (start == "steady")  # once and for all


@pytest.mark.parametrize(
    ("severity", "exceedence", "wind_fps"), [("light", 3, 25.3), ("moderate", 4, 50.6), ("severe", 6, 76.0)]
)
def test_turbulence_as_the_specification_has_it(severity, exceedence, wind_fps, trim_point):
    plant = Noted(rate_hz=50)
    air = {"turbulence": "dryden", "severity": severity}
    take_off(plant, load({"environment": air, "seed": 2**31 - 2}), trim_point)
    folder = "atmosphere/turbulence/milspec"
    found = [plant.written[f"{folder}/severity"], plant.written[f"{folder}/windspeed_at_20ft_AGL-fps"]]
    assert found == [exceedence, wind_fps]
    assert (plant.written["atmosphere/randomseed"], plant.written["atmosphere/turb-type"]) == (1, 4)


def test_names_and_units_of_what_is_read_and_logged(changed):
    aircraft = trainer(signals={"dpt": {"property": "aero/dpt"}}, surfaces={"tab": {"travel_rad": [0, 1]}})
    assert not changed({
        "truth": channels.truth_channels(aircraft), "further": channels.further_channels(aircraft),
        "further of the beaver": channels.further_channels(load({}).airframe),
        "room": [channels.most_channels(n) for n in (3, 8)],
        "commands": channels.command_properties(aircraft),
        "log": channels.log_columns(aircraft, ("rudder",), 3, "manifold_pressure_inhg", ("h_m",), True),
        "short log": channels.log_columns(aircraft, (), 0, "", (), False),
        "places": [channels.AIRSPEED, channels.ALPHA, channels.BETA, channels.QDYN, channels.PHI,
                   channels.LATITUDE, channels.LONGITUDE, channels.ALTITUDE, channels.PDOT,
                   channels.ENVELOPE, channels.POS],
    })  # fmt: skip


def test_actuators_are_a_scenarios_without_the_delay_that_an_aircraft_was_built_with():
    """Each surface has its own; travel only where the scenario has another."""
    given = {
        "bandwidth_rad_s": 20, "rate_limit_deg_s": 60, "flap": {"travel_deg": [-5, 40], "bandwidth_rad_s": 7},
        "rudder": {"rate_limit_deg_s": 33},
    }  # fmt: skip
    scenario, degree = load({"actuators": given}), pi / 180
    for delayed in (True, False):
        noted = {}
        plant = SimpleNamespace(
            aircraft=scenario.airframe, has=lambda name, delayed=delayed: delayed, write=noted.__setitem__
        )
        _actuators(plant, scenario)
        assert noted == pytest.approx({
            **({"actuators/delay-s": 0.0} if delayed else {}),
            **{f"actuators/{s}/bandwidth-rad_sec": 7.0 if s == "flap" else 20.0 for s in SURFACES},
            **{
                f"actuators/{s}/rate-limit-rad_sec": (33 if s == "rudder" else 60) * degree for s in SURFACES
            },
            "actuators/flap/position-min-rad": -5 * degree, "actuators/flap/position-max-rad": 40 * degree,
        })  # fmt: skip
