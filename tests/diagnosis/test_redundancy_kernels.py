"""Each kernel of the instruments' redundancy by itself: rotation matrices, a table of sensitivities, sums."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beaver_ftc.diagnosis import redundancy
from beaver_ftc.diagnosis.watch import (
    AIRSPEED,
    ALPHA,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    PRESSURE,
    PSI,
    QDYN,
    RPM,
    SPEED,
    STEP,
    TEST,
    THETA,
    TURN,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI

H, GRAVITY, DRIFT, GUST, SIZE = 0.02, 9.8, 2e-4, 0.7, 11.0
FLOWS = (ALPHA_FLOW, BETA_FLOW)


def as_rotation(angles):
    return Rotation.from_euler("ZYX", angles[::-1])


def reading(
    rates=(0.1, -0.2, 0.05), alpha=0.1, beta=-0.06, V=45.0, attitude=(0.4, 0.25, -1.1), altitude=900.0
):
    signal = np.zeros(N_SENSORS)
    signal[:3], signal[3:6], signal[QDYN] = rates, (alpha, beta, V), 0.5 * 1.1 * V * V
    signal[PHI : PHI + 3], signal[ALTITUDE] = attitude, altitude
    signal[ENGINE_SPEED], signal[MANIFOLD] = 1800.0, 20.0
    return signal


def new_step():
    step = np.zeros(1, STEP)[0]
    step["h"], step["gravity"], step["drift"], step["gust"], step["size"] = H, GRAVITY, DRIFT, GUST, SIZE
    return step


def velocity_of(signal):
    """Incidence is atan(w / u), sideslip asin(v / V)."""
    sideways = signal[AIRSPEED] * np.sin(signal[BETA])
    ahead = np.sqrt(signal[AIRSPEED] ** 2 - sideways**2)
    return np.array([ahead * np.cos(signal[ALPHA]), sideways, ahead * np.sin(signal[ALPHA])])


@pytest.mark.parametrize("seed", range(4))
def test_a_look_keeps_attitude_velocity_and_acceleration(seed):
    rng = np.random.default_rng(seed)
    signal = reading(
        attitude=rng.uniform(-1.2, 1.2, 3), alpha=rng.uniform(-0.3, 0.3), beta=rng.uniform(-0.3, 0.3)
    )
    step, force = new_step(), rng.normal(size=3)
    redundancy.look(step, signal, force)
    rotation = as_rotation(signal[PHI : PHI + 3])
    kept = Rotation.from_quat([*step["turned"][1:], step["turned"][0]])
    acceleration = force + rotation.inv().apply([0, 0, GRAVITY])
    assert (kept.inv() * rotation).magnitude() < 1e-14
    assert step["then"] == pytest.approx(signal)
    assert step["velocity"] == pytest.approx(velocity_of(signal), rel=1e-12)
    assert step["acceleration"] == pytest.approx(acceleration, rel=1e-12)
    assert step["size"] == pytest.approx(np.linalg.norm(acceleration))


@pytest.mark.parametrize("seed", range(4))
def test_a_prediction_turns_attitude_and_velocity_by_the_rates(seed):
    """Velocity by Adams and Bashforth's second order, then seen from axes that have turned."""
    rng = np.random.default_rng(seed)
    signal = reading(attitude=rng.uniform(-1.0, 1.0, 3), rates=rng.uniform(-0.5, 0.5, 3))
    step, before = new_step(), rng.normal(size=3)
    redundancy.look(step, signal, rng.normal(size=3))
    step["acceleration_then"], now = before, step["acceleration"].copy()
    redundancy.predict(step)
    size = np.linalg.norm(signal[:3])
    by = Rotation.from_rotvec(signal[:3] / size * 2.0 * np.arctan(0.5 * H * size))
    attitude = (as_rotation(signal[PHI : PHI + 3]) * by).as_euler("ZYX")[::-1]
    v = by.inv().apply(velocity_of(signal) + H * (1.5 * now - 0.5 * before))
    predicted = step["predicted"]
    assert predicted[PHI : PHI + 3] == pytest.approx(attitude, abs=1e-13)
    assert step["velocity"] == pytest.approx(v, rel=1e-12)
    assert step["acceleration_then"] == pytest.approx(by.inv().apply(now), rel=1e-12)
    assert predicted[AIRSPEED] == pytest.approx(np.linalg.norm(v))
    assert predicted[ALPHA] == pytest.approx(np.arctan(v[2] / v[0]))
    assert predicted[BETA] == pytest.approx(np.arcsin(v[1] / np.linalg.norm(v)))
    sinking = as_rotation(signal[PHI : PHI + 3]).apply(velocity_of(signal))[2]
    assert predicted[ALTITUDE] == pytest.approx(900.0 - H * sinking, rel=1e-12)


