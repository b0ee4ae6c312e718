"""What vanes and airspeed know of the air's rotation, against the same flight in the Earth's axes."""

import numpy as np
import pytest
from kernels import fill, holder
from scipy.spatial.transform import Rotation

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.design.model import design_record, fill_table, response
from beaver_ftc.diagnosis import bounds, gusts
from beaver_ftc.diagnosis.gusts import GUST_RECORD
from beaver_ftc.scenario.declared import SensorErrors
from beaver_ftc.scenario.sensors import Sensors

AIRCRAFT = load()
SPAN, SCALE, ROLLING, GRAVITY, DT = AIRCRAFT.geometry.span_m, 40.0, 30.0, 9.8, 0.02
DOWN = np.array([0.0, 0.0, GRAVITY])
X, U = np.array([0.1, -0.05, 0.07]), np.array([0.1, -0.15, 0.05, 0.2])
Y = np.array([0.1, 0.03, 45.0, 1036.0, 0.3, 0.0, 0.0, 0.0])


def new_air(**fields):
    record = np.zeros(1, GUST_RECORD).view(np.recarray)[0]
    (
        record["config"]["wing_span"],
        record["config"]["gravity"],
        record["output"]["accounts_for_gusts"],
        record["output"]["is_gust_measured"],
    ) = SPAN, GRAVITY, 1, 1
    record["config"]["turbulence_scale_length"], record["config"]["rolling_gust_correlation_length"] = (
        SCALE,
        ROLLING,
    )
    return fill(record, **fields)


def to_earth(attitude):
    return Rotation.from_euler("ZYX", np.asarray(attitude)[::-1])


def vanes(velocity):
    """(alpha, beta, V, ...) of a velocity through the air in body axes."""
    V = np.linalg.norm(velocity)
    return np.array([np.arctan2(velocity[2], velocity[0]), np.arcsin(velocity[1] / V), V, 1000.0, 0, 0, 0, 0])


class Flight:
    """Velocity of the aircraft and of the air in axes that stay with the Earth, an instant at a time."""

    def __init__(self, seed, turn_rad=0.06, climb_rad=0.02):
        self.rng = np.random.default_rng(seed)
        self.attitude = self.rng.uniform(-0.3, 0.3, 3)
        self.attitude[2] = np.pi + self.rng.uniform(-0.01, 0.01)  # where the heading wraps
        self.steps = np.array([climb_rad, climb_rad, turn_rad])
        self.velocity = to_earth(self.attitude).apply([45.0, 1.0, 3.0])
        self.wind, self.before = self.rng.normal(size=3), None

    def reading(self):
        attitude = self.attitude.copy()
        attitude[2] = np.angle(np.exp(1j * attitude[2]))
        return vanes(to_earth(self.attitude).inv().apply(self.velocity - self.wind)), attitude

    def step(self):
        """The force, m/s2 in body axes, of the step to the next instant."""
        pulled = 10.0 * self.rng.normal(size=3)
        force = to_earth(self.attitude).inv().apply(pulled - DOWN)
        before = pulled if self.before is None else self.before
        self.velocity = self.velocity + DT * (1.5 * pulled - 0.5 * before)
        self.before = pulled
        self.attitude = self.attitude + self.steps * self.rng.uniform(-1.0, 1.0, 3)
        self.wind = self.wind + self.rng.normal(size=3)
        return force


