"""Records of flights as they are set up: instruments, the watch, columns, a plug-in's context, memory."""

from math import exp, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.design import Dryden
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.loop import assembly
from beaver_ftc.loop import loop as cockpit
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario


def _scenario(**keys):
    return Scenario.model_validate({"name": "x", "duration_s": 5, **keys})


@pytest.mark.parametrize(
    ("noise", "quantum", "looks"),
    [(0.0, 0.0, 3), (1.0, 0.0, 3), (0.26, 1.0, 50), (0.25, 1.0, redundancy.N_FROZEN_NEVER)],
)
def test_for_how_long_a_sound_instrument_may_stand_still(noise, quantum, looks):
    assert redundancy.n_frozen(noise, quantum) == looks


def test_gusts_that_the_watch_reckons_with():
    """Changes of variance 3 sigma^2 V / L a second, V 1.4 times that at the start, L 533.4 m (1750 ft); the
    filter passes h / (1 - exp(-2 lam h)) of them."""
    speed, changes = redundancy.bound_gusts(Dryden("light"), 45.0, 0.01)
    sigma = 7.4 * 0.3048
    assert speed == pytest.approx(GUST_LIMIT_SIGMA * sigma)
    per_s = GUST_LIMIT_SIGMA * sigma * sqrt(3.0 * 1.4 * 45.0 / 533.4)
    expected = [per_s * sqrt(0.01 / (1 - exp(-2 * pole * 0.01))) for pole in redundancy.FILTER_POLES_PER_S]
    assert changes == pytest.approx(expected)
    assert redundancy.bound_gusts(Dryden("none"), 45.0, 0.01)[0] == 0.0


@pytest.mark.parametrize(
    ("fdi", "scheme", "watched"),
    [
        ({"sensor_monitor": "always"}, "adaptive-estimators", True), ({}, "adaptive-estimators", False),
        ({"fault_class": "all"}, "adaptive-estimators", True),
        ({"fault_class": "all", "sensor_monitor": "never"}, "adaptive-estimators", False),
        ({"sensor_monitor": "always"}, "augmented-ekf", False), ({"fault_class": "all"}, "none", False),
    ],
)  # fmt: skip
@pytest.mark.parametrize("breaks", [True, False])
def test_when_the_instruments_are_watched(fdi, scheme, breaks, watched):
    fault = {"sensor": "q", "type": "bias", "magnitude": 3, "at_s": 1.0}
    fdi = {"scheme": scheme, **fdi}
    flown = _scenario(fdi=fdi, faults=[fault] if breaks else [])
    assert Declared.of(flown).monitors_sensors is watched
    assert assembly.are_ever_monitored(flown) is watched
    later = _scenario(
        fdi={**fdi, "scheme": "none"}, faults=flown.faults, changes=[{"at_s": 2, "scheme": scheme}]
    )
    assert assembly.are_ever_monitored(later) is watched


@pytest.mark.parametrize(
    ("keys", "engine", "read"),
    [
        ({}, False, 0), ({"sensors": {"engine_rpm": {"bias_rpm": 1}}}, True, 1),
        ({"sensors": {"manifold_pressure": {"bias_inhg": 1}}}, True, 1),
        ({"sensors": {"p": {"bias_deg_s": 1}}}, False, 0),
        ({"fdi": {"sensor_monitor": "always"}}, False, 1),
        ({"faults": [{"sensor": "q", "type": "lost", "at_s": 1.0}], "fdi": {"scheme": "none"}}, False, 1),
    ],
)  # fmt: skip
def test_what_is_read_of_the_truth(keys, engine, read):
    flown = _scenario(**keys)
    assert assembly.has_real_engine(flown) is engine
    usual = len(assembly.truth_read(_scenario()))
    assert (len(assembly.truth_read(flown)) > usual) is bool(read)


@pytest.mark.parametrize(("delay_s", "samples"), [(0.0, 0), (0.004, 2), (0.01, 3), (0.025, 4), (1.0, 102)])
def test_a_line_keeps_a_delays_samples_and_two(delay_s, samples):
    frames = Loop(_scenario(sensors={"q": {"delay_s": delay_s}, "r": {"delay_s": 0.02}})).frames
    instruments = frames["instruments"][0]
    assert instruments["length"][:4].tolist() == [0, samples, 4, 0]
    assert instruments["first"][:4].tolist() == [0, 0, samples, samples + 4]
    assert instruments["delay"][1] == pytest.approx(100 * delay_s)


@pytest.mark.parametrize(
    ("gear", "told", "altitude_m", "ground_m"),
    [
        (True, None, 1800.0, 14.63), (True, None, 514.0, 14.0), (False, None, 1800.0, 0.0),
        (True, None, 200.0, -300.0), (True, "a section", 1800.0, 0.0),
    ],
)  # fmt: skip
def test_where_the_ground_is(gear, told, altitude_m, ground_m):
    """The wheels are down at a wing's span, 48 ft, unless they must be told of a ground; a flight that begins
    lower has 500 m below it."""
    what = SimpleNamespace(geometry=SimpleNamespace(span_m=14.63), file=SimpleNamespace(ground=told))
    plant = SimpleNamespace(
        read=lambda name: 0.5 if "lat" in name else 0.25, has=lambda name: gear, aircraft=what
    )
    truth = {}
    cockpit.set_origin(truth, plant, altitude_m)
    assert truth["ground_m"] == pytest.approx(ground_m)
    assert (truth["latitude_0"], truth["longitude_0"]) == (0.5, 0.25)
    assert truth["radius_m"] == pytest.approx(6_371_000.0 + altitude_m)
    assert truth["parallel_radius_m"] == pytest.approx(truth["radius_m"] * np.cos(0.5))
