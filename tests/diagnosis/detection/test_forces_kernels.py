"""What accelerometers say of the surfaces, a kernel at a time, against sums, differences and draws."""

import numpy as np
import pytest
from kernels import holder, new_fdi
from statistics_of import Across

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES, Aircraft
from beaver_ftc.aircraft.schema import SIDESLIP_RATE
from beaver_ftc.design.model import fill_table, slipstream_slopes
from beaver_ftc.diagnosis.detection import forces, parity, statistical
from beaver_ftc.diagnosis.detection.forces import (
    NORMAL_INDEX_AMONG_FORCES,
    SIDE_INDEX_AMONG_FORCES,
    configure_forces,
    update_all_force_innovations,
)
from beaver_ftc.diagnosis.detection.parity import (
    AXIS_VIEW,
    ORTHOGONAL_TO_VANE_ERROR,
    configure_parity_views,
    configure_tone_tests,
)
from beaver_ftc.diagnosis.state import NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.scenario.diagnosis import Bounds
from flying import declared_in
from telling import apart

AIRCRAFT = load()
ELEVATOR, FLAP = 1, 3
X, U = np.array([0.05, -0.03, 0.04]), np.array([0.06, -0.08, 0.05, 0.1])
Y = np.array([0.11, 0.07, 46.0, 1150.0, 2.1])
ALONG_Y = np.arange(15.0).reshape(3, 5)
DT, GRAVITY = 0.01, 9.80665
TILTED = np.radians(1.0) * GRAVITY / Y[2]
ROLL_VIEW = 1
ELEVATOR_VIEW, FLAP_VIEW, ALPHA_VIEW, UP_VIEW, AILERON_VIEW, RUDDER_VIEW, BETA_VIEW, SIDE_VIEW = range(5, 13)


def measured(x=X, y=Y, force=(0.5, 0.3, -9.5), attitude=(0.2, 0.15)):
    record = np.zeros(1, MEASURED).view(np.recarray)[0]
    record["x"], record["y"][:5], record["force"], record["attitude"][:2] = x, y, force, attitude
    return record


def felt(bounds=None, **declared_errors):
    """A diagnosis whose forces are set up at X, Y, U; admitted: errors of what the engine is told."""
    fdi = new_fdi()
    for name, value in declared_errors.items():
        fdi["bound"]["declared_errors"][name] = value
    statistical = fdi["statistical"]
    air = statistical["gust"]
    fill_table(air["memory"]["force_table"], AIRCRAFT, AIRCRAFT.measurable_forces, FORCES)
    air["config"]["wing_area_per_mass"], air["config"]["gravity"] = (
        AIRCRAFT.geometry.wing_area_m2 / AIRCRAFT.mass.mass_kg,
        GRAVITY,
    )
    air["config"]["turbulence_scale_length"], statistical["forces"]["in_use"] = 533.4, 1
    air["output"]["uses_accelerometers"] = 1
    configure_forces(fdi, declared_in(bounds or Bounds(), AIRCRAFT), (X, Y, U), ALONG_Y, DT)
    return fdi


def coefficient(name, x=X, y=Y, u=U, rate=0.0):
    size, V = AIRCRAFT.geometry, y[2]
    of = dict(zip(AIRCRAFT.surfaces, u, strict=True))
    of |= {"alpha": y[0], "beta": y[1], "dpt": y[4], "ph": x[0] * size.span_m / (2 * V)}
    of |= {"qh": x[1] * size.chord_m / V, "rh": x[2] * size.span_m / (2 * V)}
    return AIRCRAFT.coefficient(name, of | {SIDESLIP_RATE: rate * size.span_m / (2 * V)})


def per_coefficient(y=Y):
    return y[3] * AIRCRAFT.geometry.wing_area_m2 / AIRCRAFT.mass.mass_kg / AIRCRAFT.geometry.chord_m


@pytest.mark.parametrize(("f", "name"), [(SIDE_INDEX_AMONG_FORCES, "CY"), (NORMAL_INDEX_AMONG_FORCES, "CZ")])
def test_the_model_is_the_sum_of_its_terms_and_the_rest_is_the_innovation(f, name):
    fdi, rate = felt(), 0.04
    record, seen = fdi["statistical"]["forces"], measured()
    record["flow_angle_rate"][SIDE_INDEX_AMONG_FORCES], record["n_updates_capped_at_minimum"] = rate, 1
    update_all_force_innovations(record, fdi["statistical"]["gust"], seen, U, DT)
    whole = per_coefficient() * coefficient(name, rate=rate)
    force = record["component"][f]
    expected = seen["force"][1 + f] / AIRCRAFT.geometry.chord_m - whole
    assert force["innovation"] == pytest.approx(expected, rel=1e-12)
    n = int(force["n_regressors"])
    assert force["regressor"][n - 1] == pytest.approx(whole)
    values = [t.value for t in AIRCRAFT.measurable_forces if t.coefficient == name]
    values += [
        t.value
        for t in AIRCRAFT.forces
        if t.coefficient == "CY" and f == SIDE_INDEX_AMONG_FORCES and "betadoth" in dict(t.of)
    ]
    terms = force["regressor"][: n - 1]
    if f == SIDE_INDEX_AMONG_FORCES:
        terms = np.append(terms[:-1], terms[-1] / values[-1])
        assert terms[-1] == pytest.approx(per_coefficient() * rate * AIRCRAFT.geometry.span_m / (2 * Y[2]))
    assert np.dot(values, terms) == pytest.approx(whole)


@pytest.mark.parametrize(("f", "name"), [(SIDE_INDEX_AMONG_FORCES, "CY"), (NORMAL_INDEX_AMONG_FORCES, "CZ")])
def test_a_surface_s_column_is_the_slope_along_it_and_its_errors_are_shares_of_the_terms(f, name):
    fdi = felt(Bounds(coefficients=0.05))
    record = fdi["statistical"]["forces"]
    update_all_force_innovations(record, fdi["statistical"]["gust"], measured(), U, DT)
    force = record["component"][f]
    for s in range(4):
        ahead = U + 1e-4 * np.eye(4)[s]
        slope = per_coefficient() * (coefficient(name, u=ahead) - coefficient(name)) / 1e-4
        assert force["specific_force_over_chord_per_surface_rad"][s] == pytest.approx(slope, abs=1e-9)
        assert force["specific_force_over_chord_of_surface_at_command"][s] == pytest.approx(
            slope * U[s], abs=1e-9
        )
        own = [
            t
            for t in AIRCRAFT.measurable_forces
            if t.coefficient == name and t.surface == AIRCRAFT.surfaces[s]
        ]
        size = sum(
            abs(t.value) * Y[0] ** dict(t.of).get("alpha", 0) * Y[1] ** dict(t.of).get("beta", 0) for t in own
        )
        assert force["specific_force_over_chord_per_surface_rad_error_bound"][s] == pytest.approx(
            0.05 * per_coefficient() * size
        )


