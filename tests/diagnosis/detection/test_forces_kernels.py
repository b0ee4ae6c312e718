"""What accelerometers say of the surfaces, a kernel at a time, against sums, differences and draws."""

import numpy as np
import pytest
from kernels import holder, new_fdi
from statistics_of import Across

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.aircraft.schema import SIDESLIP_RATE
from beaver_ftc.design.model import fill_table
from beaver_ftc.diagnosis.detection import forces
from beaver_ftc.diagnosis.detection.forces import (
    NORMAL_INDEX,
    SIDE_INDEX,
    configure_forces,
    update_both_forces,
)
from beaver_ftc.diagnosis.detection.parity import (
    VANE_VIEW,
    configure_parity_views,
    configure_tones,
)
from beaver_ftc.diagnosis.state import NORMAL_FORCE, PITCH, ROLL, SIDE_FORCE, YAW
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.scenario.diagnosis import Bounds
from flying import declared_in

AIRCRAFT = load()
ELEVATOR, FLAP = 1, 3
X, U = np.array([0.05, -0.03, 0.04]), np.array([0.06, -0.08, 0.05, 0.1])
Y = np.array([0.11, 0.07, 46.0, 1150.0, 2.1])
ALONG_Y = np.arange(15.0).reshape(3, 5)
DT, GRAVITY = 0.01, 9.80665
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
    fill_table(air["memory"]["table"], AIRCRAFT, AIRCRAFT.measurable_forces, FORCES)
    air["config"]["S_m"], air["config"]["gravity"] = (
        AIRCRAFT.geometry.wing_area_m2 / AIRCRAFT.mass.mass_kg,
        GRAVITY,
    )
    air["config"]["L_gust"], statistical["forces"]["in_use"] = 533.4, 1
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


@pytest.mark.parametrize(("f", "name"), [(SIDE_INDEX, "CY"), (NORMAL_INDEX, "CZ")])
def test_the_model_is_the_sum_of_its_terms_and_the_rest_is_the_innovation(f, name):
    fdi, rate = felt(), 0.04
    record, seen = fdi["statistical"]["forces"], measured()
    record["angle_rate"][SIDE_INDEX], record["n_seen"] = rate, 1
    update_both_forces(record, fdi["statistical"]["gust"], seen, U, DT)
    whole = per_coefficient() * coefficient(name, rate=rate)
    force = record["component"][f]
    expected = seen["force"][1 + f] / AIRCRAFT.geometry.chord_m - whole
    assert force["innovation"] == pytest.approx(expected, rel=1e-12)
    n = int(force["n_Z"])
    assert force["regressor"][n - 1] == pytest.approx(whole)
    values = [t.value for t in AIRCRAFT.measurable_forces if t.coefficient == name]
    values += [
        t.value
        for t in AIRCRAFT.forces
        if t.coefficient == "CY" and f == SIDE_INDEX and "betadoth" in dict(t.of)
    ]
    terms = force["regressor"][: n - 1]
    if f == SIDE_INDEX:
        terms = np.append(terms[:-1], terms[-1] / values[-1])
        assert terms[-1] == pytest.approx(per_coefficient() * rate * AIRCRAFT.geometry.span_m / (2 * Y[2]))
    assert np.dot(values, terms) == pytest.approx(whole)


@pytest.mark.parametrize(("f", "name"), [(SIDE_INDEX, "CY"), (NORMAL_INDEX, "CZ")])
def test_a_surface_s_column_is_the_slope_along_it_and_its_errors_are_shares_of_the_terms(f, name):
    fdi = felt(Bounds(coefficients=0.05))
    record = fdi["statistical"]["forces"]
    update_both_forces(record, fdi["statistical"]["gust"], measured(), U, DT)
    force = record["component"][f]
    for s in range(4):
        ahead = U + 1e-4 * np.eye(4)[s]
        slope = per_coefficient() * (coefficient(name, u=ahead) - coefficient(name)) / 1e-4
        assert force["G"][s] == pytest.approx(slope, abs=1e-9)
        assert force["Gu"][s] == pytest.approx(slope * U[s], abs=1e-9)
        own = [
            t
            for t in AIRCRAFT.measurable_forces
            if t.coefficient == name and t.surface == AIRCRAFT.surfaces[s]
        ]
        size = sum(
            abs(t.value) * Y[0] ** dict(t.of).get("alpha", 0) * Y[1] ** dict(t.of).get("beta", 0) for t in own
        )
        assert force["e_G"][s] == pytest.approx(0.05 * per_coefficient() * size)


