"""The closed loop: one suite over every built-in scenario, and what must not depend on how it is run."""

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.loop import loop
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant.channels import TRUTH
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.verdict import verdict_lines
from beaver_ftc.scenario.builtin import builtin_names
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.schema import load_scenario
from flying import Memory, flown, loss, scenario

TRAVEL_RAD = {
    "aileron": (-0.52, 0.52),
    "elevator": (-0.49, 0.49),
    "rudder": (-0.44, 0.44),
    "flap": (-0.1, 1.03),
}
BUILT_IN = builtin_names()


def yielded(flight):
    """Everything a flight yields but its scenario, comparable."""
    return {k: v for k, v in vars(flight).items() if k != "scenario"}


@pytest.fixture(scope="module", params=BUILT_IN)
def built_in(request):
    memory = Memory()
    return fly(load_scenario(request.param), memory), memory


def require_promises(flight):
    """A scenario made to show a false alarm flies outside what is declared, where nothing is promised."""
    if flight.scenario.expect.no_false_alarm is False:
        pytest.skip("shows what an undeclared mismatch does")


class TestEveryBuiltInScenario:
    def test_every_number_is_finite_once_its_estimator_runs(self, built_in):
        flight, log = built_in
        flown = [  # the others: of a channel without a profile, of instruments that all give readings
            i for i, c in enumerate(log.columns) if "_command_" not in c and c != "watch_missing"
        ]
        always = [i for i in flown if not log.columns[i].startswith("fie_")]
        assert np.isfinite(log.rows[:, always]).all()
        if flight.detection_time_s is not None and not any(map(of_a_sensor, flight.scenario.faults)):
            # the alarm of an instrument starts no estimator
            assert np.isfinite(log.rows[log["detected"] == 1][:, flown]).all()

    def test_surfaces_stay_within_their_travel(self, built_in):
        flight, log = built_in
        for surface in flight.scenario.airframe.surfaces:
            low, high = TRAVEL_RAD[surface.partition("_")[0]]  # of a half as of the whole
            assert log[f"{surface}_cmd_rad"].min() >= low
            assert log[f"{surface}_cmd_rad"].max() <= high

    def test_no_alarm_without_a_fault(self, built_in):
        flight, _ = built_in
        require_promises(flight)
        first = min((fault.at_s for fault in flight.scenario.faults), default=np.inf)
        assert flight.detection_time_s is None or flight.detection_time_s >= first

    def test_every_fault_shows_in_its_channel(self, built_in):
        flight, log = built_in
        for fault in flight.scenario.faults:
            after = log["t_s"] >= fault.at_s - 1e-9
            if fault.type == "loss_of_effectiveness":
                moved, left = log[f"{fault.actuator}_pos_rad"], np.where(after, 1.0 - fault.magnitude, 1.0)
                assert log[f"{fault.actuator}_effective_rad"] == pytest.approx(left * moved)
            assert flight.detection_time_s is not None

    def test_the_estimator_of_the_true_fault_is_never_excluded(self, built_in):
        flight, log = built_in
        require_promises(flight)
        alone = log["t_s"] < min((fault.at_s for fault in flight.scenario.faults[1:]), default=np.inf)
        for fault in flight.scenario.faults:  # two together are outside the class
            if fault.type == "loss_of_effectiveness":
                assert not log[f"fie_{fault.actuator}_excluded"][alone].any()

    def test_rates_stay_bounded_or_the_report_says_why_no_law_could(self, built_in):
        flight, log = built_in
        if flight.scenario.control.law == "nominal":
            pytest.skip("shows what a law that knows of no fault does")
        first = min((fault.at_s for fault in flight.scenario.faults), default=0.0)
        after = log["t_s"] >= first
        fastest = max(np.abs(log[f"{axis}_rad_s"][after]).max() for axis in "pqr")
        why = dict(verdict_lines(measure(flight))).get("authority", "")
        flies = flight.departure is None and fastest < np.deg2rad(15)
        assert flies or "no deflection could hold the rate" in why

    def test_the_log_has_one_row_a_frame_on_the_frame_clock(self, built_in):
        flight, log = built_in
        assert len(log.rows) == flight.frames
        assert log["t_s"] == pytest.approx(np.arange(flight.frames) / flight.scenario.rate_hz, abs=1e-12)