def test_the_flow_s_rates_are_those_of_a_body_that_moves_on():
    """The velocity through air at rest a moment later, by v' = a + g - x cross v."""
    record, a, phi, theta = felt()["statistical"]["forces"], np.array([0.5, 0.3, -9.5]), 0.2, 0.15
    forces.fill_flow_angle_rates(record, measured())
    alpha, beta, V = Y[:3]
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    g = GRAVITY * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    step = 1e-6
    later = v + step * (a + g - np.cross(X, v))
    now, then = (np.array([np.arcsin(w[1] / np.linalg.norm(w)), np.arctan2(w[2], w[0])]) for w in (later, v))
    assert record["flow_angle_rate"] == pytest.approx((now - then) / step, rel=1e-4)


@pytest.mark.parametrize(("f", "place"), [(SIDE_INDEX_AMONG_FORCES, 1), (NORMAL_INDEX_AMONG_FORCES, 0)])
def test_followed_by_inertial_motion_a_force_does_not_know_its_vane(f, place):
    """Whatever a vane says after the first frame, what is left of the force is the same but for curvature."""
    courses = np.zeros(30), np.append(0.0, np.random.default_rng(3).normal(0.0, 0.002, 29).cumsum())
    left = []
    for course in courses:
        fdi = felt()
        record = fdi["statistical"]["forces"]
        record["sideslip_rate_coefficient"] = 0.0
        for error in course:
            y = Y.copy()
            y[place] += error
            update_all_force_innovations(record, fdi["statistical"]["gust"], measured(y=y), U, DT)
        left.append(
            (
                record["component"][f]["innovation_at_inertial_flow_angle"],
                record["component"][f]["innovation"],
            )
        )
    (inertial, plain), (inertial_too, other) = left
    assert abs(plain - other) > 0.005
    assert abs(inertial - inertial_too) < 0.05 * abs(plain - other)


def test_the_angle_followed_is_the_sum_of_its_rates_and_its_drift_is_counted():
    fdi = felt()
    record = fdi["statistical"]["forces"]
    for _ in range(11):
        update_all_force_innovations(record, fdi["statistical"]["gust"], measured(), U, DT)
    for f, place in ((SIDE_INDEX_AMONG_FORCES, 1), (NORMAL_INDEX_AMONG_FORCES, 0)):
        force = record["component"][f]
        assert force["inertial_flow_angle"] == pytest.approx(
            Y[place] + 10 * DT * record["flow_angle_rate"][f]
        )
        assert force["innovation_per_flow_angle_drift"] == pytest.approx(
            11 * DT * force["axis_and_force_innovation_per_vane_error"][1]
        )


def test_noise_of_the_readings_is_jitter_of_the_forces():
    """Against the spread of e over readings that are drawn."""
    sensors = {
        "alpha": {"noise_std_deg": 0.03}, "beta": {"noise_std_deg": 0.02}, "V": {"noise_std_mps": 0.1},
        "qdyn": {"noise_std_pa": 4.0}, **{axis: {"noise_std_deg_s": 0.05} for axis in "pqr"},
    }  # fmt: skip
    fdi, rng = felt(Bounds(sensors=sensors)), np.random.default_rng(4)
    record, drawn = fdi["statistical"]["forces"], []
    std = np.radians([0.03, 0.02]), 0.1, 4.0, np.radians(0.05)
    for _ in range(1500):
        y = Y + np.array([*(std[0] * rng.normal(size=2)), std[1] * rng.normal(), std[2] * rng.normal(), 0.0])
        update_all_force_innovations(
            record, fdi["statistical"]["gust"], measured(X + std[3] * rng.normal(size=3), y), U, DT
        )
        drawn.append(record["component"]["innovation"].copy())
    update_all_force_innovations(record, fdi["statistical"]["gust"], measured(), U, DT)
    assert np.sqrt(record["component"]["noise_variance_with_without_vane"][:, 0]) == pytest.approx(
        np.std(drawn, axis=0), rel=0.06
    )
    without = (
        record["component"]["noise_variance_with_without_vane"][:, 0]
        - record["component"]["noise_variance_with_without_vane"][:, 1]
    )
    slopes = record["component"]["axis_and_force_innovation_per_vane_error"][:, 1] * np.radians([0.02, 0.03])
    assert without == pytest.approx(slopes**2, rel=1e-6)


def test_noise_of_the_pressure_is_jitter_as_the_innovation_moves_with_it():
    """Its slope by a difference, times the declared noise."""
    fdi = felt(Bounds(sensors={"qdyn": {"noise_std_pa": 4.0}}))
    record, innovation = fdi["statistical"]["forces"], []
    for more in (0.5, -0.5, 0.0):
        update_all_force_innovations(
            record, fdi["statistical"]["gust"], measured(y=Y + np.array([0, 0, 0, more, 0])), U, DT
        )
        innovation.append(record["component"]["innovation"].copy())
    slopes = innovation[0] - innovation[1]
    assert record["component"]["noise_variance_with_without_vane"] == pytest.approx(
        np.outer((4.0 * slopes) ** 2, [1, 1]), rel=1e-6
    )


def test_noise_of_accelerometers_is_jitter_that_the_pressure_does_not_scale():
    """Against a draw, at the trim's pressure and at twice as much; and how far it lets the angle wander."""
    sensors, rng = {"ay": {"noise_std_mps2": 0.04}, "az": {"noise_std_mps2": 0.07}}, np.random.default_rng(8)
    for dynamic_pressure_over_trim in (1.0, 2.0):
        fdi, y = felt(Bounds(sensors=sensors)), Y * (1.0, 1.0, 1.0, dynamic_pressure_over_trim, 1.0)
        record, drawn = fdi["statistical"]["forces"], []
        for noise in rng.normal(0.0, (0.04, 0.07), (1500, 2)):
            update_all_force_innovations(
                record, fdi["statistical"]["gust"], measured(y=y, force=(0.5, *(noise - (0.0, 9.5)))), U, DT
            )
            drawn.append(record["component"]["innovation"].copy())
        for inertial in range(2):
            jitter = record["component"]["noise_variance_with_without_vane"][:, inertial]
            assert np.sqrt(jitter) == pytest.approx(np.std(drawn, axis=0), rel=0.06)
    more = (
        record["component"]["inertial_innovation_drift_intensity"]
        - felt()["statistical"]["forces"]["component"]["inertial_innovation_drift_intensity"]
    )
    walked = [
        (0.04, 0.07)[f] / Y[2] * np.sqrt(DT) for f in (SIDE_INDEX_AMONG_FORCES, NORMAL_INDEX_AMONG_FORCES)
    ]
    assert np.sqrt(more) == pytest.approx(
        np.abs(record["component"]["axis_and_force_innovation_per_vane_error"][:, 1]) * walked
    )