def test_the_flow_s_rates_are_those_of_a_body_that_moves_on():
    """The velocity through air at rest a moment later, by v' = a + g - x cross v."""
    record, a, phi, theta = felt()["statistical"]["forces"], np.array([0.5, 0.3, -9.5]), 0.2, 0.15
    forces.fill_angle_rates(record, measured())
    alpha, beta, V = Y[:3]
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    g = GRAVITY * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    step = 1e-6
    later = v + step * (a + g - np.cross(X, v))
    now, then = (np.array([np.arcsin(w[1] / np.linalg.norm(w)), np.arctan2(w[2], w[0])]) for w in (later, v))
    assert record["angle_rate"] == pytest.approx((now - then) / step, rel=1e-4)


@pytest.mark.parametrize(("f", "place"), [(SIDE_INDEX, 1), (NORMAL_INDEX, 0)])
def test_followed_by_inertial_motion_a_force_does_not_know_its_vane(f, place):
    """Whatever a vane says after the first frame, what is left of the force is the same but for curvature."""
    courses = np.zeros(30), np.append(0.0, np.random.default_rng(3).normal(0.0, 0.002, 29).cumsum())
    left = []
    for course in courses:
        fdi = felt()
        record = fdi["statistical"]["forces"]
        record["CY_bdot"] = 0.0
        for error in course:
            y = Y.copy()
            y[place] += error
            update_both_forces(record, fdi["statistical"]["gust"], measured(y=y), U, DT)
        left.append(
            (
                record["component"][f]["e_inertial"],
                record["component"][f]["innovation"],
            )
        )
    (inertial, plain), (inertial_too, other) = left
    assert abs(plain - other) > 0.005
    assert abs(inertial - inertial_too) < 0.05 * abs(plain - other)


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
        update_both_forces(
            record, fdi["statistical"]["gust"], measured(X + std[3] * rng.normal(size=3), y), U, DT
        )
        drawn.append(record["component"]["innovation"].copy())
    update_both_forces(record, fdi["statistical"]["gust"], measured(), U, DT)
    assert np.sqrt(record["component"]["var"][:, 0]) == pytest.approx(np.std(drawn, axis=0), rel=0.06)
    without = record["component"]["var"][:, 0] - record["component"]["var"][:, 1]
    slopes = record["component"]["vane"][:, 1] * np.radians([0.02, 0.03])
    assert without == pytest.approx(slopes**2, rel=1e-6)


def test_noise_of_accelerometers_is_jitter_that_the_pressure_does_not_scale():
    """Against a draw, at the trim's pressure and at twice as much; and how far it lets the angle wander."""
    sensors, rng = {"ay": {"noise_std_mps2": 0.04}, "az": {"noise_std_mps2": 0.07}}, np.random.default_rng(8)
    for q_ratio in (1.0, 2.0):
        fdi, y = felt(Bounds(sensors=sensors)), Y * (1.0, 1.0, 1.0, q_ratio, 1.0)
        record, drawn = fdi["statistical"]["forces"], []
        for noise in rng.normal(0.0, (0.04, 0.07), (1500, 2)):
            update_both_forces(
                record, fdi["statistical"]["gust"], measured(y=y, force=(0.5, *(noise - (0.0, 9.5)))), U, DT
            )
            drawn.append(record["component"]["innovation"].copy())
        for inertial in range(2):
            jitter = record["component"]["var"][:, inertial]
            assert np.sqrt(jitter) == pytest.approx(np.std(drawn, axis=0), rel=0.06)
    more = record["component"]["Q_e"] - felt()["statistical"]["forces"]["component"]["Q_e"]
    walked = [(0.04, 0.07)[f] / Y[2] * np.sqrt(DT) for f in (SIDE_INDEX, NORMAL_INDEX)]
    assert np.sqrt(more) == pytest.approx(np.abs(record["component"]["vane"][:, 1]) * walked)


