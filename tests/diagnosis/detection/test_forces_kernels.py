"""What accelerometers say of the surfaces, a kernel at a time, against sums, differences and draws."""

import numpy as np
import pytest
from kernels import new_fdi

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.aircraft.schema import SIDESLIP_RATE
from beaver_ftc.design.table import fill_table
from beaver_ftc.diagnosis.detection import flow_angles
from beaver_ftc.diagnosis.detection.blocks import SIDE_FORCE
from beaver_ftc.diagnosis.detection.forces import NORMAL_INDEX, SIDE_INDEX, update_forces
from beaver_ftc.diagnosis.detection.forces_design import configure_forces
from beaver_ftc.diagnosis.detection.rows import INERTIAL, RAW
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.scenario.diagnosis import Bounds
from flying import declared_in

AIRCRAFT = load()
X, U = np.array([0.05, -0.03, 0.04]), np.array([0.06, -0.08, 0.05, 0.1])
Y = np.array([0.11, 0.07, 46.0, 1150.0, 2.1])
ALONG_Y = np.arange(15.0).reshape(3, 5)
DT, GRAVITY, FIRST = 0.01, 9.80665, (0, 70)


def feel(fdi, seen):
    """Show the forces an instant."""
    statistical, du = fdi["statistical"], np.zeros(4)
    update_forces(statistical["rows"], statistical["forces"], statistical["gust"], du, seen, U, DT)


def measured(x=X, y=Y, force=(0.5, 0.3, -9.5)):
    record = np.zeros(1, MEASURED).view(np.recarray)[0]
    record["x"], record["y"][:5], record["force"], record["attitude"][:2] = x, y, force, (0.2, 0.15)
    return record


def felt(**declared):
    """A diagnosis whose forces are set up at X, Y, U, with these errors declared."""
    fdi = new_fdi()
    statistical = fdi["statistical"]
    air = statistical["gust"]
    fill_table(air["memory"]["table"], AIRCRAFT, AIRCRAFT.measurable_forces, FORCES)
    air["config"]["S_m"] = AIRCRAFT.geometry.wing_area_m2 / AIRCRAFT.mass.mass_kg
    air["config"]["gravity"], air["config"]["span"] = GRAVITY, AIRCRAFT.geometry.span_m
    air["config"]["L_gust"], statistical["forces"]["in_use"] = 533.4, 1
    air["output"]["uses_accelerometers"] = 1
    statistical["rows"]["first"] = FIRST
    configure_forces(fdi, declared_in(Bounds(**declared), AIRCRAFT), (X, Y, U), ALONG_Y, DT)
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
    feel(fdi, seen)
    whole = per_coefficient() * coefficient(name, rate=rate)
    force = record["component"][f]
    expected = seen["force"][1 + f] / AIRCRAFT.geometry.chord_m - whole
    assert force["innovation"] == pytest.approx(expected, rel=1e-12)
    n = int(force["n_Z"])
    columns = fdi["statistical"]["rows"]["Z"][FIRST[f] : FIRST[f] + n, 3 + f]
    assert columns[-1] == pytest.approx(whole)
    values = [t.value for t in AIRCRAFT.measurable_forces if t.coefficient == name]
    values += [
        t.value
        for t in AIRCRAFT.forces
        if t.coefficient == "CY" and f == SIDE_INDEX and "betadoth" in dict(t.of)
    ]
    terms = columns[:-1]
    if f == SIDE_INDEX:
        terms = np.append(terms[:-1], terms[-1] / values[-1])
        assert terms[-1] == pytest.approx(per_coefficient() * rate * AIRCRAFT.geometry.span_m / (2 * Y[2]))
    assert np.dot(values, terms) == pytest.approx(whole)


@pytest.mark.parametrize(("f", "name"), [(SIDE_INDEX, "CY"), (NORMAL_INDEX, "CZ")])
def test_a_surface_s_column_is_the_slope_along_it_and_its_errors_are_shares_of_the_terms(f, name):
    fdi = felt(coefficients=0.05)
    feel(fdi, measured())
    rows = fdi["statistical"]["rows"]
    for s in range(4):
        ahead = U + 1e-4 * np.eye(4)[s]
        slope = per_coefficient() * (coefficient(name, u=ahead) - coefficient(name)) / 1e-4
        assert rows["G"][s, 3 + f] == pytest.approx(slope, abs=1e-9)
        assert rows["Gu"][s, 3 + f] == pytest.approx(slope * U[s], abs=1e-9)
        own = [
            t
            for t in AIRCRAFT.measurable_forces
            if t.coefficient == name and t.surface == AIRCRAFT.surfaces[s]
        ]
        size = sum(
            abs(t.value) * Y[0] ** dict(t.of).get("alpha", 0) * Y[1] ** dict(t.of).get("beta", 0) for t in own
        )
        assert rows["e_G"][s, 3 + f] == pytest.approx(0.05 * per_coefficient() * size)