def test_bias_and_slope_of_accelerometers_are_tolerated():
    """As one more constant, 1 / c of the bias, and as a share of the whole."""
    sensors = {"ay": {"bias_mps2": -0.2}, "az": {"bias_mps2": 0.3, "scale_error": -0.01}}
    record, none = (felt(Bounds(sensors=given))["statistical"]["forces"] for given in (sensors, {}))
    update_all_force_innovations(record, felt()["statistical"]["gust"], measured(), U, DT)
    for f, bias, scale in ((SIDE_INDEX_AMONG_FORCES, 0.2, 0.0), (NORMAL_INDEX_AMONG_FORCES, 0.3, 0.01)):
        force, before = record["component"][f], none["component"][f]
        n = int(force["n_regressors"])
        assert n == before["n_regressors"] + 1
        assert force["regressor_tolerance"][n - 2] == pytest.approx(bias)
        assert force["regressor"][n - 2] == pytest.approx(1.0 / AIRCRAFT.geometry.chord_m)
        assert force["regressor_tolerance"][n - 1] == pytest.approx(forces.MASS_TOLERANCE + scale)
        assert force["regressor_tolerance"][: n - 2] == pytest.approx(before["regressor_tolerance"][: n - 2])
    whole = per_coefficient() * coefficient("CZ")
    assert record["component"][NORMAL_INDEX_AMONG_FORCES]["regressor"][
        int(record["component"][NORMAL_INDEX_AMONG_FORCES]["n_regressors"]) - 1
    ] == pytest.approx(whole)


def test_without_accelerometers_no_force_is_weighed(viewed):
    statistical, G = viewed["statistical"], np.ones((3, 4))
    statistical["inertial_gust"]["output"]["accounts_for_gusts"] = 1
    views = statistical["views"]
    views["decaying_peak_score"], views["block"]["hypothesis"]["score"][:, 0] = 50.0, 50.0
    forces.stop_using_forces_and_accelerometers(
        *(statistical[name] for name in ("forces", "gust", "inertial_gust"))
    )
    assert not statistical["gust"]["output"]["uses_accelerometers"]
    assert not statistical["inertial_gust"]["output"]["accounts_for_gusts"]
    for v in (ELEVATOR_VIEW, ALPHA_VIEW, UP_VIEW, SIDE_VIEW):
        assert Across.shown(statistical, views[v]) == 0.0
    assert Across.shown(statistical, views[0]) == 50.0
    for block in statistical["block"]:
        block["gyro_noise_variance"] = 1e-8
    Across.observe(viewed, np.zeros(3), G, 0.0 * G, Y, 1, False)
    assert not views["decaying_peak_score"][ELEVATOR_VIEW : SIDE_VIEW + 1].any()


def test_accelerometers_that_may_break_raise_no_alarm_and_tell_no_gust(viewed):
    """Their forces still count, and ask for the vane to be cleared, once the rates alone have alarmed."""
    statistical = viewed["statistical"]
    air, views = statistical["gust"], statistical["views"]
    air["output"]["accounts_for_gusts"] = 1
    configure_parity_views(statistical, AIRCRAFT)
    views["direction"][ELEVATOR_VIEW], views["decaying_peak_score"][ELEVATOR_VIEW] = (
        (0.0, 0.3, 0.0, 0.0, -0.95),
        9.0,
    )
    air["output"]["mean_angular_acceleration_by_gust"] = 0.1, 0.2, 0.3
    views["block"]["hypothesis"]["score"][0, 0] = 7.0
    for read in (1, 0):
        air["output"]["uses_accelerometers"] = read
        views["decaying_peak_score"][UP_VIEW] = 50.0
        assert Across.alarm(statistical, views[ELEVATOR_VIEW]) == 9.0 * read
        views["decaying_peak_score"][UP_VIEW] = 0.0
        assert Across.subtracts_gust_estimate(statistical, views[0]) == bool(read)
        assert Across.part(viewed, views[0], np.ones(3), PITCH) == pytest.approx(1.0 - 0.2 * read)
        assert Across.shown(statistical, views[0]) == (0.0 if read else 7.0), "nothing is to be cleared"
        assert Across.shown(statistical, views[ELEVATOR_VIEW]) == 0.0
    views["decaying_peak_score"][UP_VIEW] = 50.0
    assert Across.shown(statistical, views[ELEVATOR_VIEW]) == 9.0


def test_a_gust_that_nobody_tells_moves_rate_and_force_in_full(viewed):
    statistical, rng = viewed["statistical"], np.random.default_rng(6)
    air, view, component = (
        statistical["gust"],
        statistical["views"][RUDDER_VIEW],
        statistical["forces"]["component"],
    )
    (
        air["output"]["accounts_for_gusts"],
        air["output"]["rate_damping"],
        air["output"]["gust_axes_in_body"],
        air["output"]["uses_accelerometers"],
    ) = (
        1,
        rng.normal(size=(3, 3)),
        np.eye(3),
        0,
    )
    air["memory"]["gust_rotation_intensity_per_airspeed"], air["memory"]["unmeasured_intensity_share"] = (
        (1e-5, 2e-5, 3e-5),
        0.0,
    )
    Across.turn(viewed, view, rng.normal(size=(3, 4)))
    Across.blur(view, statistical, 45.0)
    m = view["direction"]
    by_both = np.abs(m[:3] @ air["output"]["rate_damping"]) + np.abs(
        m[3:] @ component["innovation_per_air_rotation"]
    )
    still = float(view["block"]["drift_intensity"][0, 0])
    air["memory"]["gust_rotation_intensity_per_airspeed"] = 0.0
    Across.blur(view, statistical, 45.0)
    gusts = still - float(view["block"]["drift_intensity"][0, 0])
    assert gusts == pytest.approx(45.0 * np.sum(by_both**2 * np.array([1e-5, 2e-5, 3e-5])))


def test_noise_of_the_gust_that_forces_tell_blurs_what_clears_a_vane(viewed):
    statistical = viewed["statistical"]
    statistical["forces"]["angular_acceleration_by_gust_noise_std"] = 0.1, 0.2, 0.3
    for v, angular_acceleration_by_gust_noise_std in ((ALPHA_VIEW, True), (ELEVATOR_VIEW, False)):
        view = statistical["views"][v]
        view["direction"] = 0.0, -0.6, 0.0, 0.0, 0.8
        Across.blur(view, statistical, 45.0)
        own = 0.8 * np.sqrt(
            statistical["forces"]["component"][NORMAL_INDEX_AMONG_FORCES]["noise_variance_with_without_vane"][
                0
            ]
        )
        assert view["block"]["model_noise_variance"][0] == pytest.approx(
            (own + 0.6 * 0.2 * angular_acceleration_by_gust_noise_std) ** 2
        )