def test_axes_that_do_not_turn_leave_a_vector_as_it_is():
    out = np.zeros(3)
    redundancy.turn_back(np.zeros(3), H, np.array([1.0, -2.0, 3.0]), out)
    assert out == pytest.approx([1.0, -2.0, 3.0])


@pytest.mark.parametrize("angle", [-7.0, -3.2, -3.1, 0.0, 0.4, 3.1, 3.2, 6.5])
def test_an_angle_is_brought_within_half_a_turn(angle):
    assert redundancy.wrapped(angle) == pytest.approx(np.arctan2(np.sin(angle), np.cos(angle)))


def compared(now, signal, predicted, then):
    step = new_step()
    redundancy.quaternion(*now, step["now"])
    step["predicted"], step["then"] = predicted, then
    redundancy.compare(step, signal)
    return step["test"]["residual"].copy()


def test_residuals_are_readings_less_predictions():
    now, turned = np.array([0.4, 0.25, -1.1]), Rotation.from_rotvec([1e-4, -2e-4, 3e-4])
    attitude = (as_rotation(now) * turned).as_euler("ZYX")[::-1]
    signal, predicted, then = reading(attitude=attitude), reading(), reading()
    predicted[[AIRSPEED, ALPHA, BETA, ALTITUDE]] -= 0.3, 0.01, -0.02, 4.0
    predicted[PHI : PHI + 3] = now + 2.0 * np.pi * np.array([0, 0, 1])
    then[[QDYN, AIRSPEED]] = 1000.0, 40.0
    residual = compared(now, signal, predicted, then)
    assert residual[TURN : TURN + 3] == pytest.approx([1e-4, -2e-4, 3e-4], rel=1e-6)
    assert residual[ANGLE : ANGLE + 3] == pytest.approx(attitude - now, abs=1e-14)
    assert residual[[SPEED, ALPHA_FLOW, BETA_FLOW, CLIMB]] == pytest.approx([0.3, 0.01, -0.02, 4.0])
    denser = (signal[QDYN] / signal[AIRSPEED] ** 2) / (1000.0 / 1600.0)
    assert residual[DENSITY] == pytest.approx(np.log(denser))


def test_a_pressure_that_is_gone_shows_and_stays_finite():
    signal, then = reading(), reading()
    signal[QDYN] = 0.0
    dense = then[QDYN] / then[AIRSPEED] ** 2
    assert compared((0, 0, 0), signal, reading(), then)[DENSITY] == pytest.approx(np.log(1e-9 / dense))
    assert compared((0, 0, 0), then, reading(), signal)[DENSITY] == pytest.approx(np.log(dense / 1e-9))


@pytest.mark.parametrize(("pitch", "steep"), [(1.29, False), (-1.29, False), (1.31, True), (-1.31, True)])
def test_near_the_vertical_roll_and_heading_are_not_compared(pitch, steep):
    residual = compared((0.1, pitch, 0.2), reading(attitude=(0.12, pitch, 0.23)), reading(), reading())
    assert (not residual[:SPEED].any()) == steep
    assert residual[SPEED:].shape == (7,)