def test_same_scenario_same_bits():
    (first, one), (second, two) = flown(faults=[loss()]), flown(faults=[loss()])
    assert np.array_equal(one.rows, two.rows, equal_nan=True)
    assert yielded(first) == yielded(second)


def test_reading_through_python_gives_the_same_bits(monkeypatch):
    _, native = flown(faults=[loss()], duration_s=15)
    monkeypatch.setenv("BEAVER_FTC_NATIVE", "0")
    _, through_python = flown(faults=[loss()], duration_s=15)
    assert np.array_equal(native.rows, through_python.rows, equal_nan=True)


def test_a_flight_without_a_log_has_the_same_outcome():
    case = scenario(faults=[loss()])
    assert yielded(fly(case)) == yielded(fly(case, Memory()))


class Silent:
    def reset(self, context):
        self.verdict = Verdict()

    def step(self, measured, command):
        return self.verdict


@pytest.mark.parametrize("detector", [None, Silent()])
def test_a_watch_sees_every_frame_of_a_flight_that_departs(detector):
    seen_s, memory = [], Memory()

    def watch(loop):
        loop.after_frame = lambda: seen_s.append(float(loop.frames["t"][0]))
        return lambda: seen_s.append("end")

    departs = scenario(duration_s=20, faults=[{"type": "hardover", "actuator": "elevator", "at_s": 0.5}])
    fly(departs, memory, watch=watch, detector=detector)
    assert 1.0 < seen_s[-2] < 19.0
    assert seen_s == [*memory["t_s"], "end"]


class TestFrames:
    def test_the_truth_moves_by_the_acceleration_logged(self):
        """x[k+1] = x[k] + dt a[k]: what the estimators rest on, up to the Earth's rotation."""
        _, log = flown(faults=[loss()])
        for axis in "pqr":
            moved = np.diff(log[f"{axis}_rad_s"]) * 100
            assert moved == pytest.approx(log[f"{axis}dot_rad_s2"][:-1], abs=1e-4)


class TestDepartures:
    def test_a_departure_ends_the_flight_and_says_which_signal(self):
        flight, log = flown(
            duration_s=40,
            faults=[{"type": "unanticipated", "Cm_alpha3": 10, "at_s": 12}],
            control={"law": "nominal"},
        )
        at_s, signal = flight.departure
        assert signal == "alpha"
        assert at_s == log["t_s"][-1]
        assert abs(log["alpha_rad"][-1]) > 0.6
        assert np.abs(log["alpha_rad"][:-1]).max() <= 0.6
        assert flight.envelope_exits

    def test_the_ground_ends_the_flight(self):
        dive = {"q": [{"step": {"amplitude_deg_s": -3, "start_s": 1, "end_s": 7}}]}
        for altitude_m, ground_m in ((700, 0), (200, -300)):
            start = {"altitude_m": altitude_m}
            flight, log = flown(duration_s=120, rate_hz=20, reference=dive, initial=start)
            at_s, signal = flight.departure
            assert (signal, at_s) == ("altitude", log["t_s"][-1])
            assert log["altitude_m"][-1] < ground_m <= log["altitude_m"][-2]

    def test_a_truth_that_is_not_finite_is_named(self, monkeypatch):
        flying = loop.Loop(scenario(duration_s=2))
        flying.cockpit.native = False
        flying.frames["truth"]["native"] = 0
        flying.fly_with(None)
        read = flying.cockpit.read

        def poisoned():
            read()
            if flying.frames["k"][0] == 50:
                flying.frames["truth"]["value"][0, [name for name, _, _ in TRUTH].index("beta_rad")] = np.nan

        monkeypatch.setattr(flying.cockpit, "read", poisoned)
        with pytest.raises(SimulationFailed, match=r"beta_rad.*0\.5 s|0\.5 s.*beta_rad"):
            list(flying.chunks())
