"""The sensor monitor in flights by rotation matrices, and its decisions on tests that are set by hand."""

from itertools import pairwise

import numpy as np
import pytest
from kernels import new_fdi
from true_flight import UNITS, new_monitor, true_flight

from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.model_prediction import prediction_dtype
from beaver_ftc.diagnosis.monitors import redundancy, sensor_monitor
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    ANGLE_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    GYRO_CONFIRMED,
    GYRO_OPEN,
    GYRO_REFUTED,
    PRESSURE_TEST,
    PSI,
    RPM_TEST,
    SPEED_TEST,
    THETA,
    TURN_TEST,
)
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    MEASURED,
    N_SENSORS,
    PHI,
    SENSORS,
)

H, N, FROM = 0.01, 200, 40
FORCES = (AX, AX + 1, AX + 2)
D = np.diag([4.0, 3.0, 1.0])


def flown(readings, true, missing=None, **fields):
    """The monitor after a flight; the readings (N, N_SENSORS) that the diagnosis is given, and whether it may
    use accelerometers (N,). The innovation has the errors of the gyros in it alone."""
    fdi, given, inertial = new_fdi(), [], []
    monitor = new_monitor(H, 0.02 * UNITS, 0.01 * UNITS, **fields)
    monitor["config"]["D"], monitor["config"]["D_size"] = D, -D
    monitor["config"]["y_trim"] = true[0]
    fdi["bound"]["nu_max"] = fdi["bound"]["eta_bar"] = 0.2
    fdi["bank"]["output"]["threshold"] = 9.0
    measured, pred = (np.zeros(1, dtype).view(np.recarray)[0] for dtype in (MEASURED, prediction_dtype(4)))
    error = (readings - true)[:, :3]
    for k, y in enumerate(readings):
        measured["signal"], measured["force"], measured["inertial"] = y, y[AX:], 1
        if missing is not None and k >= FROM:
            measured["missing"][missing] = 1
        past, now = error[max(k - 2, 0)], error[max(k - 1, 0)]
        fdi["bank"]["output"]["innovation"] = (now - past) / H + D @ past
        pred["f"] = (true[k, :3] - true[max(k - 1, 0), :3]) / H
        sensor_monitor.check_sensors(
            monitor, pred, measured, fdi["verdict"], fdi["bank"], fdi["bound"], H, k * H
        )
        given.append(measured["signal"].copy())
        inertial.append(int(measured["inertial"]))
    return monitor, np.array(given), np.array(inertial)


def with_fault(seed, sensor, kind, size):
    """(readings, true) (N, N_SENSORS): sound noise, and this fault of a sensor from the sample FROM on."""
    rng, after = np.random.default_rng(seed), np.arange(N) >= FROM
    true = true_flight(rng, N, H)
    readings = true + 0.009 * UNITS * rng.uniform(-1.0, 1.0, true.shape)
    readings[:, PHI : PHI + 3] = true[:, PHI : PHI + 3]
    y, e = readings[:, sensor], size * UNITS[sensor]
    if kind == "jump":
        y += e * after
    elif kind == "scale":
        y += size * y * after
    elif kind == "noise":
        y += e * after * rng.normal(size=N)
    elif kind == "frozen":
        y[after] = y[FROM]
    return readings, true


NAMED = [
    ("p", "jump", 10), ("q", "jump", -10), ("r", "jump", 10), ("q", "scale", -1), ("r", "noise", 20),
    ("alpha", "jump", 15), ("alpha", "noise", 20), ("beta", "jump", -15), ("beta", "noise", 20),
    ("V", "jump", 8), ("V", "scale", 0.3), ("qdyn", "scale", 0.2), ("qdyn", "noise", 10),
    ("phi", "jump", 20), ("theta", "jump", -20), ("psi", "jump", 20), ("theta", "frozen", 0),
    ("altitude", "jump", 10), ("altitude", "noise", 10), ("engine_rpm", "jump", 9),
    ("manifold_pressure", "jump", 9), ("az", "jump", 40), ("ax", "jump", 60),
]  # fmt: skip