def test_constant_errors_are_tolerated_term_by_term():
    given = Bounds(coefficients=0.05, sensors={"alpha": {"bias_deg": 0.5}, "qdyn": {"bias_pa": 23.0}})
    force = felt(given)["statistical"]["forces"]["component"][NORMAL_INDEX]
    terms = forces.terms_of_force(AIRCRAFT, NORMAL_INDEX)
    shares = force["tol"][: len(terms)] / np.abs([t.value for t in terms])
    assert shares[1:] == pytest.approx(0.05 + 23.0 / 1150.0)
    slope = abs(force["vane"][1]) / per_coefficient()
    of_constant = 0.07 * abs(terms[0].value) + np.radians(0.5) * slope
    assert terms[0].is_constant
    assert force["tol"][0] == pytest.approx(of_constant)
    assert force["tol"][len(terms)] == forces.MASS_TOLERANCE
    assert force["n_Z"] == len(terms) + 1


def test_in_turbulence_gusts_turn_the_flow():
    """By a walk of 3 sigma^2 / (L V) [MIL-F-8785C, 3.7], against a draw of Dryden's vertical gust."""
    still, moving = (
        felt(Bounds(turbulence=air))["statistical"]["forces"]["component"] for air in ("none", "moderate")
    )
    gained = moving["Q_e"] - still["Q_e"]
    sigma, L, V, dt, rng = 10.6 * 0.3048, 533.4, 46.0, 0.01, np.random.default_rng(2)
    more = np.sqrt(gained) / np.abs(moving["vane"][:, 1])
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
        statistical["test"]["alarm_level"],
        statistical["test"]["margin"],
        statistical["test"]["forget"],
    ) = 6.0, 0.5 * 5.0**2, 0.99
    configure_parity_views(statistical, AIRCRAFT)
    configure_tones(statistical["tone_test_config"], 1e-8, 45.0, 15.0, DT)
    for _ in range(2):
        update_both_forces(statistical["forces"], statistical["gust"], measured(), U, DT)
    fdi["layout"]["position"] = range(4)
    return fdi


@pytest.mark.parametrize("v", [ELEVATOR_VIEW, FLAP_VIEW, ALPHA_VIEW, AILERON_VIEW, RUDDER_VIEW, BETA_VIEW])
def test_what_goes_along_a_column_of_rate_and_force_is_not_seen_past_it(viewed, v):
    view, G = viewed["statistical"]["views"][v], np.random.default_rng(7).normal(0.0, 3.0, (3, 4))
    G[1, [0, 2]] = G[0, [1, 3]] = G[2, [1, 3]] = 0.0
    Across.turn(viewed, view, G)
    first, second = view["plane_pair"]
    force = viewed["statistical"]["forces"]["component"][second - SIDE_FORCE]
    s = int(view["nulled"])
    of_it = force["vane"] if s == VANE_VIEW else (G[first, s], force["G"][s])
    assert view["direction"][[first, second]] @ of_it == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)
    assert np.count_nonzero(view["direction"]) == 2
    if s != VANE_VIEW:
        assert Across.changes_view(viewed, view, s, G[:, s]) == 0
        assert Across.changes_view(viewed, view, FLAP if s == ELEVATOR else ELEVATOR, G[:, 1]) == (
            second == NORMAL_FORCE
        )