@pytest.mark.parametrize("seed", range(4))
def test_the_gust_followed_is_the_airs_own_change(seed):
    """Whatever aircraft and heading do: each lag keeps its share, and the change of the air's velocity, seen
    from the level axes of now, is added."""
    flight, record = Flight(seed), new_air()
    gusts.start_gust_estimate(record, *flight.reading())
    pitching = yawing = 0.0
    for _ in range(6):
        wind, axes_then = flight.wind, record["output"]["gust_axes_in_body"].copy()
        psi_then = flight.attitude[2]
        record["memory"]["specific_force"] = flight.step()
        y, attitude = flight.reading()
        gusts.advance_gust_estimate(record, y, attitude, DT)
        change = Rotation.from_euler("z", -flight.attitude[2]).apply(flight.wind - wind)
        tau_q, tau_r = 4.0 * SPAN / (np.pi * y[2]), 3.0 * SPAN / (np.pi * y[2])
        pitching = np.exp(-DT / tau_q) * pitching + change[2] / (y[2] * tau_q)
        yawing = np.exp(-DT / tau_r) * yawing + change[1] / (y[2] * tau_r)
        assert record["memory"]["air_rotation_in_level_axes"] == pytest.approx([0.0, pitching, yawing])
        # The axes of the gusts: level, along the heading of the instant before.
        axes = (to_earth(flight.attitude).inv() * Rotation.from_euler("z", psi_then)).as_matrix()
        assert record["output"]["gust_axes_in_body"] == pytest.approx(axes)
        assert record["memory"]["gust_axes_rate"] == pytest.approx((axes - axes_then) / DT)


@pytest.mark.parametrize(("turn_rad", "swings"), [(1e-3, False), (0.1, True)])
def test_axes_swing_where_a_gust_that_keeps_its_size_would_be_seen_to_change(turn_rad, swings):
    flight, record = Flight(1, 0.0, 0.0), new_air()
    gusts.start_gust_estimate(record, *flight.reading())
    flight.attitude[1] = 0.0
    for _ in range(3):
        record["memory"]["specific_force"] = flight.step()
        flight.attitude[1] += turn_rad
        y, attitude = flight.reading()
        gusts.advance_gust_estimate(record, y, attitude, DT)
    fastest = turn_rad / DT  # nearly: a little less where the axis is not square to what turns it
    walk = 0.5 * (fastest * ROLLING / y[2]) ** 2
    assert (
        not 0.8 * gusts.MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN
        < walk
        < 1.3 * gusts.MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN
    )
    assert (
        bool(record["memory"]["has_fast_axes_turn"])
        == swings
        == (walk > gusts.MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN)
    )


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_the_fastest_swing_decides(share):
    record = new_air(gust_axes_in_body=np.eye(3))
    most = np.sqrt(2.0 * gusts.MIN_INTENSITY_SHARE_OF_FAST_AXES_TURN) * 45.0 / ROLLING
    record["memory"]["gust_axes_rate"] = np.eye(3)
    record["memory"]["gust_axes_rate"][1, 2] = share * most * DT
    record["memory"]["gust_axes_rate"][0, 0] += 0.5 * most * DT
    gusts.fill_axes_rate_and_fast_turn(record, DT, 45.0)
    assert record["memory"]["gust_axes_rate"][1, 2] == pytest.approx(-share * most)
    assert record["memory"]["has_fast_axes_turn"] == (share > 1.0)


def test_a_yawing_gust_that_turning_hides_fades_and_its_loss_fades_with_it():
    """One fast turn: for that instant and the next nothing is added, and what is lost then decays."""
    record, y = new_air(), np.array([0.0, 0.0, 45.0, 1000.0, 0, 0, 0, 0])
    level = np.zeros(3)
    gusts.start_gust_estimate(record, y, level)
    record["memory"]["specific_force"], record["memory"]["air_rotation_in_level_axes"] = (
        (0.0, 0.0, -GRAVITY),
        (0.0, 0.0, 0.05),
    )
    tau_r, lag = 3.0 * SPAN / (np.pi * 45.0), np.exp(-DT / (3.0 * SPAN / (np.pi * 45.0)))
    enough = np.sqrt(np.pi * 45.0**2 / (SPAN * SCALE))  # rad/s at which all of it is lost
    turn = 1.1 * enough * DT
    for attitude, gust, turning in (
        ((0, 0, turn), 0.05 * lag, 1.0),
        ((0, 0, turn), 0.05 * lag**2, 1.0),
        ((0, 0, turn), 0.05 * lag**3, lag),
        ((0, 0, turn), 0.05 * lag**4, lag**2),
    ):
        gusts.advance_gust_estimate(record, y, np.array(attitude), DT)
        assert record["memory"]["air_rotation_in_level_axes"][2] == pytest.approx(gust)
        assert record["memory"]["unmeasured_yawing_share_by_past_turns"] == pytest.approx(turning)
        record["memory"]["specific_force"] = 0.0, 0.0, -GRAVITY
    part = 0.5 * enough * DT
    gusts.advance_gust_estimate(record, y, np.array([0, 0, turn + part]), DT)
    assert record["memory"]["unmeasured_yawing_share_by_turn_now"] == pytest.approx(0.25)
    assert record["memory"]["unmeasured_yawing_share_by_past_turns"] == pytest.approx(max(lag**3, 0.25))
    aside = 45.0 * np.sin(part)  # of the old course, from the left: a gust from the right has come up
    assert record["memory"]["air_rotation_in_level_axes"][2] == pytest.approx(
        0.05 * lag**5 - aside / (45.0 * tau_r)
    )


