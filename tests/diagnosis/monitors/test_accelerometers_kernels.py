"""An accelerometer, or what it is held against: each piece of evidence by itself, on courses of errors."""

import numpy as np
import pytest
from kernels import holder

from beaver_ftc.diagnosis.monitors import redundancy, sensor_monitor
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    ALPHA_TEST,
    BETA,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    NO_SENSOR,
    QDYN,
    SENSOR_MONITOR_RECORD,
    SPEED_TEST,
    P,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, MEASURED, N_SENSORS, PHI

H, V, INCIDENCE = 0.01, 45.0, 0.12
AY, AZ = AX + 1, AX + 2
FORCES = (AX, AY, AZ)
OF = {SPEED_TEST: AIRSPEED, ALPHA_TEST: ALPHA, BETA_TEST: BETA}
UNIT = {SPEED_TEST: 1.0, ALPHA_TEST: 1.0 / V, BETA_TEST: 1.0 / V}


def level(alpha=INCIDENCE, beta=0.02):
    signal = np.zeros(N_SENSORS)
    signal[[ALPHA, BETA, AIRSPEED, QDYN]] = alpha, beta, V, 1000.0
    signal[ALTITUDE], signal[[AX, AY, AZ]] = 1800.0, (0.5, 0.1, -9.7)
    return signal


def new_watch(lead=ALPHA_TEST, bound=1e-3):
    monitor = np.zeros(1, SENSOR_MONITOR_RECORD).view(np.recarray)[0]
    (
        monitor["output"]["isolated_sensor"],
        monitor["output"]["alarm_test"],
        monitor["output"]["alarmed"],
        monitor["config"]["n_frozen"],
    ) = NO_SENSOR, lead, 1, 3
    relations = monitor["redundancy"]
    relations["config"]["sample_time_s"], relations["config"]["decay"] = H, (0.0, 0.9, 0.99)
    relations["test"]["B"] = bound
    relations["memory"]["y_past"] = monitor["memory"]["y_older"] = level()
    return monitor


def looks(monitor, readings, residuals):
    """Each look's readings, and the residual of the test that leads."""
    for signal, residual in zip(readings, residuals, strict=True):
        monitor["redundancy"]["test"]["residual"][monitor["output"]["alarm_test"]] = residual
        sensor_monitor.count_same(monitor, signal)
        sensor_monitor.clear_sensors(monitor, signal)
        monitor["memory"]["y_older"] = monitor["redundancy"]["memory"]["y_past"]
        monitor["redundancy"]["memory"]["y_past"] = signal


def cleared(monitor):
    return set(np.flatnonzero(monitor["memory"]["cleared"]).tolist())


def course(of, values):
    """Level flight in which one reading goes along `values`; none of the others stands still."""
    readings = [level() + 1e-9 * k for k in range(1, len(values) + 1)]
    for signal, value in zip(readings, values, strict=True):
        signal[of] = level()[of] + value
    return readings


def test_a_reading_that_is_the_same_is_counted_until_it_is_not():
    monitor, signal = new_watch(), level()
    for expected in (1, 2, 3):
        sensor_monitor.count_same(monitor, signal)
        assert monitor["memory"]["n_same"][ALPHA] == expected
    assert sensor_monitor.is_frozen(monitor, ALPHA)
    monitor["config"]["n_frozen"][ALPHA] = 4
    assert not sensor_monitor.is_frozen(monitor, ALPHA)
    signal[ALPHA] += 1e-15
    sensor_monitor.count_same(monitor, signal)
    assert monitor["memory"]["n_same"][[ALPHA, BETA]].tolist() == [0, 4]


