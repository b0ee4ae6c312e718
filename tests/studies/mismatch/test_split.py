"""The split on flights of JSBSim: it must account for all that was declared, and for nothing that was not."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.plant import conditions
from beaver_ftc.plant.true_aircraft import configure
from beaver_ftc.scenario.builtin import builtin_names
from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.studies.mismatch.sources import SOURCES, name_of
from beaver_ftc.studies.mismatch.split import split_flight
from beaver_ftc.studies.mismatch.variants import variant_of
from flying import flown, loss, scenario
from given import given

GIVEN = given(__file__)

PUBLISHED_BOUND = 0.02  # rad/s2
ROUNDING = 5e-8  # rad/s2: what unit conversions and rounding of the aircraft's XML may leave
NOTHING = {"inertia_coupling": {"p": 0, "q": 0, "r": 0}, "sinusoid": {}}


def frames_with(**keys):
    """The split flight, its last row left out."""
    whole, _ = split_flight(scenario(**keys))
    cut = {name: getattr(whole, name)[:-1] for name in ("t_s", "total", "eta_bar", "place")}
    parts = {name: values[:-1] for name, values in whole.contributions.items()}
    details = {of: {name: v[:-1] for name, v in each.items()} for of, each in whole.details.items()}
    return replace(whole, **cut, contributions=parts, details=details)


def largest(values):
    return float(np.abs(values).max())


@pytest.mark.parametrize("name", [name for name in builtin_names() if load_scenario(name).airframe is load()])
def test_unexplained_is_at_most_one_percent_of_every_built_in_scenario(name):
    kept, _ = split_flight(load_scenario(name))
    assert all(kept.magnitudes(kept.named["unexplained"], axis)["share"] <= 0.01 for axis in range(3))
    assert largest(kept.named["unexplained"]) <= 1e-6


@pytest.mark.parametrize(
    "initial", [{}, {"airspeed_mps": 33, "altitude_m": 500, "flap_deg": 10}, {"airspeed_mps": 54}]
)
def test_with_nothing_declared_truth_and_design_differ_by_the_earth_alone(initial):
    found = frames_with(uncertainty=NOTHING, initial=initial, duration_s=10)
    assert largest(found.total) <= 0.02 * PUBLISHED_BOUND
    assert largest(found.named["unexplained"]) <= 0.02 * PUBLISHED_BOUND
    assert largest(found.named["unexplained"]) <= ROUNDING
    others = [name for name in SOURCES if name not in ("earth_rotation", "integration")]
    assert all(largest(found.contributions[name]) == 0.0 for name in others)


DECLARED = GIVEN["declared"]


@pytest.mark.parametrize(("source", "keys"), DECLARED.items())
def test_each_declaration_shows_in_its_own_source_alone_and_leaves_nothing(source, keys):
    found = frames_with(**{"uncertainty": NOTHING, "duration_s": 8, **keys})
    assert largest(found.contributions[source]) > 1e-5
    assert largest(found.contributions["integration"]) < largest(found.contributions[source])
    allowed = {source, "earth_rotation", "integration"}
    assert all(largest(found.contributions[name]) == 0.0 for name in SOURCES if name not in allowed)
    assert largest(found.named["unexplained"]) <= ROUNDING


def test_a_coarse_frame_means_the_mismatch_over_its_jsbsim_frames():
    """A sinusoid at the frame's start, and its mean over five JSBSim frames: the rest is integration."""
    wave = {"sinusoid": {"q": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 15}}}
    found = frames_with(uncertainty=wave, substeps=5, duration_s=4)
    within = found.t_s[:, None] + np.arange(5) / 500
    mean = (0.02 * np.sin(15 * within)).mean(axis=1)
    assert found.total[:, 1] == pytest.approx(mean, abs=2e-5)
    integration = mean - 0.02 * np.sin(15 * found.t_s)
    assert found.contributions["integration"][:, 1] == pytest.approx(integration, abs=2e-5)
    assert largest(found.named["unexplained"]) <= ROUNDING


FAULTS = GIVEN["faults"]


@pytest.mark.parametrize("actuators", ["ideal", "servo"])
@pytest.mark.parametrize("faults", FAULTS.values(), ids=FAULTS)
def test_every_fault_is_accounted_for_part_by_part(faults, actuators):
    found = frames_with(uncertainty=NOTHING, faults=faults, actuators=actuators, duration_s=7)
    parts = found.details["fault"]
    assert parts.keys() == {name_of(fault) for fault in scenario(faults=faults).faults}
    assert all(largest(part) > 1e-4 for part in parts.values())
    assert sum(parts.values()) == pytest.approx(found.contributions["fault"], abs=1e-15)
    before = found.t_s < 3.0 - 1e-9
    assert all(largest(part[before]) == 0.0 for part in parts.values())
    assert largest(found.named["unexplained"]) <= ROUNDING


def test_what_nobody_declared_is_unexplained(monkeypatch):
    """Tamper with the truth behind the scenario's back: Cm_alpha 10 % up shows, and nowhere else."""

    def tampered(plant, case):
        configure(plant, case)
        plant.write("uncertainty/Cm_alpha-scale", 1.1)

    monkeypatch.setattr(conditions, "configure", tampered)
    keys = {"uncertainty": NOTHING, "duration_s": 5}
    _, log = flown(**keys)
    found = frames_with(**keys)
    term = 0.1 * -0.6028 * log["alpha_rad"] * log["qdyn_pa"] * 23.23 * 1.5875 / 6928.93
    assert found.named["unexplained"][:, 1] == pytest.approx(term[:-1], abs=ROUNDING)
    assert largest(found.named["unexplained"][:, [0, 2]]) <= ROUNDING


def test_total_is_jsbsims_acceleration_less_f_and_G_u():
    """One JSBSim frame a frame: what the log's own columns say, but for the Earth within a frame."""
    keys = {"faults": [loss(at_s=2)], "duration_s": 4}
    _, log = flown(**keys)
    found = frames_with(**keys)
    for i, axis in enumerate("pqr"):
        assert found.total[:, i] == pytest.approx(
            log[f"{axis}dot_rad_s2"][:-1] - log[f"{axis}_design_rad_s2"][1:], abs=1e-7
        )


def test_neglecting_the_engine_is_the_dominant_source_of_the_published_case_and_alarms_falsely():
    case = load_scenario("engine-neglected")
    kept, flown_as = split_flight(case)
    shares = {name: kept.shares(kept.contributions[name])[:, 1].max() for name in SOURCES if name != "fault"}
    assert max(shares, key=shares.get) == "engine"
    assert shares["engine"] > 10.0
    assert flown_as.false_alarm
    assert not split_flight(variant_of(case, "engine_terms=true"))[1].false_alarm