def test_an_attitude_and_its_opposite_quaternion_are_the_same():
    one, other = np.zeros(4), np.zeros(4)
    redundancy.quaternion(0.1, 0.2, 3.1, one)
    redundancy.quaternion(0.1, 0.2, 3.1001, other)
    near = [redundancy.angle_between(one, other, axis) for axis in (1, 2, 3)]
    assert [redundancy.angle_between(one, -other, axis) for axis in (1, 2, 3)] == pytest.approx(near)
    assert np.linalg.norm(near) == pytest.approx(1e-4, rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_the_rotation_between_two_attitudes_takes_the_short_way(seed):
    """Twice the vector part of one's inverse times the other, its scalar part made positive."""
    one, other = Rotation.from_quat(np.random.default_rng(seed).normal(size=(2, 4)))
    between = (one.inv() * other).as_quat(canonical=True)
    scalar_first = [np.roll(turn.as_quat(), 1) for turn in (one, other)]
    for side in (1.0, -1.0):
        found = [
            redundancy.angle_between(scalar_first[0], side * scalar_first[1], axis) for axis in (1, 2, 3)
        ]
        assert found == pytest.approx(2.0 * between[:3])


SIGNAL = reading()
TURNING = 0.1 + 0.2 + 0.05
LEVEL = 1.0 / np.cos(0.25)
V = 45.0


def allowed(error=(), changing=(), signal=SIGNAL, **fields):
    """(rate, noise, air) (13,) of the tests, given errors {sensor: size}."""
    step = new_step()
    step["then"] = SIGNAL
    for name, value in fields.items():
        step[name] = value
    for of, sizes in (("error", error), ("changing", changing)):
        for sensor, size in dict(sizes).items():
            step[of][sensor] = size
    redundancy.allow(step, signal)
    return tuple(step["test"][name].copy() for name in ("rate", "noise", "air"))


def test_with_exact_instruments_the_bounds_are_those_of_the_earth_and_the_air():
    rate, noise, air = allowed()
    expected = np.zeros(13)
    expected[TURN : TURN + 3] = redundancy.TURNING_RAD_S + DRIFT
    expected[ANGLE : ANGLE + 3] = LEVEL * redundancy.TURNING_RAD_S + DRIFT
    expected[SPEED], expected[list(FLOWS)] = redundancy.FALLING_M_S2, redundancy.FALLING_M_S2 / V
    expected[DENSITY], expected[CLIMB] = V / redundancy.DENSITY_HEIGHT_M, redundancy.CLIMBING_M_S + GUST
    assert rate == pytest.approx(expected, rel=1e-12)
    assert not noise.any()
    assert air[[SPEED, *FLOWS]] == pytest.approx([1.0, 1 / V, 1 / V])
    assert not np.delete(air, [SPEED, *FLOWS]).any()


# What an error of 1 of a sensor adds to a residual in a second: {sensor: {test: rate}}.
_ROTATES = dict.fromkeys((0, 1, 2), 2.0 * TURNING) | dict.fromkeys((3, 4, 5), 2.0 * LEVEL**2 * TURNING)
_FALLS = {SPEED: GRAVITY, ALPHA_FLOW: GRAVITY / V, BETA_FLOW: GRAVITY / V}
_VANE = {SPEED: SIZE, ALPHA_FLOW: SIZE / V + TURNING, BETA_FLOW: SIZE / V + TURNING, CLIMB: V}
SENSITIVITY = {
    **{
        gyro: {TURN + gyro: 1.0} | dict.fromkeys((3, 4, 5), LEVEL) | dict.fromkeys(FLOWS, 1.0)
        for gyro in range(3)
    },
    PHI: _ROTATES | _FALLS | {CLIMB: V},
    THETA: _ROTATES | _FALLS | {CLIMB: V},
    PSI: _ROTATES | {CLIMB: V},
    ALPHA: _VANE,
    BETA: _VANE,
    AIRSPEED: dict.fromkeys(FLOWS, SIZE / V**2) | {CLIMB: 1.0},
    QDYN: {},
    ALTITUDE: {},
    **{AX + i: {SPEED: 2.0, ALPHA_FLOW: 2.0 / V, BETA_FLOW: 2.0 / V} for i in range(3)},
}
# What a change of 1 of an error adds to a residual at once.
TILTED, BANKED = np.sin(0.25) + TURNING * H, np.sin(0.4) + TURNING * H
AT_ONCE = {
    0: {},
    PHI: {TURN: 1.0, ANGLE: 1.0},
    THETA: {TURN + 1: 1.0, ANGLE + 1: 1.0, TURN + 2: BANKED},
    PSI: {TURN + 2: 1.0, ANGLE + 2: 1.0, TURN: TILTED, TURN + 1: BANKED},
    ALPHA: {ALPHA_FLOW: 1.0},
    BETA: {BETA_FLOW: 1.0},
    AIRSPEED: {SPEED: 1.0, DENSITY: 2.0 / V},
    QDYN: {DENSITY: 1.0 / SIGNAL[QDYN]},
    ALTITUDE: {CLIMB: 1.0},
}


@pytest.mark.parametrize("sensor", SENSITIVITY)
def test_an_error_widens_the_bounds_of_the_tests_it_moves(sensor):
    none, rate = allowed()[0], allowed({sensor: 1e-3})[0]
    expected = [1e-3 * SENSITIVITY[sensor].get(test, 0.0) for test in range(13)]
    assert rate - none == pytest.approx(expected, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("sensor", AT_ONCE)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_changing_error_shows_at_once_in_the_tests_it_moves(sensor, side):
    signal = SIGNAL * np.where(np.arange(N_SENSORS) >= PHI, side, 1.0)
    noise = allowed(changing={sensor: 1e-3}, signal=signal)[1]
    expected = [1e-3 * AT_ONCE[sensor].get(test, 0.0) for test in range(13)]
    assert noise == pytest.approx(expected, rel=1e-9, abs=1e-14)


def test_bounds_stay_finite_where_nothing_flows_and_the_nose_is_up():
    signal = SIGNAL.copy()
    signal[AIRSPEED] = signal[QDYN] = 0.5
    signal[THETA] = 1.55
    rate, noise, air = allowed(changing={QDYN: 1e-3}, signal=signal)
    assert air[ALPHA_FLOW] == 1.0
    assert noise[DENSITY] == pytest.approx(1e-3)
    assert rate[ANGLE] == pytest.approx(redundancy.TURNING_RAD_S / 0.1 + DRIFT)


def test_a_declared_error_is_of_the_reading_and_what_is_steady_does_not_change():
    """|reading - truth| <= offset + slope |truth|, and |truth| <= (|reading| + offset) / (1 - slope)."""
    step, signal = new_step(), np.full(N_SENSORS, -8.0)
    step["offset"], step["slope"], step["steady"] = 0.3, 0.1, 0.25
    redundancy.note_declared(step, signal)
    truth = (8.0 + 0.3) / 0.9
    assert step["error"] == pytest.approx(truth - 8.0)
    assert step["changing"] == pytest.approx(truth - 8.0 - 0.25 + 8e-10, rel=1e-12)


def test_filters_sum_what_was_with_what_each_pole_keeps():
    rng, frames = np.random.default_rng(2), 30
    test, step = np.zeros(1, TEST)[0], new_step()
    step["decay"] = keep = np.array([0.0, 0.8, 0.97])
    step["gusts"], test["air"] = [0.1, 0.2, 0.3], 0.5
    residual, rate, noise = rng.normal(size=frames), rng.uniform(1, 2, frames), rng.uniform(1, 2, frames)
    for k in range(frames):
        test["residual"], test["rate"], test["noise"] = residual[k], rate[k], noise[k]
        redundancy.follow(step, test)
    weight = keep[:, None] ** np.arange(frames)[::-1]
    filtered = weight @ residual
    changes = (1.0 - keep) * (weight[:, 1:] @ noise[:-1]) + noise[-1]
    bound = H * weight @ rate + changes + 0.5 * np.array([0.1, 0.2, 0.3])
    assert test["filtered"] == pytest.approx(filtered)
    assert test["bound"] == pytest.approx(bound)
    assert test["share"] == pytest.approx(np.max(np.abs(filtered) / bound))
    assert test["noise_then"] == noise[-1]


@pytest.mark.parametrize("engine", [False, True])
def test_a_whole_look_finds_sound_instruments_sound_and_a_wrong_one_wrong(engine):
    step, signal = new_step(), reading(rates=np.zeros(3), attitude=(0, 0.1, 0))
    step["decay"] = [0.0, 0.8, 0.97]
    step["command"], step["offset"][ENGINE_SPEED], step["offset"][MANIFOLD] = (1700.0, 20.5), 10.0, 0.25
    redundancy.look(step, signal, np.array([GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1)]))
    step["test"]["bound_noise"] = 1e-6
    redundancy.check(step, signal, engine)
    assert (step["test"]["share"][:CLIMB] < 1.0).all()
    # 100 rpm too fast where 10 are declared, 0.5 inHg too low where a quarter is
    shares = step["test"]["share"][[RPM, PRESSURE]]
    assert shares == pytest.approx([10.0, 2.0] if engine else [0.0, 0.0], rel=1e-5)
    assert step["test"]["residual"][[RPM, PRESSURE]] == pytest.approx([100.0, -0.5] if engine else [0, 0])


def test_a_reading_that_jumps_fails_its_own_test():
    step, signal = new_step(), reading(rates=np.zeros(3), attitude=(0, 0.1, 0))
    redundancy.look(step, signal, np.array([GRAVITY * np.sin(0.1), 0.0, -GRAVITY * np.cos(0.1)]))
    signal[ALTITUDE] += 5.0
    redundancy.check(step, signal, False)
    assert np.flatnonzero(step["test"]["share"] > 1.0).tolist() == [CLIMB]


def test_no_air_of_the_standard_atmosphere_thins_faster_than_the_bound_has_it():
    """Density (1 - 2.25577e-5 h)^4.2559 [ISA]: its logarithm falls fastest high up."""
    height = np.arange(0.0, 8000.0)
    falls = 4.2559 * 2.25577e-5 / (1.0 - 2.25577e-5 * height)
    assert falls.max() < 1.0 / redundancy.DENSITY_HEIGHT_M < 1.3 * falls.max()