def test_a_vane_s_error_moves_rate_and_force_by_their_slopes():
    record = felt()["statistical"]["forces"]
    for f, name, place, axis in (
        (SIDE_INDEX_AMONG_FORCES, "CY", 1, 2),
        (NORMAL_INDEX_AMONG_FORCES, "CZ", 0, 1),
    ):
        off = Y + 1e-5 * np.eye(5)[place]
        slope = per_coefficient() * (coefficient(name, y=off) - coefficient(name)) / 1e-5
        assert record["component"][f]["axis_and_force_innovation_per_vane_error"] == pytest.approx(
            [-ALONG_Y[axis, place], -slope], rel=1e-4
        )


def test_constant_errors_are_tolerated_term_by_term():
    given = Bounds(coefficients=0.05, sensors={"alpha": {"bias_deg": 0.5}, "qdyn": {"bias_pa": 23.0}})
    force = felt(given)["statistical"]["forces"]["component"][NORMAL_INDEX_AMONG_FORCES]
    terms = forces.terms_of_one_force(AIRCRAFT, NORMAL_INDEX_AMONG_FORCES)
    shares = force["regressor_tolerance"][: len(terms)] / np.abs([t.value for t in terms])
    assert shares[1:] == pytest.approx(0.05 + 23.0 / 1150.0)
    slope = abs(force["axis_and_force_innovation_per_vane_error"][1]) / per_coefficient()
    of_constant = 0.07 * abs(terms[0].value) + np.radians(0.5) * slope
    assert terms[0].is_constant
    assert force["regressor_tolerance"][0] == pytest.approx(of_constant)
    assert force["regressor_tolerance"][len(terms)] == forces.MASS_TOLERANCE
    assert force["n_regressors"] == len(terms) + 1


@pytest.mark.parametrize(("air", "tolerance"), [("none", 0.05), ("moderate", 0.2)])
def test_the_rate_of_sideslip_is_known_within_a_twentieth_and_in_moving_air_a_fifth(air, tolerance):
    """Of its term, beside the tolerance of the coefficients."""
    given = Bounds(coefficients=0.07, turbulence=air)
    force = felt(given)["statistical"]["forces"]["component"][SIDE_INDEX_AMONG_FORCES]
    of_rate = len(forces.terms_of_one_force(AIRCRAFT, SIDE_INDEX_AMONG_FORCES))
    assert force["regressor_tolerance"][of_rate] == pytest.approx(0.07 + tolerance)


@pytest.mark.parametrize(
    ("bounds", "side", "up"),
    [
        ({}, 0.0, 0.0),
        ({"r": {"bias_deg_s": 0.1}}, np.radians(0.1), np.radians(0.1)),
        ({"phi": {"bias_deg": 1.0}}, TILTED, 0.3 * TILTED),
        ({"ay": {"bias_mps2": 0.46}}, 0.01, 0.0),
        ({"az": {"bias_mps2": -0.46}}, 0.0, 0.01),
        ({"ax": {"bias_mps2": 0.46}}, 0.003, 0.003),
        ({"az": {"scale_error": 0.02}}, 0.0, 0.02 * GRAVITY / 46.0),
    ],
)  # fmt: skip
def test_the_angle_followed_drifts_by_gyros_and_by_gravity_s_share(bounds, side, up):
    """Within a second by three tenths more or less: as the standard deviation of a walk."""
    off, sound = (felt(b)["statistical"]["forces"]["component"] for b in (Bounds(sensors=bounds), Bounds()))
    drift, still = off["flow_angle_drift_bound"], sound["flow_angle_drift_bound"]
    assert still == pytest.approx(7.292115e-5 + 0.03 / 46.0)  # the earth turns at this rate [WGS84]
    assert drift - still == pytest.approx([side, up], abs=1e-12)
    gained = off["inertial_innovation_drift_intensity"] - sound["inertial_innovation_drift_intensity"]
    angle_walk = gained / sound["axis_and_force_innovation_per_vane_error"][:, 1] ** 2
    assert angle_walk == pytest.approx(0.09 * (drift**2 - still**2), rel=1e-6, abs=1e-15)


def test_in_turbulence_gusts_turn_the_flow():
    """By a walk of 3 sigma^2 / (L V) [MIL-F-8785C, 3.7], against a draw of Dryden's vertical gust."""
    still, moving = (
        felt(Bounds(turbulence=air))["statistical"]["forces"]["component"] for air in ("none", "moderate")
    )
    gained = moving["inertial_innovation_drift_intensity"] - still["inertial_innovation_drift_intensity"]
    sigma, L, V, dt, rng = 10.6 * 0.3048, 533.4, 46.0, 0.01, np.random.default_rng(2)
    more = np.sqrt(gained) / np.abs(moving["axis_and_force_innovation_per_vane_error"][:, 1])
    tau, n = L / V, 40_000  # (1 + sqrt(3) tau s) / (1 + tau s)^2, of white noise of intensity sigma^2 tau
    noise, one, two, gust = rng.normal(0.0, sigma * np.sqrt(tau / dt), n), 0.0, 0.0, np.empty(n)
    for k in range(n):
        one += dt * (noise[k] - one) / tau
        two += dt * (one - two) / tau
        gust[k] = two + np.sqrt(3.0) * (one - two)
    assert more == pytest.approx(np.std(np.diff(gust)) / V / np.sqrt(dt), rel=0.03)


@pytest.fixture
def viewed():
    fdi = felt(Bounds(coefficients=0.05))
    statistical = fdi["statistical"]
    (
        statistical["test_config"]["alarm_level"],
        statistical["test_config"]["isolation_llr_margin"],
        statistical["test_config"]["evidence_decay_factor"],
    ) = 6.0, 0.5 * 5.0**2, 0.99
    configure_parity_views(statistical, AIRCRAFT)
    configure_tone_tests(statistical["tone_test_config"], 1e-8, 45.0, 15.0, DT)
    for _ in range(2):
        update_all_force_innovations(statistical["forces"], statistical["gust"], measured(), U, DT)
    fdi["layout"]["position_estimator"] = range(4)
    return fdi


@pytest.mark.parametrize(("before", "begun", "expected"), [(1.0, 1, 0.3), (2.2, 1, 0.3), (1.0, 0, 0.0)])
def test_a_force_is_off_by_what_it_changes_in_two_milliseconds(before, begun, expected):
    force = new_fdi()["statistical"]["forces"]["component"][0]
    force["predicted_specific_force_over_chord"] = 1.6
    forces.fill_force_flow_lag_error_bound(force, before, begun, 0.004)
    assert force["force_flow_lag_error_bound"] == pytest.approx(expected)


def test_what_a_force_is_off_widens_what_is_merely_bounded(viewed):
    statistical, view = viewed["statistical"], viewed["statistical"]["views"][ELEVATOR_VIEW]
    view["direction"] = 0.0, 0.6, 0.0, 0.0, -0.8
    Across.blur(view, statistical, 45.0)
    before = float(view["uncertainty_bound"][0])
    statistical["forces"]["component"]["force_flow_lag_error_bound"][NORMAL_INDEX_AMONG_FORCES] = 0.5
    Across.blur(view, statistical, 45.0)
    assert view["uncertainty_bound"][0] == pytest.approx(before + 0.8 * 0.5)


