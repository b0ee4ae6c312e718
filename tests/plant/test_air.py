"""Wind, gust, turbulence, mass, inertia and centre of gravity: against theory, and against each other."""

import numpy as np
import pytest

from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.true_aircraft import configure, take_off, trim_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.truth import Truth

SPAN_FT, SCALE_FT, FT = 48.0, 1750.0, 0.3048
AIR = [f"atmosphere/turb-{to}-fps" for to in ("north", "east", "down")]
ROTATION = [f"atmosphere/{axis}-turb-rad_sec" for axis in "pqr"]


def airborne(**given):
    scenario = Scenario.model_validate({"name": "x", **given})
    plant = Plant(100)
    truth = Truth.of(scenario)
    configure(plant, truth)
    trim = trim_of(truth, plant)
    take_off(plant, truth, trim)
    return plant, trim


def flown(plant, names, frames):
    rows = np.empty((frames, len(names)))
    nodes = [plant.node(name) for name in names]
    for row in rows:
        plant.run()
        row[:] = [node.get_double_value() for node in nodes]
    return rows


def test_in_a_steady_wind_the_aircraft_flies_as_in_still_air_and_drifts():
    names = ["aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps", "attitude/theta-rad"]
    over_ground = ["velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps"]
    still, _ = airborne()
    windy, _ = airborne(environment={"wind_mps": [12.0, -7.0, 1.5]})
    a, b = (flown(plant, names + over_ground, 300) for plant in (still, windy))
    assert b[:, :4] == pytest.approx(a[:, :4], rel=1e-3, abs=2e-4)
    assert (b - a)[-1, 4:] * FT == pytest.approx([12.0, -7.0, 1.5], abs=0.02)


def test_dryden_turbulence_has_the_variances_and_the_memory_of_the_specification():
    """[MIL-F-8785C, fig. 7]: 7.4 ft/s at 3750 ft; rolling as in [Yeager1998, eq. 8 to 10]."""
    rate_hz, products, squares = 20, [], []
    for seed in range(20):
        scenario = Scenario.model_validate({
            "name": "x",
            "seed": seed,
            "initial": {"altitude_m": 3750 * FT},
            "environment": {"turbulence": "dryden", "severity": "light"},
        })  # fmt: skip
        plant = Plant(rate_hz)
        take_off(plant, Truth.of(scenario), trim_of(Truth.of(scenario), plant))
        rows = flown(plant, [*AIR, *ROTATION], 80 * rate_hz)[20 * rate_hz :]
        squares.append(np.mean(rows**2, axis=0))
        products.append(np.mean(rows[2 * rate_hz :, 2] * rows[: -2 * rate_hz, 2]))
    sigma = np.sqrt(np.mean(squares, axis=0))
    assert sigma[2] == pytest.approx(7.4, rel=0.15)
    assert np.hypot(*sigma[:2]) == pytest.approx(7.4 * np.sqrt(2), rel=0.15)
    # JSBSim turns the rotation with the heading, so its length is compared; pitch and yaw from the
    # high-frequency limit of their spectra, 1.5 pi / 4 and 1.5 pi / 3 times sigma^2 / (L b)
    rotation = 7.4 * np.sqrt((1.9**2 + 1.5 * np.pi / 4 + 1.5 * np.pi / 3) / (SCALE_FT * SPAN_FT))
    assert np.linalg.norm(sigma[3:]) == pytest.approx(rotation, rel=0.12)
    assert (sigma[3:] < Dryden("light").rotation_limit_rad_s(14.63)).all()
    way = 2.0 * 45.0 / FT / SCALE_FT  # in two seconds, over the scale: the transverse correlation of Dryden
    assert np.mean(products) / sigma[2] ** 2 == pytest.approx((1 - way / 2) * np.exp(-way), abs=0.08)


def test_turbulence_repeats_with_its_seed_only():
    runs = [
        flown(airborne(seed=s, environment={"turbulence": "dryden", "severity": "moderate"})[0], AIR, 50)
        for s in (5, 5, 6)
    ]
    assert (runs[0] == runs[1]).all()
    assert (runs[0] != runs[2]).any()


def test_mass_and_inertia_are_what_was_asked_and_nothing_else_moves():
    nominal, _ = airborne()
    heavy, _ = airborne(uncertainty={"mass": 1.1, "inertia": {"Ix": 1.05, "Iy": 0.95, "Iz": 1.02}})
    names = [*(f"inertia/{i}-slugs_ft2" for i in ("ixx", "iyy", "izz", "ixz")), "inertia/mass-slugs"]
    ratio = [heavy.read(name) / nominal.read(name) for name in names]
    assert ratio == pytest.approx([1.05, 0.95, 1.02, 1.0, 1.1], rel=1e-4)
    assert heavy.read("inertia/cg-x-in") == pytest.approx(0.0, abs=1e-12)


def test_a_centre_of_gravity_further_forward_needs_the_moment_of_the_weight():
    """M about the new point: the trimmed normal force times the shift, to be balanced by the elevator."""
    forward = 0.05
    _, nominal = airborne()
    _, moved = airborne(uncertainty={"cg_m": [forward, 0.0, 0.0]})
    V = nominal.airspeed_mps
    weight = 2288.231 * 9.8 * np.cos(nominal.theta_rad)
    qdyn = 0.5 * 1.0247 * V * V  # at 1828.8 m of the standard atmosphere
    change = -weight * forward / (qdyn * 23.23 * 1.5875) / 1.921
    assert moved.elevator_rad - nominal.elevator_rad == pytest.approx(change, rel=0.1)


def test_a_gust_rises_to_its_height_and_fades():
    from beaver_ftc.loop.loop import Loop

    gust = {"at_s": 1.0, "velocity_mps": [0.0, 3.0, -4.0], "rise_s": 0.5, "hold_s": 1.0, "fade_s": 0.5}
    scenario = Scenario.model_validate({"name": "x", "duration_s": 4, "environment": {"gust": gust}})
    loop = Loop(scenario)
    down = []
    for k in range(400):
        loop.fly_chunk(k, 1)
        down.append(loop.plant.read("atmosphere/total-wind-down-fps") * FT)
    at = {t: down[round(t * 100)] for t in (0.9, 1.25, 2.0, 2.75, 3.5)}
    assert (at[0.9], at[3.5]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert at[2.0] == pytest.approx(-4.0)
    assert at[1.25] == pytest.approx(-2.0, abs=0.15)
    assert at[2.75] == pytest.approx(-2.0, abs=0.15)