def test_the_side_vane_is_cleared_across_the_rolling_gust_as_well(viewed):
    """Of roll, yaw and side force: neither the vane's error nor a rolling gust moves what is looked at, and
    what errors of the vane's column let show is the most that its corners do."""
    statistical, rng = viewed["statistical"], np.random.default_rng(3)
    statistical["gust"]["output"]["gusty"] = 1
    configure_parity_views(statistical, AIRCRAFT)
    view, moving = statistical["views"][BETA_VIEW], statistical["gust"]
    moving = moving["output"]
    moving["rate_damping"], moving["C"] = (
        rng.normal(size=(3, 3)),
        np.linalg.qr(rng.normal(size=(3, 3)))[0],
    )
    force = statistical["forces"]["component"][SIDE_INDEX]
    column = np.array([force["vane_roll"], *force["vane"]])
    share = Across.turn(viewed, view, np.zeros((3, 4)))
    mix = view["direction"][[ROLL, YAW, SIDE_FORCE]]
    assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)
    assert mix @ column == pytest.approx(0.0, abs=1e-12)
    gust = (moving["rate_damping"] @ moving["C"])[:, 0]
    assert view["direction"][:3] @ gust == pytest.approx(0.0, abs=1e-12)
    assert view["direction"][PITCH] == view["direction"][NORMAL_FORCE] == 0.0
    assert view["col"][[ROLL, YAW, SIDE_FORCE]] == pytest.approx(column / np.linalg.norm(column))
    corners = np.stack(np.meshgrid(*[(-0.1, 0.1)] * 3)).reshape(3, -1).T * column
    assert share == pytest.approx(np.max(np.abs(corners @ mix)) / (0.9 * np.linalg.norm(column)))
    n = int(view["block"]["n_Z"])
    Across.regress(viewed, view, np.zeros(3), share)
    view["confirmer"] = 0
    Across.regress(viewed, view, np.array([0.4, 7.0, -0.3]), share)
    seen = np.array([0.4, -0.3, force["innovation"]])
    assert view["block"]["regressor"][n - 1, 0] == pytest.approx(
        share * seen @ column / np.linalg.norm(column)
    )


def test_only_what_is_mostly_a_force_raises_the_alarm(viewed):
    views = viewed["statistical"]["views"]
    viewed["statistical"]["test"]["margin"] = 18.0
    for v, mix, alarms in (
        (ELEVATOR_VIEW, (0.0, 0.3, 0.0, 0.0, -0.95), True), (FLAP_VIEW, (0.0, 0.95, 0.0, 0.0, 0.3), False),
        (AILERON_VIEW, (0.03, 0.0, 0.0, 1.0, 0.0), True), (ALPHA_VIEW, (0.0, 0.1, 0.0, 0.0, 0.99), False),
        (SIDE_VIEW, (0.0, 0.0, 0.0, 1.0, 0.0), False),
    ):  # fmt: skip
        views["direction"][v], views["peak"][:] = mix, 9.0
        assert (Across.alarm(viewed["statistical"], views[v]) > 0.0) == alarms


def test_what_clears_a_vane_excludes_nobody(viewed):
    statistical = viewed["statistical"]
    views = statistical["views"]
    for v in (ALPHA_VIEW, UP_VIEW):
        views["peak"][v], views["block"]["hypothesis"]["score"][v, 0] = 50.0, 50.0
    assert not any(Across.excludes(viewed, s) for s in range(4))


def test_a_loss_signs_with_the_force_it_takes(viewed):
    view, Gu = viewed["statistical"]["views"][FLAP_VIEW], np.random.default_rng(1).normal(size=(3, 4))
    view["direction"] = 0.0, 0.9, 0.0, 0.0, 0.4
    Across.sign(viewed, view, Gu)
    moment = viewed["statistical"]["forces"]["component"][NORMAL_INDEX]["Gu"][ELEVATOR]
    assert view["block"]["hypothesis"]["signature"][:2, 0] == pytest.approx(
        [1.0, 0.9 * Gu[1, ELEVATOR] + 0.4 * moment]
    )