def test_how_fast_a_force_changes_is_told_from_one_instant_to_the_next(viewed):
    statistical = viewed["statistical"]
    component = statistical["forces"]["component"]
    then, seen = component["predicted_specific_force_over_chord"].copy(), measured()
    seen["y"][1] += 0.01
    update_all_force_innovations(statistical["forces"], statistical["gust"], seen, U, DT)
    changed = np.abs(component["predicted_specific_force_over_chord"] - then)
    assert changed[SIDE_INDEX_AMONG_FORCES] > 0.01
    assert component["force_flow_lag_error_bound"] == pytest.approx(
        forces.MAX_LAG_BETWEEN_FORCE_AND_FLOW_S * changed / DT
    )


def test_each_surface_is_looked_past_in_the_axis_it_leads_and_its_force(viewed):
    seen = [
        (
            int(v["orthogonal_to_surface"]),
            *v["plane_axes"],
            v["uses_inertial_flow_angle"],
            v["is_immune_to_vane_error"],
        )
        for v in viewed["statistical"]["views"][5:13]
    ]
    assert seen == [
        (1, PITCH, NORMAL_FORCE, 0, 0), (3, PITCH, NORMAL_FORCE, 0, 0),
        (ORTHOGONAL_TO_VANE_ERROR, PITCH, NORMAL_FORCE, 0, 1),
        (AXIS_VIEW, PITCH, NORMAL_FORCE, 1, 1), (0, ROLL, SIDE_FORCE, 0, 0), (2, YAW, SIDE_FORCE, 0, 0),
        (ORTHOGONAL_TO_VANE_ERROR, YAW, SIDE_FORCE, 0, 1), (AXIS_VIEW, YAW, SIDE_FORCE, 1, 1),
    ]  # fmt: skip


@pytest.mark.parametrize("v", [ELEVATOR_VIEW, FLAP_VIEW, ALPHA_VIEW, AILERON_VIEW, RUDDER_VIEW, BETA_VIEW])
def test_what_goes_along_a_column_of_rate_and_force_is_not_seen_past_it(viewed, v):
    view, G = viewed["statistical"]["views"][v], np.random.default_rng(7).normal(0.0, 3.0, (3, 4))
    G[1, [0, 2]] = G[0, [1, 3]] = G[2, [1, 3]] = 0.0
    Across.turn(viewed, view, G)
    first, second = view["plane_axes"]
    force = viewed["statistical"]["forces"]["component"][second - SIDE_FORCE]
    s = int(view["orthogonal_to_surface"])
    of_it = (
        force["axis_and_force_innovation_per_vane_error"]
        if s == ORTHOGONAL_TO_VANE_ERROR
        else (G[first, s], force["specific_force_over_chord_per_surface_rad"][s])
    )
    assert view["direction"][[first, second]] @ of_it == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)
    assert np.count_nonzero(view["direction"]) == 2
    if s != ORTHOGONAL_TO_VANE_ERROR:
        assert Across.can_surface_fault_change_view(viewed, view, s, G[:, s]) == 0
        assert Across.can_surface_fault_change_view(
            viewed, view, FLAP if s == ELEVATOR else ELEVATOR, G[:, 1]
        ) == (second == NORMAL_FORCE)


def test_the_side_vane_is_cleared_across_the_rolling_gust_as_well(viewed):
    """Of roll, yaw and side force: neither the vane's error nor a rolling gust moves what is looked at, and
    what errors of the vane's column let show is the most that its corners do."""
    statistical, rng = viewed["statistical"], np.random.default_rng(3)
    statistical["gust"]["output"]["accounts_for_gusts"] = 1
    configure_parity_views(statistical, AIRCRAFT)
    view, moving = statistical["views"][BETA_VIEW], statistical["gust"]
    moving = moving["output"]
    moving["rate_damping"], moving["gust_axes_in_body"] = (
        rng.normal(size=(3, 3)),
        np.linalg.qr(rng.normal(size=(3, 3)))[0],
    )
    force = statistical["forces"]["component"][SIDE_INDEX_AMONG_FORCES]
    column = np.array(
        [force["roll_innovation_per_vane_error"], *force["axis_and_force_innovation_per_vane_error"]]
    )
    share = Across.turn(viewed, view, np.zeros((3, 4)))
    mix = view["direction"][[ROLL, YAW, SIDE_FORCE]]
    assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)
    assert mix @ column == pytest.approx(0.0, abs=1e-12)
    gust = (moving["rate_damping"] @ moving["gust_axes_in_body"])[:, 0]
    assert view["direction"][:3] @ gust == pytest.approx(0.0, abs=1e-12)
    assert view["direction"][PITCH] == view["direction"][NORMAL_FORCE] == 0.0
    assert view["unit_column"][[ROLL, YAW, SIDE_FORCE]] == pytest.approx(column / np.linalg.norm(column))
    corners = np.stack(np.meshgrid(*[(-0.1, 0.1)] * 3)).reshape(3, -1).T * column
    assert share == pytest.approx(np.max(np.abs(corners @ mix)) / (0.9 * np.linalg.norm(column)))
    n = int(view["block"]["n_regressors"])
    Across.regress(viewed, view, np.zeros(3), share)
    view["confirming_force_component"] = 0
    Across.regress(viewed, view, np.array([0.4, 7.0, -0.3]), share)
    seen = np.array([0.4, -0.3, force["innovation"]])
    assert view["block"]["regressor"][n - 1, 0] == pytest.approx(
        share * seen @ column / np.linalg.norm(column)
    )


def test_where_no_vane_and_no_gust_moves_anything_the_direction_stays(viewed):
    statistical = viewed["statistical"]
    statistical["gust"]["output"]["accounts_for_gusts"] = 1
    configure_parity_views(statistical, AIRCRAFT)
    view = statistical["views"][BETA_VIEW]
    view["direction"] = 0.6, 0.0, 0.8, 0.0, 0.0
    statistical["gust"]["output"]["rate_damping"] = 0.0
    assert Across.turn(viewed, view, np.zeros((3, 4))) == 0.0
    assert view["direction"].tolist() == [0.6, 0.0, 0.8, 0.0, 0.0]


def test_in_still_air_there_is_no_gust_to_look_past(viewed):
    assert not viewed["statistical"]["views"]["is_orthogonal_to_rolling_gust"].any()


