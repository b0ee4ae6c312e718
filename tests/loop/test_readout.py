"""Readouts say what the log says of the same frame, and what a scenario and its aircraft declare."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.diagnosis.readout import RECORDED_BLOCK_FIELDS
from beaver_ftc.loop import Stepping, agent, recorded_always, recorded_until_alarm
from beaver_ftc.loop import readout as of_loop
from beaver_ftc.loop.readout import FrameReadout, Instruments
from beaver_ftc.plant import channels
from beaver_ftc.plant.instruments import SENSORS

FLIGHT = {
    "name": "read", "duration_s": 3.0, "sensors": "consumer-grade",
    "control": {"law": "fault-tolerant"},
    "fdi": {
        "fault_class": "all", "statistical": {}, "sensor_monitor": "always",
        "bounds": {"sensors": "consumer-grade"},
    },
    "faults": [{"type": "stuck", "actuator": "elevator", "at_s": 1.0, "position_deg": 8.0}],
}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    """Step to the end; the readouts of the first and last frame, the last row, when the alarm was raised."""
    flight = Stepping(bf.load(FLIGHT))
    first = flight.readout
    first.rates_rad_s  # noqa: B018  # read, so that it stays
    alarm_s = None
    while not flight.done:
        flight.step()
        if alarm_s is None and flight.verdict.detected:
            alarm_s = flight.t_s
    row = dict(zip(flight.columns, flight.values, strict=True))
    yield flight, first, flight.readout, row, alarm_s
    flight.release()


def by_axis(row, name):
    return [row[f"{axis}_{name}"] for axis in "pqr"]


def test_a_frame_is_read_as_the_log_has_it(flown):
    flight, _, now, row, _ = flown
    assert (now.k, now.dt_s, now.since) == (flight.frames, 1.0 / flight.rate_hz, 0)
    assert now.rates_rad_s.tolist() == by_axis(row, "measured_rad_s")
    assert now.airspeed_mps == row["airspeed_mps"]
    assert now.diagnosis.declared_bounds.eta_bar_rad_s2.tolist() == by_axis(row, "eta_bar_rad_s2")
    assert now.alarmed == bool(row["detected"])


def test_the_diagnosis_is_read_as_the_log_has_it(flown):
    flight, _, now, row, alarm_s = flown
    diagnosis, verdict = now.diagnosis, flight.verdict
    assert diagnosis.detected
    columns = [name for name in row if name.startswith("fie_") and name.endswith("_excluded")]
    names = [name.removeprefix("fie_").removesuffix("_excluded") for name in columns]
    assert diagnosis.detected_at_s == alarm_s
    assert names[diagnosis.isolated_estimator].removesuffix("_position") == verdict.isolated
    assert diagnosis.is_estimator_excluded.tolist() == [bool(row[f"fie_{name}_excluded"]) for name in names]
    assert [one.is_excluded for one in diagnosis.estimators] == diagnosis.is_estimator_excluded.tolist()
    assert (diagnosis.enabled, diagnosis.diagnoses_all_types) == (True, True)
    aircraft = bf.load(FLIGHT).airframe
    for s, name in enumerate(aircraft.surfaces):
        stops, actuator = aircraft.travel[name], diagnosis.surface_fault_types[s].actuator
        assert (actuator.travel_low_rad, actuator.travel_high_rad) == (stops.min_rad, stops.max_rad)
        assert names[diagnosis.layout.position_estimator_index_by_surface[s]] == f"{name}_position"
        assert names[diagnosis.layout.loss_estimator_index_by_surface[s]] == name
        assert diagnosis.layout.dominant_axis_by_surface[s] == aircraft.dominant_axis[s]


def test_the_statistical_detector_and_the_sensor_monitor_are_read_as_the_log_has_them(flown):
    _, _, now, row, _ = flown
    diagnosis, monitor = now.diagnosis, now.diagnosis.sensor_monitor
    shares = [
        one.score_in_std / diagnosis.statistical_alarm_level
        for block in diagnosis.statistical_filters
        for one in block.hypotheses
    ]
    logged = [value for name, value in row.items() if name.endswith("_likelihood_share")]
    assert max(shares) == pytest.approx(max(logged), rel=1e-12)
    for block in diagnosis.statistical_filters:
        assert block.hypothesis_tests_by_onset.score.shape[0] == len(block.hypotheses)
        assert len(block.axis_indices) in (1, 2)
    assert monitor.enabled
    assert (monitor.top_ratio, monitor.worst_test_index) == (
        row["watch_share"],
        row["watch_test"],
    )
    assert len(monitor.predicted_reading) == len(SENSORS)


def test_a_readout_stays_when_the_flight_goes_on(flown):
    _, first, now, *_ = flown
    assert (first.rates_rad_s != now.rates_rad_s).any()
    assert first.k != 1 or now.k > 1


def test_every_property_can_be_read(flown):
    _, _, now, *_ = flown
    for part in (now, now.diagnosis, now.control):
        for name in vars(type(part)):
            if not name.startswith("_"):
                assert getattr(part, name) is not None, name


def test_what_is_recorded_is_part_of_the_record(flown):
    """Not copies: a recorder takes the places of these arrays in the record."""
    flight, _, now, *_ = flown
    record, n = flight.records, len(now.diagnosis.estimators)
    always, early = recorded_always(record[0], n, True), recorded_until_alarm(record[0], n, True)
    assert {*RECORDED_BLOCK_FIELDS} < {*early}
    for name, view in (always | early).items():
        assert np.shares_memory(view, record), name
        assert view.base is not None


def test_the_duration_of_a_frame_is_not_rounded():
    assert FrameReadout(np.array([(0.0125,)], [("dt", float)])[0]).dt_s == 0.0125


def test_instruments_change_with_the_flight_that_they_read():
    measured = np.dtype([("signal", float, 2), ("inertial", bool)])
    frame = np.zeros(1, [("measured", measured)])[0]
    instruments = Instruments(frame)
    before = instruments.readings(), instruments.has_accelerometers
    frame["measured"]["signal"], frame["measured"]["inertial"] = (0.1, -2.0), True
    assert before == ([0.0, 0.0], False)
    assert instruments.readings() == [0.1, -2.0]
    assert instruments.has_accelerometers


def test_each_number_of_a_frame_is_read_from_its_own_field():
    """A record in which no two numbers are alike: each readout is counted off by hand."""
    means = np.dtype([("G", float, (3, 2)), ("F", float, 3)])
    actuators = np.dtype([(name, float, 2) for name in ("step", "approach", "high", "low")])
    prediction = np.dtype([("u", float, 2), ("G", float, (3, 2)), ("means", means), ("actuators", actuators)])
    frame = np.zeros(1, [("since", int), ("prediction", prediction), ("y", float)])[0]
    frame["since"] = 3
    now = frame["prediction"]
    now["u"], now["G"] = (1.0, 2.0), np.arange(3.0, 9.0).reshape(3, 2)
    now["means"]["G"] = np.arange(9.0, 15.0).reshape(3, 2)
    now["means"]["F"] = (15.0, 16.0, 17.0)
    for first, name in enumerate(("low", "high", "approach", "step")):
        now["actuators"][name] = (18.0 + 2 * first, 19.0 + 2 * first)
    readout = FrameReadout(frame)
    assert (readout.since, readout.expected_u_rad.tolist()) == (3, [1.0, 2.0])
    assert readout.G.tolist() == [[3.0, 4.0], [5.0, 6.0], [7.0, 8.0]]
    assert readout.mean_G.tolist() == [[9.0, 10.0], [11.0, 12.0], [13.0, 14.0]]
    assert readout.model_rad_s2.tolist() == [15.0, 16.0, 17.0]
    found = readout.actuators
    assert [found.low_rad.tolist(), found.high_rad.tolist()] == [[18.0, 19.0], [20.0, 21.0]]
    assert [found.approach.tolist(), found.step_rad.tolist()] == [[22.0, 23.0], [24.0, 25.0]]


def test_an_agent_looks_at_the_columns_of_roll_and_at_the_trim():
    columns = ["t_s", "q_measured_rad_s", "p_model_rad_s", "q_model_rad_s", "p_rad_s", "p_measured_rad_s"]
    look = agent.look_of(columns)
    assert look.tolist() == [(5, 2, 0.0, 0.0, 0.0)]
    agent.note_trim(look, np.array([0.1, -0.02, 45.0, 1036.0, 0.3]))
    assert look.tolist() == [(5, 2, 0.1, -0.02, 45.0)]


class Frame(dict):
    """A record as far as it is read: no two of its numbers are alike."""

    def __init__(self):
        super().__init__(
            k=7,
            measured={"x": np.array([0.1, 0.2, 0.3]), "y": np.array([0.4, 0.5, 60.0])},
            truth={
                "value": np.arange(100.0, 150.0), "latitude_0": 1.0, "longitude_0": 2.0, "radius_m": 3.0,
                "parallel_radius_m": 4.0, "ground_m": 5.0, "slow_mps": 6.0,
            },
            accounts={"envelope": {"n_exits": 8, "outside_frames": 9}},
            fdi={"verdict": {"detected": 0}, "sensor_monitor": {"output": {"alarmed": 0}}},
            control={
                "config": {"uses_verdict": 1, "reallocates": 1, "informed": 1},
                "power": {"output": {"in_use": 0, "command": np.array([10.0, 11.0])}},
            },
            autopilot={"enabled": 1}, held=0, held_rad=np.zeros(3),
        )  # fmt: skip


def test_the_truth_and_the_counts_of_a_frame_are_read_from_their_own_places():
    found = FrameReadout(Frame())
    assert (found.k, found.alpha_rad, found.rates_rad_s.tolist()) == (7, 0.4, [0.1, 0.2, 0.3])
    assert (found.airspeed_mps, found.height_m) == (100.0 + channels.AIRSPEED, 100.0 + channels.ALTITUDE)
    assert (tuple(found.origin), found.envelope_exits) == ((1.0, 2.0, 3.0, 4.0), 8)


@pytest.mark.parametrize(("surfaces", "sensors"), [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_an_alarm_is_one_of_the_surfaces_or_of_the_sensors(surfaces, sensors):
    frame = Frame()
    frame["fdi"]["verdict"]["detected"], frame["fdi"]["sensor_monitor"]["output"]["alarmed"] = (
        surfaces,
        sensors,
    )
    assert FrameReadout(frame).alarmed is bool(surfaces or sensors)


def test_what_is_done_to_a_record_from_outside_is_that_and_no_more():
    done = {
        "ground": (
            lambda it: of_loop.set_ground(it, 50.0, 7.5),
            {"truth": {"ground_m": 50.0, "slow_mps": 7.5}},
        ),
        "hold": (lambda it: of_loop.hold_from_start(it, np.array([0.1, 0.2, 0.3])), {"held": 1}),
        "loops": (of_loop.end_outer_loops, {"autopilot": {"enabled": 0}}),
        "power": (
            lambda it: of_loop.command_power(it, 22.5),
            {"control": {"power": {"output": {"in_use": 1}}}},
        ),
        "verdict": (
            lambda it: of_loop.withhold_from_law(it, "verdict"),
            {"control": {"config": {"uses_verdict": 0, "reallocates": 0}}},
        ),
        "stand-in": (
            lambda it: of_loop.withhold_from_law(it, "stand-in"),
            {"control": {"config": {"reallocates": 0}}},
        ),
    }
    for name, (act, changes) in done.items():
        frame, wanted = Frame(), Frame()
        act(frame)
        put(wanted, changes)
        if name == "hold":
            wanted["held_rad"] = np.array([0.1, 0.2, 0.3])
        if name == "power":
            wanted["control"]["power"]["output"]["command"][0] = 22.5
        assert repr(frame) == repr(wanted), name


def put(record, changes):
    for name, value in changes.items():
        if isinstance(value, dict):
            put(record[name], value)
        else:
            record[name] = value
