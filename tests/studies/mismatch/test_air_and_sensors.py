"""Turning air as a source, from JSBSim's own turbulence; without columns for it the air does not turn."""

import numpy as np

from beaver_ftc.design.model import acceleration_at
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.channels import TRUTH
from beaver_ftc.plant.trim import trim
from beaver_ftc.studies.mismatch.sources import Models, instantaneous
from beaver_ftc.studies.mismatch.states import column_of, states_of
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
    air = {column_of("air", f"{axis}_rad_s"): plant.read(f"velocities/{axis}-aero-rad_sec") for axis in "pqr"}
    unused = {f"{axis}_{what}_rad_s2": 0.0 for axis in "pqr" for what in ("eta_bar", "design")}
    return of | air | unused | {"t_s": t_s, "north_m": 0.0}


def test_turbulence_is_its_own_source_and_leaves_nothing():
    states = flight_in_turbulence()
    assert np.abs(states.x_air - states.x).max() > 1e-3
    case = Models(CALM)
    contributions, _ = instantaneous(case, states)
    designed = acceleration_at(case.design, states.x_measured, states.y_measured, states.u)
    rest = states.xdot - designed - sum(contributions.values())
    assert np.abs(contributions["wind_turbulence"]).max() > 1e-3
    assert np.abs(rest).max() <= ROUNDING


def test_without_columns_for_it_the_air_does_not_turn_and_sensors_do_not_err():
    _, log = flown(uncertainty={}, duration_s=1)
    states = states_of({name: log[name] for name in log.columns})
    assert np.array_equal(states.x_air, states.x)
    assert np.array_equal(states.y_measured, states.y)