def test_a_force_counts_once_the_vane_is_cleared(viewed):
    """At the alarm level, of what clears the vane at the naming level; rates need no clearing."""
    statistical = viewed["statistical"]
    views = statistical["views"]
    views["decaying_peak_score"][ELEVATOR_VIEW], views["direction"][ELEVATOR_VIEW] = (
        9.0,
        (0.0, 0.3, 0.0, 0.0, -0.95),
    )
    assert Across.shown(statistical, views[ELEVATOR_VIEW]) == 0.0
    for clearing in (ALPHA_VIEW, UP_VIEW):
        views["decaying_peak_score"][[ALPHA_VIEW, UP_VIEW]] = 0.0
        views["decaying_peak_score"][clearing] = 5.0
        assert Across.shown(statistical, views[ELEVATOR_VIEW]) == pytest.approx(6.0)
    views["decaying_peak_score"][UP_VIEW] = 50.0
    assert Across.shown(statistical, views[ELEVATOR_VIEW]) == 9.0
    (
        views["decaying_peak_score"][[ALPHA_VIEW, UP_VIEW]],
        views["decaying_peak_score"][[BETA_VIEW, SIDE_VIEW]],
    ) = 0.0, 50.0
    assert Across.shown(statistical, views[ELEVATOR_VIEW]) == 0.0, "another vane"
    views["block"]["hypothesis"]["score"][0, 0] = 7.0
    assert Across.shown(statistical, views[0]) == 7.0


def test_only_what_is_mostly_a_force_raises_the_alarm(viewed):
    views = viewed["statistical"]["views"]
    viewed["statistical"]["test_config"]["isolation_llr_margin"] = 18.0
    for v, mix, alarms in (
        (ELEVATOR_VIEW, (0.0, 0.3, 0.0, 0.0, -0.95), True), (FLAP_VIEW, (0.0, 0.95, 0.0, 0.0, 0.3), False),
        (AILERON_VIEW, (0.03, 0.0, 0.0, 1.0, 0.0), True), (ALPHA_VIEW, (0.0, 0.1, 0.0, 0.0, 0.99), False),
        (SIDE_VIEW, (0.0, 0.0, 0.0, 1.0, 0.0), False),
    ):  # fmt: skip
        views["direction"][v], views["decaying_peak_score"][:] = mix, 9.0
        assert (Across.alarm(viewed["statistical"], views[v]) > 0.0) == alarms


@pytest.mark.parametrize(("v", "mix", "axis"), [
    (ELEVATOR_VIEW, (0.0, 0.3, 0.0, 0.0, -0.95), PITCH), (AILERON_VIEW, (0.03, 0.0, 0.0, 1.0, 0.0), ROLL),
])  # fmt: skip
def test_the_alarm_of_a_force_is_the_scores_and_the_logs_and_has_its_time(viewed, v, mix, axis):
    """Held at 9 where 6 raise it: one and a half, of the axis that its surface leads, first at 0 s."""
    chances, row = viewed["statistical"], np.full(5, 7.0)
    views, tests, alarm = chances["views"][: chances["n_views"]], chances["test_config"], chances["alarm"]
    views["direction"] = 0.0
    views["direction"][v], views["decaying_peak_score"], tests["isolation_llr_margin"] = mix, 9.0, 18.0
    alarm["detected_at_s"], tests["n_score_columns"] = -1.0, 4
    for t in (0.0, 2.5):
        statistical.update_alarm(alarm, tests, chances["block"], views, chances["forces"], chances["gust"], t)
    assert (alarm["score_over_alarm_level"], alarm["axis"], alarm["detected_at_s"]) == (1.5, axis, 0.0)
    statistical.write_alarm_scores_to_log_row(
        tests, chances["block"], views, chances["forces"], chances["gust"], row
    )
    assert row.tolist() == [7.0, 0.0, *(1.5 if i == axis else 0.0 for i in (ROLL, PITCH, YAW))]


def test_what_clears_a_vane_excludes_nobody(viewed):
    statistical = viewed["statistical"]
    views = statistical["views"]
    for v in (ALPHA_VIEW, UP_VIEW):
        views["decaying_peak_score"][v], views["block"]["hypothesis"]["score"][v, 0] = 50.0, 50.0
    assert not any(Across.excludes(viewed, s) for s in range(4))


def test_a_force_is_weighed_once_the_rate_of_sideslip_of_the_run_before_is_known():
    """A diagnosis begun in a slip that swings: the first force has the rate of its own run."""
    fdi = felt()
    statistical, swinging = fdi["statistical"], measured()
    statistical["test_config"]["alarm_level"], statistical["test_config"]["evidence_decay_factor"] = 6.0, 0.99
    configure_parity_views(statistical, AIRCRAFT)
    configure_tone_tests(statistical["tone_test_config"], 1e-8, 45.0, 15.0, DT)
    swinging["force"][1] += 20.0
    for looks in (1, 2):
        update_all_force_innovations(statistical["forces"], statistical["gust"], swinging, U, DT)
        assert statistical["forces"]["n_updates_capped_at_minimum"] == looks
        Across.observe(fdi, np.zeros(3), np.ones((3, 4)), np.zeros((3, 4)), Y, looks, False)
        active = [
            v for v in statistical["views"] if parity.uses_force(v) and parity.max_test_score_of_view(v) > 0.0
        ]
        assert bool(active) == (looks == 2)


def test_old_evidence_of_a_force_is_forgotten_slowly(viewed):
    statistical, G = viewed["statistical"], np.ones((3, 4))
    statistical["views"]["decaying_peak_score"][UP_VIEW] = 8.0
    for block in statistical["block"]:
        block["gyro_noise_variance"] = 1e-8
    Across.observe(viewed, np.zeros(3), G, 0.0 * G, Y, 1, False)
    assert statistical["views"]["decaying_peak_score"][UP_VIEW] == pytest.approx(
        8.0 * (1.0 - 0.01 / parity.PEAK_SCORE_TO_EVIDENCE_MEMORY_RATIO)
    )


def test_what_errors_multiply_along_a_direction_is_that_of_rate_and_force(viewed):
    """Of the rate's block, then of the force, then how far the followed angle has drifted, or the column."""
    statistical, rng = viewed["statistical"], np.random.default_rng(9)
    pitch, force = statistical["block"][0], statistical["forces"]["component"][NORMAL_INDEX_AMONG_FORCES]
    pitch["n_regressors"], pitch["regressor"][:3, 0] = 3, rng.normal(size=3)
    view, n = statistical["views"][ELEVATOR_VIEW], int(force["n_regressors"])
    view["direction"], view["unit_column"] = (0.0, 0.6, 0.0, 0.0, -0.8), (0.0, -0.8, 0.0, 0.0, -0.6)
    Across.regress(viewed, view, np.array([0.0, 2.0, 0.0]), 0.1)
    found = view["block"]["regressor"][: 4 + n, 0]
    along = 0.1 * (-0.8 * 2.0 - 0.6 * force["innovation"])
    expected = [*(0.6 * pitch["regressor"][:3, 0]), *(-0.8 * force["regressor"][:n]), along]
    assert found == pytest.approx(np.array(expected))
    alone = statistical["views"][UP_VIEW]
    Across.regress(viewed, alone, np.zeros(3), 0.0)
    assert alone["block"]["regressor"][3 : 3 + n, 0] == pytest.approx(force["regressor"][:n])
    assert alone["block"]["regressor"][3 + n, 0] == pytest.approx(force["innovation_per_flow_angle_drift"])