@pytest.mark.parametrize("late", [False, True])
def test_a_heading_that_turns_round_as_the_nose_passes_the_vertical_is_no_gust(late):
    """The turbulence turns with the heading: air from ahead, and a little from aside, turns round at once."""
    record = new_air()
    still, gust = np.array([45.0, 0.0, 0.0]), np.array([3.0, 1.0, 0.0])  # m/s; straight down, and level axes
    then, over = np.array([0.0, -1.56, 0.3]), np.array([np.pi, -1.56, 0.3 + np.pi])

    def look(attitude, turned):  # nothing accelerates
        level = to_earth((*attitude[:2], 0.0)).inv()
        return vanes(still - level.apply(gust * turned)), level.apply(
            [0.0, 0.0, -GRAVITY]
        )  # nothing accelerates

    y, record["memory"]["specific_force"] = look(then, 1)
    gusts.start_gust_estimate(record, y, then)
    record["memory"]["air_rotation_in_level_axes"][2] = 0.05
    if late:  # the wind turns a step after the heading
        y, force = look(over, [-1, -1, 1])
        gusts.advance_gust_estimate(record, y, over, DT)
        record["memory"]["specific_force"] = force
    gusts.advance_gust_estimate(record, look(over, 1)[0], over, DT)
    assert abs(record["memory"]["air_rotation_in_level_axes"][2]) <= 0.05
    unseen, record["memory"]["unmeasured_intensity_share"] = (
        np.array(record["memory"]["unmeasured_intensity_share"]),
        np.ones(3),
    )
    record["output"]["rate_damping"] = np.diag([0.0, 0.0, 5.0]) @ record["output"]["gust_axes_in_body"].T
    everything = gusts.unmeasured_gust_drift_intensity(record, 45.0, 2, 2)
    record["memory"]["unmeasured_intensity_share"] = unseen
    assert gusts.unmeasured_gust_drift_intensity(record, 45.0, 2, 2) == pytest.approx(everything)


@pytest.mark.parametrize("seed", range(3))
def test_level_axes_are_a_rotation(seed):
    phi, theta = np.random.default_rng(seed).uniform(-1.4, 1.4, 2)
    turn, body = np.full((3, 3), 9.0), np.random.default_rng(seed + 10).normal(size=3)
    gusts.fill_level_to_body_rotation(phi, theta, turn)
    of_level = to_earth((phi, theta, 0.0))
    assert turn == pytest.approx(of_level.inv().as_matrix(), abs=1e-15)
    assert [gusts.component_in_level_axes(turn, body, i) for i in range(3)] == pytest.approx(
        of_level.apply(body)
    )


def test_a_diagnosis_that_begins_in_flight_has_seen_no_gust():
    flight = Flight(3)
    record = new_air(
        has_acceleration_before=1,
        unmeasured_yawing_share_by_turn_now=0.4,
        unmeasured_yawing_share_by_past_turns=0.3,
        air_rotation_in_level_axes=(0.1, 0.2, 0.3),
    )
    gusts.start_gust_estimate(record, *flight.reading())
    assert (
        record["memory"]["has_acceleration_before"],
        record["memory"]["unmeasured_yawing_share_by_turn_now"],
        record["memory"]["unmeasured_yawing_share_by_past_turns"],
    ) == (
        0,
        0.0,
        0.0,
    )
    assert not record["memory"]["air_rotation_in_level_axes"].any()
    assert record["output"]["gust_axes_in_body"] == pytest.approx(record["memory"]["level_to_body"])
    through = Rotation.from_euler("z", -flight.attitude[2]).apply(flight.velocity - flight.wind)
    assert record["memory"]["air_relative_velocity"] == pytest.approx(through)