@pytest.mark.parametrize("lead", OF)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_comes_at_once_and_is_in_the_reading_is_no_accelerometer_s(lead, sign):
    """A jump by more than an accelerometer makes up in a look; one by less may be either's."""
    least = 1e-3 + sensor_monitor.FORCE_JUMP_M_S2 * H * UNIT[lead]
    for size, leaps in ((1.01, True), (0.99, False)):
        jump = sign * size * least
        monitor = new_watch(lead)
        looks(monitor, course(OF[lead], [jump]), [jump])
        assert cleared(monitor) == (set(FORCES) if leaps else set())
    monitor = new_watch(lead)
    looks(monitor, course(OF[lead], [0.49 * sign * least]), [1.01 * sign * least])
    assert cleared(monitor) == set(), "the reading has not half of it"


@pytest.mark.parametrize("sensor", FORCES)
def test_where_an_accelerometer_has_leapt_the_reading_s_own_says_nothing(sensor):
    """Scatter of both: what the accelerometer's leap of late makes up in a look is more than half of it."""
    jump = 0.05
    for ago in (0, 40):
        for share, leaps in ((0.99, True), (1.01, False)):
            monitor = new_watch(bound=1.0)
            monitor["redundancy"]["memory"]["y_past"][sensor] += (
                share * 0.5 * jump / (1.5 * H / V) / 0.995**ago
            )
            looks(monitor, course(ALPHA, np.zeros(ago) + 1e-9 * np.arange(ago)), np.zeros(ago))
            monitor["redundancy"]["test"]["B"] = 1e-3
            (signal,) = course(ALPHA, [jump])
            signal[list(FORCES)] = (
                monitor["redundancy"]["memory"]["y_past"][list(FORCES)]
                if ago
                else level()[list(FORCES)] + 1e-9
            )
            looks(monitor, [signal], [jump])
            assert (AZ in cleared(monitor)) == leaps


def test_what_accelerometers_have_leapt_is_forgotten_in_two_seconds_at_any_rate():
    for h in (0.002, 0.01, 0.02):
        monitor = new_watch()
        (
            monitor["redundancy"]["config"]["sample_time_s"],
            monitor["memory"]["jump"],
        ) = h, 3.0
        for _ in range(round(2.0 / h)):
            sensor_monitor.count_same(monitor, monitor["redundancy"]["memory"]["y_past"].copy())
        assert monitor["memory"]["jump"] == pytest.approx(3.0 * np.exp(-1.0), rel=0.02)


def test_long_after_the_alarm_a_leap_says_nothing():
    """A second after it, whatever the rate of the looks."""
    for h, n_summed, clear in (
        (0.01, 99, set(FORCES)), (0.01, 100, set()), (0.002, 499, set(FORCES)), (0.002, 500, set()),
    ):  # fmt: skip
        monitor = new_watch()
        monitor["redundancy"]["config"]["sample_time_s"], monitor["memory"]["n_since"] = (
            h,
            n_summed,
        )
        (
            monitor["memory"]["y_min"],
            monitor["memory"]["y_max"],
        ) = -1.0, 99.0
        monitor["redundancy"]["test"]["B"][CLIMB_TEST] = 99.0
        looks(monitor, course(ALPHA, [0.05]), [0.05])
        assert cleared(monitor) == clear


def test_a_straight_course_is_no_leap():
    """Second differences: a steady change of the reading is none, however fast."""
    monitor, rate = new_watch(), 0.1
    monitor["memory"]["y_older"][ALPHA] -= rate
    looks(monitor, course(ALPHA, [rate]), [rate])
    assert cleared(monitor) == set()


@pytest.mark.parametrize("lead", OF)
def test_an_error_of_a_force_goes_on_and_clears_the_reading_that_has_hardly_moved(lead):
    moving = 1e-5 * V * UNIT[lead] * np.sin(np.arange(400.0))
    monitor = new_watch(lead, bound=1.0)
    looks(monitor, course(OF[lead], moving), np.full(400, H * 1.0 * UNIT[lead]))
    assert cleared(monitor) == {OF[lead]}
    large = new_watch(lead, bound=99.0)
    looks(large, course(OF[lead], 1e4 * moving), np.full(400, H * 1.0 * UNIT[lead]))
    assert cleared(large) == set()