def test_a_loss_signs_with_the_force_it_takes(viewed):
    view, Gu = viewed["statistical"]["views"][FLAP_VIEW], np.random.default_rng(1).normal(size=(3, 4))
    view["direction"] = 0.0, 0.9, 0.0, 0.0, 0.4
    Across.sign(viewed, view, Gu)
    moment = viewed["statistical"]["forces"]["component"][NORMAL_INDEX_AMONG_FORCES][
        "specific_force_over_chord_of_surface_at_command"
    ][ELEVATOR]
    assert view["block"]["hypothesis"]["signature"][:2, 0] == pytest.approx(
        [1.0, 0.9 * Gu[1, ELEVATOR] + 0.4 * moment]
    )


@pytest.mark.parametrize("v", [ELEVATOR_VIEW, UP_VIEW, RUDDER_VIEW])
def test_what_is_declared_of_rate_and_force_is_seen_along_a_direction(viewed, v):
    statistical, rng = viewed["statistical"], np.random.default_rng(6)
    (
        statistical["noise"]["acceleration_variance_by_input_noise"],
        statistical["noise"]["uncertainty_bound"],
        statistical["noise"]["drift_intensity_over_squared_bound"],
    ) = (
        (1e-6, 4e-6, 9e-6),
        0.02,
        2.0,
    )
    air, view, component = statistical["gust"], statistical["views"][v], statistical["forces"]["component"]
    air["output"]["accounts_for_gusts"], air["output"]["rate_damping"], air["output"]["gust_axes_in_body"] = (
        1,
        rng.normal(size=(3, 3)),
        np.eye(3),
    )
    air["memory"]["gust_rotation_intensity_per_airspeed"] = 1e-5, 2e-5, 3e-5
    component["noise_variance_with_without_vane"], component["deflection_error_effect_bound"] = (
        ((2e-6, 1e-7), (3e-5, 2e-5)),
        (0.001, 0.002),
    )
    component["inertial_innovation_drift_intensity"], statistical["forces"]["dynamic_pressure_over_trim"] = (
        (1e-4, 2e-4),
        1.2,
    )
    for name in (
        "accounts_for_gusts",
        "rate_damping",
        "gust_axes_in_body",
        "gust_rotation_intensity_per_airspeed",
    ):
        holder(statistical["inertial_gust"], name)[name] = holder(air, name)[name]
    (
        air["memory"]["unmeasured_intensity_share"],
        statistical["inertial_gust"]["memory"]["unmeasured_intensity_share"],
    ) = (
        (1.0, 0.25, 0.09),
        (1.0, 0.36, 0.16),
    )
    seen = statistical["inertial_gust" if view["is_immune_to_vane_error"] else "gust"]["memory"][
        "unmeasured_intensity_share"
    ]
    Across.turn(viewed, view, rng.normal(size=(3, 4)))
    Across.blur(view, statistical, 45.0)
    m, block = view["direction"], view["block"]
    rate_gust_sensitivity, force_gust_sensitivity = (
        np.abs(m[:3] @ air["output"]["rate_damping"]),
        1.2 * np.abs(m[3:] @ component["innovation_per_air_rotation"]),
    )
    gusts = 45.0 * np.sum(
        (np.sqrt(seen) * rate_gust_sensitivity + force_gust_sensitivity) ** 2
        * air["memory"]["gust_rotation_intensity_per_airspeed"]
    )
    sizes = np.sqrt(
        [
            *statistical["noise"]["acceleration_variance_by_input_noise"],
            *component["noise_variance_with_without_vane"][:, int(view["uses_inertial_flow_angle"])],
        ]
    )
    assert block["model_noise_variance"][0] == pytest.approx((np.abs(m) @ sizes) ** 2)
    bound = np.abs(m) @ [0.02, 0.02, 0.02, 0.0012, 0.0024]
    assert view["uncertainty_bound"][0] == pytest.approx(bound)
    of_forces = m[3:] ** 2 @ component["inertial_innovation_drift_intensity"]
    drift_intensity = 1.2**2 * view["uses_inertial_flow_angle"] * of_forces
    assert block["drift_intensity"][0, 0] == pytest.approx(
        gusts + drift_intensity + 2.0 * max(bound, 1e-3) ** 2
    )


@pytest.mark.parametrize("dynamic_pressure_over_trim", [1.0, 2.5])
def test_noise_and_slopes_of_forces_go_with_the_pressure(dynamic_pressure_over_trim):
    """A dive at more than its trim's pressure: as if trimmed there."""
    sensors = {"alpha": {"noise_std_deg": 0.03}, "beta": {"noise_std_deg": 0.02}}
    fdi, fast = felt(Bounds(sensors=sensors)), Y * (1.0, 1.0, 1.0, dynamic_pressure_over_trim, 1.0)
    record = fdi["statistical"]["forces"]
    update_all_force_innovations(record, fdi["statistical"]["gust"], measured(y=fast), U, DT)
    slopes = (
        dynamic_pressure_over_trim * record["component"]["axis_and_force_innovation_per_vane_error"][:, 1]
    )
    noise = np.radians([0.02, 0.03])
    assert record["dynamic_pressure_over_trim"] == pytest.approx(dynamic_pressure_over_trim)
    assert record["component"]["noise_variance_with_without_vane"][:, 0] == pytest.approx(
        (slopes * noise) ** 2, rel=0.01
    )
    assert record["component"]["innovation_per_flow_angle_drift"] == pytest.approx(DT * slopes)


def test_without_vanes_the_flow_is_what_the_forces_say():
    """A vane that is off by little: forces give back where the flow is."""
    fdi = felt()
    record, air = fdi["statistical"]["forces"], fdi["statistical"]["gust"]
    update_all_force_innovations(record, air, measured(), U, DT)
    sound = [
        measured().force[1 + f] - record["component"][f]["innovation"] * AIRCRAFT.geometry.chord_m
        for f in (SIDE_INDEX_AMONG_FORCES, NORMAL_INDEX_AMONG_FORCES)
    ]
    off = Y + np.array([0.004, -0.003, 0.0, 0.0, 0.0])
    update_all_force_innovations(record, air, measured(y=off, force=(0.5, *sound)), U, DT)
    forces.fill_y_without_vanes(
        record, np.zeros(3), np.append(off, np.zeros(record["y_without_vanes"].size - 5))
    )
    assert record["y_without_vanes"][:5] == pytest.approx(Y, abs=6e-4), "an eighth of what they are off"
    still, turning = record["y_without_vanes"][:2].copy(), np.array([0.02, -0.03, 0.01])
    forces.fill_y_without_vanes(record, turning, np.append(off, np.zeros(record["y_without_vanes"].size - 5)))
    damped = (
        record["component"]["innovation_per_air_rotation"]
        @ turning
        / record["component"]["axis_and_force_innovation_per_vane_error"][:, 1]
    )
    assert still - record["y_without_vanes"][:2] == pytest.approx(damped[::-1])


