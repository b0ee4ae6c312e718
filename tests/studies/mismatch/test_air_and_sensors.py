"""Sources no built-in scenario has yet: turning air, from JSBSim's own turbulence, and erring sensors."""

import numpy as np
import pytest

from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.channels import TRUTH
from beaver_ftc.plant.trim import trim
from beaver_ftc.studies.mismatch.models import States, air_name, measured_name, states_of
from beaver_ftc.studies.mismatch.sources import SOURCES, Models, instantaneous
from beaver_ftc.studies.mismatch.split import split
from flying import flown, scenario

PROPERTY = {name: (path, factor) for name, path, factor in TRUTH}
ROUNDING = 5e-8  # rad/s2
CALM = scenario(uncertainty={})


def flight_in_turbulence(frames=200):
    """States of an open-loop flight through JSBSim's MIL-F-8785C turbulence."""
    plant = Plant(100)
    point = trim(45, 1000, plant=plant)
    plant.start(point)
    plant.write("simulation/randomseed", 7)
    plant.write("atmosphere/turb-type", 3)
    plant.write("atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps", 75)
    plant.write("atmosphere/turbulence/milspec/severity", 6)
    rows = []
    for k in range(frames):
        if k:
            plant.run()
        rows.append(row(plant, k / 100))
    columns = {name: np.array([each[name] for each in rows]) for name in rows[0]}
    for s in ("aileron", "elevator", "rudder", "flap"):
        for what in ("cmd", "pos", "effective"):
            columns[f"{s}_{what}_rad"] = np.full(frames, getattr(point, f"{s}_rad"))
    return states_of(columns)


def row(plant, t_s):
    of = {name: plant.read(path) * factor for name, (path, factor) in PROPERTY.items()}
    air = {air_name(f"{axis}_rad_s"): plant.read(f"velocities/{axis}-aero-rad_sec") for axis in "pqr"}
    unused = {f"{axis}_{what}_rad_s2": 0.0 for axis in "pqr" for what in ("eta_bar", "design")}
    return of | air | unused | {"t_s": t_s, "north_m": 0.0}


def test_turbulence_is_its_own_source_and_leaves_nothing():
    states = flight_in_turbulence()
    assert np.abs(states.x_air - states.x).max() > 1e-3
    case = Models(CALM)
    contributions, _ = instantaneous(case, states)
    designed = case.design_model.acceleration(states.x_measured, states.y_measured, states.u)
    rest = states.xdot - designed - sum(contributions.values())
    assert np.abs(contributions["wind_turbulence"]).max() > 1e-3
    assert np.abs(rest).max() <= ROUNDING


def test_without_columns_for_it_the_air_does_not_turn_and_sensors_do_not_err():
    _, log = flown(uncertainty={}, duration_s=1)
    states = states_of({name: log[name] for name in log.columns})
    assert np.array_equal(states.x_air, states.x)
    assert np.array_equal(states.y_measured, states.y)


@pytest.mark.parametrize(
    ("column", "error"), [("q_rad_s", 0.01), ("alpha_rad", 0.02), ("qdyn_pa", 30.0), ("dpt", 0.1)]
)
def test_an_erring_sensor_shows_as_the_model_at_the_true_state_less_that_at_the_measured(column, error):
    """With the measurement off by a constant, what sensors add is all that the total has changed by."""
    _, log = flown(uncertainty={}, duration_s=2)
    columns = {name: log[name] for name in log.columns}
    assert measured_name("q_rad_s") == "q_measured_rad_s"
    plain, _ = split(CALM, [columns])
    off = columns | {measured_name(column): columns[column] + error}
    states = states_of(off)
    designed = Models(CALM).design_model
    made_of_it = designed.acceleration(states.x_measured, states.y_measured, states.u)
    for i, axis in enumerate("pqr"):  # what the diagnosis would have logged, one row later
        off[f"{axis}_design_rad_s2"] = np.concatenate([[0.0], made_of_it[:-1, i]])
    erring, _ = split(CALM, [off])
    change = erring.total - plain.total
    assert np.abs(change).max() > 1e-4
    assert erring.contributions["sensors"] == pytest.approx(change, abs=1e-9)
    assert np.abs(erring.unexplained).max() <= ROUNDING
    assert all(
        np.array_equal(erring.contributions[name], plain.contributions[name])
        for name in SOURCES
        if name not in ("sensors", "integration")
    )
    assert isinstance(states, States)
