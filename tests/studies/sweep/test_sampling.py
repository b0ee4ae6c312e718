import numpy as np
import pytest
from scipy import stats

from beaver_ftc.scenario.sweeps import Variation
from beaver_ftc.studies.sweep.sampling import Plan, value_at

from .conftest import sweep_of

DRAWN = """\
base: fault-free
runs: 64
seed: 5
sampling: METHOD
vary:
  initial.airspeed_mps: {uniform: [40, 50]}
  initial.altitude_m: {loguniform: [10, 1000]}
  uncertainty.inertia_coupling.p: {uniform: [-0.25, 0.25]}
"""


def unit(plan_values: list[dict]) -> np.ndarray:
    """The values of DRAWN back on the unit cube."""
    speed, height, p = (
        np.array(list(column)) for column in zip(*(v.values() for v in plan_values), strict=True)
    )
    return np.column_stack([(speed - 40) / 10, np.log10(height / 10) / 2, (p + 0.25) / 0.5])


@pytest.mark.parametrize("method", ["random", "lhs", "sobol"])
def test_a_flight_has_its_values_whichever_are_asked_for(method):
    sweep = sweep_of(DRAWN, METHOD=method)
    whole = Plan(sweep).assignments(range(64))
    for some in ([17], [3, 4, 5, 40], range(50, 64)):
        assert Plan(sweep).assignments(some) == [whole[index] for index in some]


def test_a_latin_hypercube_has_one_flight_in_each_slice_of_each_key():
    cube = unit([flight.values for flight in Plan(sweep_of(DRAWN, METHOD="lhs")).assignments(range(64))])
    slices = np.sort((cube * 64).astype(int), axis=0)
    np.testing.assert_array_equal(slices, np.tile(np.arange(64)[:, None], 3))


def test_sobol_points_fill_the_cube_evenly():
    cube = unit([flight.values for flight in Plan(sweep_of(DRAWN, METHOD="sobol")).assignments(range(64))])
    for column in cube.T:  # a scrambled net in base 2 has as many points in every dyadic interval
        np.testing.assert_array_equal(np.bincount((column * 16).astype(int), minlength=16), 4)
    assert stats.qmc.discrepancy(cube) < 0.01  # 64 random points have about 0.03


def test_a_grid_visits_every_combination_once():
    grid = """\
base: elevator-partial-loss
sampling: grid
vary:
  faults[0].actuator: {choice: [aileron, rudder]}
  faults[0].magnitude: {linspace: [0.1, 0.7, 3]}
"""
    sweep = sweep_of(grid)
    flights = [tuple(flight.values.values()) for flight in Plan(sweep).assignments(range(sweep.flights))]
    assert sweep.flights == 6
    assert flights == [(a, m) for a in ("aileron", "rudder") for m in (0.1, pytest.approx(0.4), 0.7)]


@pytest.mark.parametrize(
    ("how", "law"),
    [
        ({"uniform": (2.0, 5.0)}, stats.uniform(2, 3)),
        ({"loguniform": (0.01, 10.0)}, stats.loguniform(0.01, 10)),
        ({"normal": (45.0, 3.0)}, stats.norm(45, 3)),
        ({"normal": (45.0, 3.0), "within": (44.0, 51.0)}, stats.truncnorm(-1 / 3, 2, 45, 3)),
    ],
)
def test_a_value_is_the_inverse_of_its_distribution(how, law):
    u = np.linspace(0.01, 0.99, 21)
    values = [value_at(Variation(**how), share) for share in u]
    np.testing.assert_allclose(law.cdf(values), u, atol=1e-9)


@pytest.mark.parametrize("u", [0.0, 1.0 - 2.0**-53])
def test_the_ends_of_the_unit_interval_stay_inside(u):
    assert 36 <= value_at(Variation(normal=(45.0, 3.0), within=(36.0, 54.0)), u) <= 54
    assert abs(value_at(Variation(normal=(0.0, 1.0)), u)) < 10
    assert 0.1 <= value_at(Variation(loguniform=(0.1, 0.3)), u) <= 0.3
    assert value_at(Variation(choice=("a", "b")), u) in "ab"
    assert value_at(Variation(linspace=(0.2, 0.8, 1)), u) == 0.2