@pytest.mark.parametrize("v", [ELEVATOR_VIEW, ALPHA_VIEW])
def test_a_view_takes_off_the_gust_as_it_may_know_it(viewed, v):
    """Of surfaces by the vanes; of what clears a vane without them."""
    statistical = viewed["statistical"]
    (
        statistical["gust"]["output"]["mean_angular_acceleration_by_gust"],
        statistical["inertial_gust"]["output"]["mean_angular_acceleration_by_gust"],
    ) = (
        (0.1, 0.2, 0.3),
        (0.4, 0.5, 0.6),
    )
    seen = 0.5 if v == ALPHA_VIEW else 0.2
    view = statistical["views"][v]
    assert Across.part(viewed, view, np.ones(3), PITCH) == pytest.approx(1.0 - seen)
    force = statistical["forces"]["component"][NORMAL_INDEX_AMONG_FORCES]["innovation"]
    assert Across.part(viewed, view, np.ones(3), NORMAL_FORCE) == force
    assert Across.part(viewed, statistical["views"][ROLL_VIEW], np.ones(3), ROLL) == 1.0


def test_in_moving_air_the_vanes_are_asked_but_for_the_rolling_gust(viewed):
    for moving in (0, 1):
        viewed["statistical"]["gust"]["output"]["accounts_for_gusts"] = moving
        configure_parity_views(viewed["statistical"], AIRCRAFT)
        confirming_force_component = viewed["statistical"]["views"]["confirming_force_component"][:5].tolist()
        assert confirming_force_component == [
            moving * NORMAL_FORCE,
            0,
            moving * SIDE_FORCE,
            moving * SIDE_FORCE,
            0,
        ]


def without_force(coefficient, surface):
    """The aircraft without what this surface does to this force."""
    own = getattr(AIRCRAFT.file.forces, coefficient)
    rest = tuple(term for term in own if term.surface != surface)
    assert len(rest) < len(own)
    changed = AIRCRAFT.file.forces.model_copy(update={coefficient: rest})
    return Aircraft(AIRCRAFT.file.model_copy(update={"forces": changed}), AIRCRAFT.folder)


UP_VIEWS = [
    (ELEVATOR, (PITCH, NORMAL_FORCE)),
    (FLAP, (PITCH, NORMAL_FORCE)),
    (ORTHOGONAL_TO_VANE_ERROR, (PITCH, NORMAL_FORCE)),
    (AXIS_VIEW, (PITCH, NORMAL_FORCE)),
]
SIDE_VIEWS = [
    (0, (ROLL, SIDE_FORCE)),
    (2, (YAW, SIDE_FORCE)),
    (ORTHOGONAL_TO_VANE_ERROR, (YAW, SIDE_FORCE)),
    (AXIS_VIEW, (YAW, SIDE_FORCE)),
]


@pytest.mark.parametrize(
    ("aircraft", "expected", "asked"),
    [
        (AIRCRAFT, UP_VIEWS + SIDE_VIEWS, True),
        (without_force("CZ", "flap"), SIDE_VIEWS, False),
        (without_force("CY", "aileron"), UP_VIEWS, False),
    ],
)
def test_an_aircraft_told_apart_in_one_plane_only_has_the_views_of_that_plane(aircraft, expected, asked):
    """And no vane is asked in moving air: none looks at both planes."""
    fdi = felt()
    statistical = fdi["statistical"]
    statistical["gust"]["output"]["accounts_for_gusts"] = 1
    configure_parity_views(statistical, aircraft)
    views = statistical["views"][: statistical["n_views"]]
    found = [(int(view["orthogonal_to_surface"]), tuple(view["plane_axes"].tolist())) for view in views[5:]]
    assert found == expected
    asking = [asked and view in (0, 2, 3) for view in range(5)]  # pitch, yaw, and past the aileron
    assert [bool(view["confirming_force_component"]) for view in views[:5]] == asking
    assert aircraft.forces_separate_surfaces


NOISY = {
    "alpha": {"noise_std_deg": 0.11}, "beta": {"noise_std_deg": 0.17}, "V": {"noise_std_mps": 0.4},
    "qdyn": {"noise_std_pa": 9.0}, "p": {"noise_std_deg_s": 0.5}, "q": {"noise_std_deg_s": 0.7},
    "r": {"noise_std_deg_s": 0.9},
}  # fmt: skip


@pytest.mark.parametrize(
    ("f", "name", "vane"),
    [(SIDE_INDEX_AMONG_FORCES, "CY", "beta"), (NORMAL_INDEX_AMONG_FORCES, "CZ", "alpha")],
)
@pytest.mark.parametrize("engine", [0, 1])
def test_what_noise_of_the_readings_makes_up_of_a_force(f, name, vane, engine):
    """Variance per metre: that of each reading, by differences, the airspeed's through the slipstream too;
    the slipstream's own, of pressure and power; and all of it without the vane."""
    sizes = [next(iter(each.values())) for each in NOISY.values()]
    apart(noise=sizes)
    told = {
        "has_engine_instrument_errors": engine,
        "power_error_kw_by_instruments": 7.0,
        "power_error_kw_per_density_ratio": 31.0,
    }
    found = felt(Bounds(sensors=NOISY), **told)["statistical"]["forces"]["component"][f][
        "trim_noise_variance_with_without_vane"
    ]
    sd = dict(zip(NOISY, sizes, strict=True))
    sd |= {axis: np.radians(sd[axis]) for axis in ("alpha", "beta", "p", "q", "r")}

    def slope(step, x=X, y=Y):
        ahead, behind = (coefficient(name, **{"x": x + s * step[0], "y": y + s * step[1]}) for s in (1, -1))
        return per_coefficient() * (ahead - behind) / 2.0

    still, e = np.zeros(3), 1e-5
    by_airspeed, by_pressure, per_kw = slipstream_slopes(Y, 31.0) if engine else (0.0, 0.0, 0.0)
    moved = {
        "alpha": (still, e * np.eye(5)[0]), "beta": (still, e * np.eye(5)[1]),
        "V": (still, e * (np.eye(5)[2] + by_airspeed * np.eye(5)[4])),
        **{axis: (e * np.eye(3)[i], np.zeros(5)) for i, axis in enumerate("pqr")},
    }  # fmt: skip
    parts = {reading: (slope(step) / e * sd[reading]) ** 2 for reading, step in moved.items()}
    slipstream = slope((still, e * np.eye(5)[4])) / e
    others = slipstream**2 * ((by_pressure * sd["qdyn"]) ** 2 + (per_kw * 7.0 / 4.0) ** 2)
    whole = sum(parts.values()) + others
    assert found == pytest.approx([whole, whole - parts[vane]], rel=1e-3)