def without_inertia(design):
    """A copy of the design model whose rates act through the air alone."""
    still = design.copy()
    for name in ("Ppq", "Pqr", "Qpp", "Qpr", "Qrr", "Rpq", "Rqr"):
        still[name] = 0.0
    return still


def test_what_a_gust_does_is_what_the_opposite_rates_would():
    """By differences of the design model's own response, whose inertia terms the air knows nothing of."""
    design = design_record().view(np.recarray)
    record = new_air(wing_area_per_mass=0.01)
    fill_table(record["memory"]["force_table"], AIRCRAFT, AIRCRAFT.measurable_forces, FORCES)
    gusts.start_gust_estimate(record, Y, np.array([0.3, 0.2, 1.0]))
    record["memory"]["air_rotation_in_level_axes"] = 0.0, 0.02, -0.03
    gusts.fill_gust_effect_and_specific_force(record, design[0], X, Y, U)
    rotation = to_earth((0.3, 0.2, 0.0)).inv().apply([0.0, 0.02, -0.03])
    assert record["memory"]["air_rotation_in_body_axes"] == pytest.approx(rotation)

    def acceleration(x):
        f, G = np.zeros(3), np.zeros((3, 4))
        response(without_inertia(design)[0], x, Y, f, G)
        return f + G @ U

    step = 1e-6
    expected = (acceleration(X - step * rotation) - acceleration(X + step * rotation)) / (2.0 * step)
    assert record["output"]["angular_acceleration_by_gust"] == pytest.approx(expected, rel=1e-6)
    gusts.fill_gust_effect_and_specific_force(record, design[0], X, Y, U)
    gusts.begin_gust_sums_with_instant(record, 45.0, 0.01)
    record["output"]["angular_acceleration_by_gust"] = 0.0
    assert record["memory"]["angular_acceleration_by_gust_sum"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("fields", "force"),
    [
        ({"uses_accelerometers": 1, "has_only_coarse_estimate": 1}, (1.0, -2.0, -9.0)),
        ({"has_only_coarse_estimate": 1, "is_gust_measured": 0}, (0.0, 0.0, -GRAVITY / 0.8)),
        ({"has_only_coarse_estimate": 1, "is_gust_measured": 0, "steep": 0.3}, (0.0, 0.0, -GRAVITY / 0.5)),
    ],
)
def test_the_force_is_as_measured_or_the_lift_of_this_bank_and_a_coarse_gust_is_counted_apart(fields, force):
    design = design_record().view(np.recarray)
    record = new_air(**{name: value for name, value in fields.items() if name != "steep"})
    gusts.store_accelerometer_reading(record, np.array([1.0, -2.0, -9.0]))
    record["memory"]["level_to_body"][2, 2] = fields.get("steep", 0.8)
    record["memory"]["air_rotation_in_level_axes"] = 9.0, 0.02, -0.03
    record["output"]["gust_axes_in_body"] = [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]
    gusts.fill_gust_effect_and_specific_force(record, design[0], X, Y, U)
    assert record["memory"]["specific_force"] == pytest.approx(force)
    rotation = np.array([[0.2, 0.3], [0.5, 0.6], [0.8, 0.9]]) @ [0.02, -0.03]
    effect, none = -record["output"]["rate_damping"] @ rotation, np.zeros(3)
    found = [record["output"][f"angular_acceleration_by_{name}"] for name in ("gust", "coarse_gust")]
    is_measured = fields.get("is_gust_measured", 1)
    assert np.array(found) == pytest.approx(np.array([effect, none] if is_measured else [none, effect]))