def test_the_flow_s_rates_are_those_of_a_body_that_moves_on():
    """The velocity through air at rest a moment later, by v' = a + g - x cross v."""
    record, a, phi, theta = felt()["statistical"]["forces"], np.array([0.5, 0.3, -9.5]), 0.2, 0.15
    flow_angles.fill_angle_rates(record, GRAVITY, measured())
    alpha, beta, V = Y[:3]
    v = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    g = GRAVITY * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    step = 1e-6
    later = v + step * (a + g - np.cross(X, v))
    now, then = (np.array([np.arcsin(w[1] / np.linalg.norm(w)), np.arctan2(w[2], w[0])]) for w in (later, v))
    assert record["angle_rate"] == pytest.approx((now - then) / step, rel=1e-4)


def test_noise_of_the_readings_is_jitter_of_the_forces():
    """Against the spread of e over readings that are drawn."""
    sensors = {
        "alpha": {"noise_std_deg": 0.03}, "beta": {"noise_std_deg": 0.02}, "V": {"noise_std_mps": 0.1},
        "qdyn": {"noise_std_pa": 4.0}, **{axis: {"noise_std_deg_s": 0.05} for axis in "pqr"},
    }  # fmt: skip
    fdi, rng = felt(sensors=sensors), np.random.default_rng(4)
    record, drawn = fdi["statistical"]["forces"], []
    std = np.radians([0.03, 0.02]), 0.1, 4.0, np.radians(0.05)
    for _ in range(1500):
        y = Y + np.array([*(std[0] * rng.normal(size=2)), std[1] * rng.normal(), std[2] * rng.normal(), 0.0])
        feel(fdi, measured(X + std[3] * rng.normal(size=3), y))
        drawn.append(record["component"]["innovation"].copy())
    feel(fdi, measured())
    noise = fdi["statistical"]["rows"]["std"][:, SIDE_FORCE:]
    assert noise[RAW] == pytest.approx(np.std(drawn, axis=0), rel=0.06)
    without = noise[RAW] ** 2 - noise[INERTIAL] ** 2
    slopes = record["component"]["e_vane"] * np.radians([0.02, 0.03])
    assert without == pytest.approx(slopes**2, rel=1e-6)


def test_in_turbulence_gusts_turn_the_flow():
    """By a walk of 3 sigma^2 / (L V) [MIL-F-8785C, 3.7], against a draw of Dryden's vertical gust."""
    still, moving = (
        felt(turbulence=air)["statistical"]["forces"]["component"] for air in ("none", "moderate")
    )
    gained = moving["Q_e"] - still["Q_e"]
    sigma, L, V, dt, rng = 10.6 * 0.3048, 533.4, 46.0, 0.01, np.random.default_rng(2)
    more = np.sqrt(gained) / np.abs(moving["e_vane"])
    tau, n = L / V, 40_000  # (1 + sqrt(3) tau s) / (1 + tau s)^2, of white noise of intensity sigma^2 tau
    noise, one, two, gust = rng.normal(0.0, sigma * np.sqrt(tau / dt), n), 0.0, 0.0, np.empty(n)
    for k in range(n):
        one += dt * (noise[k] - one) / tau
        two += dt * (one - two) / tau
        gust[k] = two + np.sqrt(3.0) * (one - two)
    assert more == pytest.approx(np.std(np.diff(gust)) / V / np.sqrt(dt), rel=0.03)


def test_without_vanes_the_flow_is_what_the_forces_say():
    """A vane that is off by little: forces give back where the flow is."""
    fdi = felt()
    record = fdi["statistical"]["forces"]
    feel(fdi, measured())
    sound = [
        measured().force[1 + f] - record["component"][f]["innovation"] * AIRCRAFT.geometry.chord_m
        for f in (SIDE_INDEX, NORMAL_INDEX)
    ]
    off = Y + np.array([0.004, -0.003, 0.0, 0.0, 0.0])
    feel(fdi, measured(y=off, force=(0.5, *sound)))
    flow_angles.fill_vaneless_y(record, np.zeros(3), np.append(off, np.zeros(record["y_free"].size - 5)))
    assert record["y_free"][:5] == pytest.approx(Y, abs=6e-4), "an eighth of what they are off"
    still, turning = record["y_free"][:2].copy(), np.array([0.02, -0.03, 0.01])
    flow_angles.fill_vaneless_y(record, turning, np.append(off, np.zeros(record["y_free"].size - 5)))
    damped = record["component"]["L"] @ turning / record["component"]["e_vane"]
    assert still - record["y_free"][:2] == pytest.approx(damped[::-1])