def test_what_goes_on_is_beyond_what_sound_instruments_may_add_up_to():
    moving = 1e-6 * np.sin(np.arange(100.0))
    for share, clear in ((0.9, set()), (1.1, {ALPHA})):
        monitor = new_watch(bound=1.0)
        test = monitor["redundancy"]["test"][ALPHA_TEST]
        test["bound_per_s"], test["bound_per_sample"] = 0.01, 1e-4
        each = share * (sensor_monitor.CLEAR_FACTOR * (0.01 * H * 99 + 2e-4) + 30.0 * 2e-6) / 99
        looks(monitor, course(ALPHA, moving), np.full(100, each))
        assert cleared(monitor) == clear


def test_the_look_of_the_alarm_counts_for_a_jump_only():
    """A vane that jumps by less than it takes is not cleared by its own jump, nor later."""
    jump = 1.5e-3
    monitor = new_watch()
    looks(monitor, course(ALPHA, jump + 1e-7 * np.sin(np.arange(300.0))), [jump, *np.zeros(299)])
    assert cleared(monitor) == set()
    assert monitor["memory"]["r_sum"][1] == 0.0


def test_scatter_of_a_vane_does_not_go_on():
    scatter = np.random.default_rng(2).normal(0.0, 1e-3, 300)
    monitor = new_watch(bound=1.0)
    looks(monitor, course(ALPHA, scatter), np.diff(scatter, prepend=0.0))
    assert cleared(monitor) == set()


@pytest.mark.parametrize("lead", OF)
def test_who_stands_still_is_frozen(lead):
    """A vane that does not move clears the accelerometers; an accelerometer that does not, the vane."""
    for frozen, clear in ((OF[lead], set(FORCES)), (AY, {OF[lead]})):
        monitor = new_watch(lead, bound=1.0)
        looks(monitor, course(frozen, np.zeros(6)), np.full(6, 1e-5))
        assert cleared(monitor) == clear
        sensor_monitor.suspect_accelerometers(monitor, False)
        who = np.flatnonzero(monitor["output"]["suspect"]).tolist()
        assert who == ([] if clear == set(FORCES) else [AY])


def test_an_airspeed_s_error_is_in_the_density_too():
    seen = new_watch(SPEED_TEST, bound=1.0)
    seen["memory"]["exceeded"][DENSITY_TEST] = 1
    looks(seen, course(AIRSPEED, [1e-5]), [0.5])
    assert cleared(seen) == set(FORCES)
    for size, clear in ((0.99, set()), (1.01, {AIRSPEED})):
        monitor = new_watch(SPEED_TEST, bound=1.0)
        test = monitor["redundancy"]["test"]
        test["B"][DENSITY_TEST], test["B"][SPEED_TEST] = 1e-3, 0.2
        test["r"][SPEED_TEST, 2] = -(0.2 + size * sensor_monitor.CLEAR_FACTOR * 1e-3 * V / 2.0)
        looks(monitor, course(AIRSPEED, [1e-5]), [0.01])
        assert cleared(monitor) == clear


def test_an_incidence_s_error_is_in_the_climb_too():
    """The climb that the angle added up would make, through the same filters as that which is seen."""
    for bound, clear in ((0.9, {ALPHA}), (1.1, set())):
        monitor, rng = new_watch(bound=1.0), np.random.default_rng(5)
        readings = course(ALPHA, rng.normal(0.0, 0.02, 100))
        for signal in readings:
            signal[PHI : PHI + 2] = 0.3, 0.2
        each, fallen = 1e-3, 0.0
        for k in range(100):
            fallen = 0.99 * fallen + H * V * each * k * np.cos(0.3) * np.cos(0.2)
        monitor["redundancy"]["test"]["B"][CLIMB_TEST] = (
            9.0,
            9.0,
            bound * fallen / sensor_monitor.CLEAR_FACTOR,
        )
        looks(monitor, readings, np.full(100, each))
        assert cleared(monitor) == clear
        assert monitor["memory"]["climb"][2] == pytest.approx(fallen)