@pytest.mark.parametrize(("measured", "model", "unknown"), [(1, 0, True), (1, 1, False), (0, 0, False)])
def test_without_accelerometers_and_a_model_of_the_forces_all_of_the_gust_is_unknown(
    measured, model, unknown
):
    """Its variance is V sigma2 / 2 times the lag's length; the rolling gust was unknown before."""
    rng, intensity = np.random.default_rng(3), np.array([1e-3, 2e-3, 3e-3])
    record = new_air(uses_accelerometers=1, is_gust_measured=measured, has_force_model=model)
    output, memory = record["output"], record["memory"]
    output["rate_damping"], output["gust_axes_in_body"] = rng.normal(size=(2, 3, 3))
    memory["gust_rotation_intensity_per_airspeed"] = intensity
    memory["unmeasured_intensity_share"] = share = np.array([0.1, 0.2, 0.3])
    before = memory["acceleration_variance_by_axes_turn_now"][:] = rng.normal(size=(3, 3))
    gusts.stop_using_accelerometers(record)
    lengths_m = np.array([0.0, 4.0 * SPAN / np.pi, 3.0 * SPAN / np.pi])
    effect = output["rate_damping"] @ output["gust_axes_in_body"]
    added = effect @ np.diag(0.5 * lengths_m * intensity) @ effect.T
    assert memory["acceleration_variance_by_axes_turn_now"] == pytest.approx(before + unknown * added)
    assert memory["n_frames_left_with_axes_turn_variance"] == 3 * unknown
    assert memory["unmeasured_intensity_share"] == pytest.approx(np.ones(3) if unknown else share)
    assert (output["uses_accelerometers"], output["is_gust_measured"]) == (0, measured and not unknown)


def test_what_an_earlier_diagnosis_kept_is_gone_when_one_begins():
    kept = dict.fromkeys(
        (
            "air_rotation_in_level_axes",
            "has_acceleration_before",
            "unmeasured_yawing_share_by_turn_now",
            "unmeasured_yawing_share_by_past_turns",
            "acceleration_variance_by_axes_turn_now",
            "acceleration_variance_by_axes_turn_before",
            "acceleration_variance_by_axes_turn",
            "n_frames_left_with_axes_turn_variance",
        ),
        1,
    )
    record = new_air(**kept)
    gusts.start_gust_estimate(record, Y, np.array([0.3, 0.2, 1.0]))
    assert {name for name in kept if np.any(holder(record, name)[name])} == set()


@pytest.mark.parametrize(("angle", "axis"), [("phi", None), ("theta", 1), ("psi", 2)])
def test_the_noise_of_an_attitude_is_in_the_gust_that_is_followed(angle, axis):
    """Counted in steady flight through still air: pitch attitude and heading turn the flow as
    vanes do, a bank by what stands across it."""
    std_deg, rng, place = 0.2, np.random.default_rng(5), ("phi", "theta", "psi").index(angle)
    sensors = Sensors.model_validate({angle: {"noise_std_deg": std_deg}})
    alpha = 0.15
    y, level = np.array([alpha, 0.0, 45.0, 1036.0, 0.3, 0.0, 0.0, 0.0]), np.array([0.0, alpha, 1.0])
    record, seen = new_air(), []
    gusts.start_gust_estimate(record, y, level)
    for _ in range(4000):
        record["memory"]["specific_force"] = -GRAVITY * np.array([-np.sin(alpha), 0.0, np.cos(alpha)])
        blurred = level.copy()
        blurred[place] += np.radians(std_deg) * rng.normal()
        gusts.advance_gust_estimate(record, y, blurred, DT)
        seen.append(record["memory"]["air_rotation_in_level_axes"].copy())
    lags = np.array([4.0, 3.0]) * SPAN / (np.pi * 45.0)
    counted, reckoned = (
        np.std(seen, axis=0)[1:] * lags,
        bounds.flow_angle_in_level_axes_noise_std(SensorErrors(sensors), 45.0),
    )
    assert (counted <= 1.02 * reckoned).all()
    if axis is not None:
        assert counted[axis - 1] == pytest.approx(reckoned[axis - 1], rel=0.05)