@pytest.mark.parametrize(("name", "kind", "size"), NAMED)
def test_a_broken_sensor_is_isolated_and_its_reading_replaced(name, kind, size):
    i = SENSORS.index(name)
    readings, true = with_fault(7, i, kind, size)
    monitor, given, inertial = flown(readings, true)
    output = monitor["output"]
    assert output["alarmed"]
    assert output["isolated_sensor"] == i, [SENSORS[s] for s in np.flatnonzero(output["suspect"])]
    k = round(output["isolated_at_s"] / H)
    assert FROM <= k < N
    assert np.flatnonzero(output["is_reading_unused"]).tolist() == [i]
    assert (np.delete(given, i, axis=1) == np.delete(readings, i, axis=1)).all()
    if i < AX:
        assert abs(given[k:, i] - true[k:, i]).max() < 8.0 * UNITS[i]
    assert inertial[k:].any() == (i < AX)


@pytest.mark.parametrize("seed", range(4))
def test_sound_sensors_raise_no_alarm(seed):
    readings, true = with_fault(seed, 0, "none", 0)
    monitor, given, inertial = flown(readings, true)
    assert not monitor["output"]["alarmed"]
    assert (given == readings).all() and inertial.all()  # noqa: PT018


def with_ratios(ratios, **fields):
    """Tests {test: ratio}, of which the residual is as large; in level flight, where each angle turns the
    aircraft about one axis. Other bounds are 1."""
    monitor = new_monitor(H, **fields)
    test = monitor["redundancy"]["test"]
    test["B"] = 1.0
    for j, ratio in ratios.items():
        test["ratio"][j], test["r"][j] = ratio, ratio
    monitor["memory"]["c_max"] = np.eye(3)
    turns, angles = test["r"][TURN_TEST:][:3], test["r"][ANGLE_TEST:][:3]
    monitor["memory"]["beyond"] = turns - np.eye(3)[..., None] * angles[:, None]
    return monitor


def suspects(ratios, alarm=None, **fields):
    """The sensors that can have brought the tests here."""
    monitor = with_ratios(ratios, **fields)
    monitor["output"]["alarm_test"] = max(ratios, key=ratios.get) if alarm is None else alarm
    sensor_monitor.latch_exceeded(monitor)
    sensor_monitor.find_suspects(monitor)
    return set(np.flatnonzero(monitor["output"]["suspect"]).tolist())