def test_a_climb_that_shows_clears_nobody():
    monitor = new_watch(bound=1.0)
    (
        monitor["redundancy"]["test"]["B"][CLIMB_TEST],
        monitor["memory"]["exceeded"][CLIMB_TEST],
        monitor["memory"]["climb"],
    ) = (
        1e-9,
        1,
        1.0,
    )
    assert not sensor_monitor.other_test_contradicts(monitor, level())
    monitor["memory"]["exceeded"][CLIMB_TEST] = 0
    assert sensor_monitor.other_test_contradicts(monitor, level())
    monitor["output"]["alarm_test"] = BETA_TEST
    assert not sensor_monitor.other_test_contradicts(monitor, level())


def test_other_alarms_are_none_of_theirs():
    for lead in (P, DENSITY_TEST, CLIMB_TEST):
        monitor = new_watch(lead)
        monitor["memory"]["n_same"] = 9
        looks(monitor, course(ALPHA, [0.1]), [0.1])
        assert cleared(monitor) == set()
        assert not monitor["memory"]["n_since"]


@pytest.mark.parametrize("i", range(3))
@pytest.mark.parametrize("flow", [(0.0, 0.0), (0.2, -0.3)])
def test_the_axis_of_the_velocity_made_up_is_that_of_the_accelerometer(i, flow):
    """By turning a step along a body axis into speed, incidence and sideslip."""
    alpha, beta = flow
    monitor = new_watch()
    monitor["redundancy"]["memory"]["y_past"] = level(alpha, beta)
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    moved = v + 1e-4 * np.eye(3)[i]
    speed = np.linalg.norm(moved)
    monitor["memory"]["r_sum"] = (
        speed - V, np.arctan2(moved[2], moved[0]) - alpha, np.arcsin(moved[1] / speed) - beta
    )  # fmt: skip
    sensor_monitor.suspect_accelerometers(monitor, False)
    assert np.flatnonzero(monitor["output"]["suspect"]).tolist() == [AX + i]
    for doubt, all_of_them in ((0.49e-4, False), (0.51e-4, True)):
        monitor["memory"]["B_sum"] = doubt, 0.0, 0.0
        sensor_monitor.suspect_accelerometers(monitor, False)
        assert bool(monitor["output"]["suspect"][AX:].all()) == all_of_them
    sensor_monitor.suspect_accelerometers(monitor, True)
    assert not monitor["output"]["suspect"].any(), "a gyro explains it"
    monitor["memory"]["cleared"][AX:] = 1
    sensor_monitor.suspect_accelerometers(monitor, False)
    assert not monitor["output"]["suspect"].any()


@pytest.mark.parametrize(
    ("fields", "used"),
    [
        ({}, 1),
        ({"is_reading_unused": AZ}, 0),
        ({"suspect": AX}, 0),
        ({"is_reading_unused": ALPHA, "suspect": BETA}, 1),
    ],
)
def test_none_is_used_once_one_may_be_broken(fields, used):
    monitor, measured = new_watch(), np.zeros(1, MEASURED).view(np.recarray)[0]
    measured["inertial"] = 1
    for name, i in fields.items():
        holder(monitor, name)[name][i] = 1
    sensor_monitor.disable_suspects(monitor, measured)
    assert measured["inertial"] == used


@pytest.mark.parametrize(("steady", "changing"), [(0.3, 0.1), (0.0, 0.05)])
def test_what_a_reading_may_be_off_covers_two_steps(steady, changing):
    """1.5 a - 0.5 a_then, at its worst: a bias, and noise that changes sides."""
    relations = new_watch()["redundancy"]
    (
        relations["config"]["const"][AX],
        relations["memory"]["e_past"][AX],
        relations["memory"]["e_older"][AX],
    ) = (
        steady,
        steady + changing,
        steady + changing,
    )
    worst = 1.5 * (steady + changing) - 0.5 * (steady - changing)
    assert redundancy.extrapolate_bound(relations, AX) == pytest.approx(worst)