@pytest.mark.parametrize("v", [ELEVATOR_VIEW, UP_VIEW, RUDDER_VIEW])
def test_what_is_declared_of_rate_and_force_is_seen_along_a_direction(viewed, v):
    statistical, rng = viewed["statistical"], np.random.default_rng(6)
    (
        statistical["noise"]["Q"],
        statistical["noise"]["eta"],
        statistical["noise"]["q"],
    ) = (
        (1e-6, 4e-6, 9e-6),
        0.02,
        2.0,
    )
    air, view, component = statistical["gust"], statistical["views"][v], statistical["forces"]["component"]
    air["output"]["gusty"], air["output"]["rate_damping"], air["output"]["C"] = (
        1,
        rng.normal(size=(3, 3)),
        np.eye(3),
    )
    air["memory"]["Q"] = 1e-5, 2e-5, 3e-5
    component["var"], component["eta_u"] = (
        ((2e-6, 1e-7), (3e-5, 2e-5)),
        (0.001, 0.002),
    )
    component["Q_e"], statistical["forces"]["q_ratio"] = (
        (1e-4, 2e-4),
        1.2,
    )
    for name in (
        "gusty",
        "rate_damping",
        "C",
        "Q",
    ):
        holder(statistical["vaneless"], name)[name] = holder(air, name)[name]
    (
        air["memory"]["share"],
        statistical["vaneless"]["memory"]["share"],
    ) = (
        (1.0, 0.25, 0.09),
        (1.0, 0.36, 0.16),
    )
    seen = statistical["vaneless" if view["vane_free"] else "gust"]["memory"]["share"]
    Across.turn(viewed, view, rng.normal(size=(3, 4)))
    Across.blur(view, statistical, 45.0)
    m, block = view["direction"], view["block"]
    rate_gust_sensitivity, force_gust_sensitivity = (
        np.abs(m[:3] @ air["output"]["rate_damping"]),
        1.2 * np.abs(m[3:] @ component["L"]),
    )
    gusts = 45.0 * np.sum(
        (np.sqrt(seen) * rate_gust_sensitivity + force_gust_sensitivity) ** 2 * air["memory"]["Q"]
    )
    sizes = np.sqrt(
        [
            *statistical["noise"]["Q"],
            *component["var"][:, int(view["by_inertia"])],
        ]
    )
    assert block["Q_x"][0] == pytest.approx((np.abs(m) @ sizes) ** 2)
    bound = np.abs(m) @ [0.02, 0.02, 0.02, 0.0012, 0.0024]
    assert view["eta"][0] == pytest.approx(bound)
    of_forces = m[3:] ** 2 @ component["Q_e"]
    drift_intensity = 1.2**2 * view["by_inertia"] * of_forces
    assert block["Q_d"][0, 0] == pytest.approx(gusts + drift_intensity + 2.0 * max(bound, 1e-3) ** 2)


def test_without_vanes_the_flow_is_what_the_forces_say():
    """A vane that is off by little: forces give back where the flow is."""
    fdi = felt()
    record, air = fdi["statistical"]["forces"], fdi["statistical"]["gust"]
    update_both_forces(record, air, measured(), U, DT)
    sound = [
        measured().force[1 + f] - record["component"][f]["innovation"] * AIRCRAFT.geometry.chord_m
        for f in (SIDE_INDEX, NORMAL_INDEX)
    ]
    off = Y + np.array([0.004, -0.003, 0.0, 0.0, 0.0])
    update_both_forces(record, air, measured(y=off, force=(0.5, *sound)), U, DT)
    forces.fill_vaneless_y(record, np.zeros(3), np.append(off, np.zeros(record["y_free"].size - 5)))
    assert record["y_free"][:5] == pytest.approx(Y, abs=6e-4), "an eighth of what they are off"
    still, turning = record["y_free"][:2].copy(), np.array([0.02, -0.03, 0.01])
    forces.fill_vaneless_y(record, turning, np.append(off, np.zeros(record["y_free"].size - 5)))
    damped = record["component"]["L"] @ turning / record["component"]["vane"][:, 1]
    assert still - record["y_free"][:2] == pytest.approx(damped[::-1])