@pytest.mark.parametrize(
    ("ratios", "who"),
    [
        ({SPEED_TEST: 2.0}, {AIRSPEED, *FORCES}),
        ({DENSITY_TEST: 3.0, SPEED_TEST: 2.0}, {AIRSPEED}),
        ({CLIMB_TEST: 2.0}, {ALTITUDE}),
        ({CLIMB_TEST: 3.0, SPEED_TEST: 2.0}, set()),  # the altitude is in no other test
        ({DENSITY_TEST: 3.0, CLIMB_TEST: 2.0}, {AIRSPEED}),  # nor is the dynamic pressure
        ({RPM_TEST: 2.0}, {ENGINE_SPEED}),
        ({PRESSURE_TEST: 2.0}, {MANIFOLD}),
        ({ALPHA_TEST: 5.0}, {ALPHA, *FORCES}),
        ({BETA_TEST: 5.0}, {BETA, *FORCES}),
        ({ALPHA_TEST: 2.0}, {ALPHA, 1, *FORCES}),  # its gyro need not show yet: within twice both bounds
        ({BETA_TEST: 2.0}, {BETA, 2, *FORCES}),
        ({ALPHA_TEST: 5.0, TURN_TEST + 1: 2.0}, {1}),
        ({BETA_TEST: 5.0, TURN_TEST + 2: 2.0}, {2}),
        ({BETA_TEST: 5.0, TURN_TEST: 2.0}, {0}),  # no sensor of the flow moves the attitude's tests
        ({ALPHA_TEST: 5.0, TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        ({TURN_TEST: 2.1}, {0}),
        ({TURN_TEST + 2: 2.1}, {2}),
        ({TURN_TEST: 1.9}, {0, PHI}),  # the angle's own test may hide as much: both bounds together
        ({TURN_TEST + 1: 2.0, ANGLE_TEST + 1: 1.5}, {1, THETA}),
        ({TURN_TEST: 2.0, TURN_TEST + 1: 1.5}, set()),
        ({ANGLE_TEST + 2: 2.0}, {0, 1, 2, PSI}),  # an angle alone may be the first to show what a gyro does
        ({ANGLE_TEST: 2.0, ANGLE_TEST + 2: 1.5}, {0, 1, 2}),
        ({TURN_TEST: 100.0, TURN_TEST + 1: 2.9}, {0}),  # a large error moves its neighbours a little
        ({TURN_TEST: 100.0, TURN_TEST + 1: 3.1}, set()),
        ({ANGLE_TEST: 100.0, ANGLE_TEST + 1: 2.9}, {0, 1, 2, PHI}),
        ({TURN_TEST + 2: 100.0, ANGLE_TEST: 2.0}, {2, PHI}),  # angles are compared with angles
    ],
)
def test_who_is_suspected_of_what_the_tests_show(ratios, who):
    assert suspects(ratios) == who


@pytest.mark.parametrize("wrong", range(3))
def test_the_error_of_one_angle_leaves_nothing_beyond_it(wrong):
    """In random attitudes the reading of one angle is off by random steps: the tests of turning show nothing
    beyond that angle."""
    rng, monitor, y = np.random.default_rng(wrong), new_monitor(H), np.ones(N_SENSORS)
    red = monitor["redundancy"]
    red["config"]["decay"] = red["memory"]["y_past"] = 1.0
    for _ in range(20):
        angles = rng.uniform((-3.0, -1.2, -3.0), (3.0, 1.2, 3.0))
        red["memory"]["predicted_reading"][PHI : PHI + 3] = y[PHI : PHI + 3] = angles
        y[PHI + wrong] += rng.uniform(-1e-3, 1e-3)
        redundancy.fill_residuals(red, y, redundancy.attitude(red["memory"]["predicted_reading"]))
        sensor_monitor.filter_beyond(monitor, y)
    beyond = abs(monitor["memory"]["beyond"]).max(axis=(1, 2))
    assert (beyond < 1e-8).tolist() == [i == wrong for i in range(3)]


def judged(error=0.0, then=0.0, innovation=0.0, noise=0.0, spike=0.0, **fields):
    """What the rates say of the first gyro; the bound of a frame is 1 rad/s2, of 0.02 s."""
    first = {"w_att": error, "w_att_past": then, "peak_older": spike, **fields}
    monitor, fdi = new_monitor(H, **{name: (value, 0.0, 0.0) for name, value in first.items()}), new_fdi()
    monitor["redundancy"]["test"]["bound_per_sample"] = noise * H / 4.0
    fdi["bank"]["output"]["innovation"][0], fdi["bound"]["nu_max"] = innovation, 1.0
    fdi["bank"]["output"]["threshold"][:3] = 1.0
    sensor_monitor.judge_gyros(monitor, fdi["bank"], fdi["bound"], 0.02)
    return monitor["memory"]["gyro_verdict"][0]


@pytest.mark.parametrize(
    ("shown", "verdict"),
    [
        ({"error": 0.3, "innovation": 15.0}, GYRO_CONFIRMED),  # a jump of a gyro is an acceleration
        ({"error": 0.3}, GYRO_REFUTED), ({"error": 0.3, "innovation": -15.0}, GYRO_REFUTED),
        ({"error": 0.3, "then": 0.3, "w": 0.3, "w_bound": 0.1}, GYRO_CONFIRMED),
        # of a jump a tenth, of the error ten per second, twice four noises a frame, and the bound
        ({"error": 0.02, "innovation": -0.29, "w_bound": 9.0}, GYRO_OPEN),
        ({"error": 0.02, "innovation": -0.31, "w_bound": 9.0}, GYRO_REFUTED),
        ({"error": 0.02, "innovation": -0.31, "w_bound": 9.0, "noise": 0.01}, GYRO_OPEN),
        # what has shown and is gone is no gyro's
        ({"error": 0.0029, "then": 0.0029, "spike": 1.0, "w_bound": 1.0}, GYRO_REFUTED),
        ({"error": 0.0031, "then": 0.0031, "spike": 1.0, "w_bound": 1.0}, GYRO_OPEN),
        ({"peak_past": 0.004, "spike": 1.0, "w_bound": 1.0}, GYRO_OPEN),
        ({"spike": 1.0, "noise": 0.6, "w_bound": 1.0}, GYRO_OPEN),
        ({"spike": 1.21, "noise": 0.6, "w_bound": 1.0}, GYRO_REFUTED),
        # 0.7 of an error is within what the dynamics may have of it
        ({"error": 0.99, "then": 0.99, "w": -0.2, "w_bound": 0.5}, GYRO_OPEN),
        ({"error": 1.01, "then": 1.01, "w": -0.2, "w_bound": 0.5}, GYRO_REFUTED),
        # there in every sample, and it varies; steady; absent from one sample; all may be noise
        ({"error": 0.002, "innovation": 9.0, "floor_past": 0.05, "peak_past": 0.2}, GYRO_OPEN),
        ({"error": 0.002, "innovation": 9.0, "floor_past": 0.05, "peak_past": 0.0549}, GYRO_REFUTED),
        ({"error": 0.002, "innovation": 9.0, "peak_past": 0.2}, GYRO_REFUTED),
        ({"innovation": 20.0, "floor_past": 0.05, "peak_past": 0.2, "noise": 0.06}, GYRO_REFUTED),
        ({"error": 0.3, "gyro_verdict": GYRO_CONFIRMED}, GYRO_CONFIRMED),
    ],
)  # fmt: skip
def test_whether_the_error_of_the_attitude_is_a_gyros(shown, verdict):
    assert judged(**shown) == verdict


def test_the_filter_of_a_gyros_error_follows_it_exactly():
    """w' = -D w + nu with nu = e' + D e, for an e of any course; and the bound of its own uncertainty."""
    rng, dt, eta = np.random.default_rng(3), 0.02, np.array([0.3, 0.2, 0.1])
    D = np.array([[3.0, 0.4, -0.2], [0.1, 2.0, 0.3], [-0.5, 0.2, 1.0]])
    D_size = abs(D) - 2.0 * np.diag(np.diag(D))
    monitor, bound = new_monitor(H, D=D, D_size=D_size), np.zeros(3)
    error = np.vstack([np.zeros(3), rng.normal(size=(40, 3))])
    for past, now in pairwise(error):
        sensor_monitor.advance_gyro_estimate(monitor, (now - past) / dt + D @ past, eta, dt)
        bound = np.maximum(bound + dt * (eta + D_size @ bound), 0.0)
    assert monitor["memory"]["w"] == pytest.approx(error[-1])
    assert monitor["memory"]["w_bound"] == pytest.approx(bound)


@pytest.mark.parametrize(("size", "excluded"), [(0.999, 0), (1.001, 1)])
def test_no_gyro_is_broken_if_w_and_the_attitude_differ_by_more_than_all_bounds(size, excluded):
    monitor = new_monitor(H, w=(0.0, -0.5, 0.0), w_bound=(0.1, 0.3, 0.1))
    test = monitor["redundancy"]["test"]
    test["B"], test["B"][TURN_TEST + 1, 0] = 9.0, 0.02
    limit = 0.02 + H * (0.3 + attitude.DAMPING_TOLERANCE * 0.5)
    test["residual"][TURN_TEST + 1] = size * limit + H * 0.5
    sensor_monitor.exclude_gyros(monitor)
    assert monitor["memory"]["gyros_excluded"] == excluded
    assert monitor["memory"]["gap"][1] == pytest.approx([size * limit] * 3)
