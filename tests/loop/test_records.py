"""Records of flights as they are set up: instruments, the watch, columns, a plug-in's context, memory."""

from math import exp, sqrt
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.design import Dryden
from beaver_ftc.diagnosis.bounds import GUST_LIMIT_SIGMA
from beaver_ftc.diagnosis.monitors import redundancy
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop import assembly
from beaver_ftc.loop import loop as cockpit
from beaver_ftc.loop.assembly import lay_out, y_places
from beaver_ftc.loop.loop import Loop
from beaver_ftc.loop.plugin_frame import context_of, measured_of
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.faults import HOLDING
from beaver_ftc.scenario.schema import Scenario
from kept import of_record

# Each instrument with errors of its own: bias, noise, resolution, slope, lag, delay, lost samples, drift.
ERRORS = {
    "p": {"noise_std_deg_s": 0.05, "delay_s": 0.03}, "q": {"bias_deg_s": 0.2, "bandwidth_rad_s": 40.0},
    "r": {"quantum_deg_s": 0.01, "dropout_share": 0.1}, "alpha": {"scale_error": 0.02, "delay_s": 0.015},
    "V": {"noise_std_mps": 0.5}, "psi": {"drift_deg_h": 30.0}, "phi": {"drift_deg_h": -36.0},
    "engine_rpm": {"noise_std_rpm": 5.0}, "ax": {"bias_mps2": 0.1},
}  # fmt: skip
DECLARED = {
    "p": {"noise_std_deg_s": 0.05}, "q": {"bias_deg_s": 0.2}, "r": {"quantum_deg_s": 0.01},
    "alpha": {"scale_error": 0.02}, "V": {"noise_std_mps": 0.5, "quantum_mps": 0.1},
    "theta": {"noise_std_deg": 0.1}, "psi": {"drift_deg_h": 30.0}, "phi": {"drift_deg_h": -36.0},
}  # fmt: skip
WATCHED = {
    "fdi": {
        "fault_class": "all", "sensor_monitor": "always", "statistical": {},
        "bounds": {"sensors": DECLARED, "turbulence": "moderate"},
    },
}  # fmt: skip
CASES = {
    "usual": {},
    "with-errors": {"sensors": ERRORS, "substeps": 2, "rate_hz": 50, "seed": 3, **WATCHED},
    "broken": {
        "faults": [{"sensor": "V", "type": "bias", "magnitude": 3, "at_s": 1.0}],
        "fdi": {"sensor_monitor": "always"},
        "initial": {"airspeed_mps": 50, "altitude_m": 1000}, "control": {"law": "lqr"}, "seed": 9,
    },
    "autopilot": {"autopilot": {"altitude_m": [{"hold": True}]}, "fdi": {"scheme": "augmented-ekf"}},
}  # fmt: skip


def _scenario(**keys):
    return Scenario.model_validate({"name": "x", "duration_s": 5, **keys})


def start_of(loop):
    """The truth's channels at the start, SI."""
    truth = loop.frames["truth"]
    return truth["value"][0] * truth["factor"][0]


@pytest.fixture(scope="module", params=CASES)
def loop(request):
    flying = Loop(_scenario(**CASES[request.param]))
    yield flying
    flying.release()


def test_the_instruments_and_the_watch(loop, changed):
    frame = loop.frames[0]
    assert not changed(of_record(frame["instruments"]), part="instruments")
    assert not changed(of_record(frame["fdi"]["sensor_monitor"]), part="watch")


def test_what_is_read_logged_and_told_of_the_start(loop, changed):
    frame, truth = loop.frames[0], loop.frames[0]["truth"]
    fixed = ("n", "declared", "latitude_0", "longitude_0", "ground_m", "radius_m", "parallel_radius_m")
    assert not changed({
        "truth": {name: truth[name].item() for name in fixed}, "factor": truth["factor"][: truth["n"]],
        "start": start_of(loop)[:40], "logged": of_record(frame["logged"]), "columns": loop.columns,
        "places": y_places(frame), "frames": loop.n_frames, "rows": len(loop.log),
        "travel": Declared.of(loop.scenario).travel_rad,
    })  # fmt: skip


def test_what_a_plug_in_is_told_before_and_in_flight(loop, changed):
    context = context_of(loop.frames, loop.scenario, loop.trimmed, {"alarm": 3.0})
    told = {name: value for name, value in vars(context).items() if name not in ("model", "declared")}
    loop.fly_chunk(0, 3)
    measured = measured_of(loop.frames[0])
    assert not changed({
        **told, "leaders": context.leaders, "declared": vars(context.declared),
        "measured": measured._asdict(),
    })  # fmt: skip
    assert not np.shares_memory(measured.x, loop.frames["measured"]["x"])


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


def test_as_long_a_line_as_is_needed():
    """Two samples more than the delay of each; 512 in all serve most flights."""

    def line(*delays_s, **more):
        given = dict(zip(("p", "q", "r", "alpha", "beta", "V"), delays_s, strict=False))
        sensors = {name: {"delay_s": delay_s} for name, delay_s in given.items()}
        return assembly.line_for(_scenario(sensors=sensors, **more))

    assert line(*[1.0] * 5) == 512  # 510 of them
    assert line(*[1.0] * 5, 0.01) == assembly.MOST_LINE  # 513
    assert line(*[1.0] * 5, 0.001) == 512
    assert line(*[1.0] * 3, substeps=2) == assembly.MOST_LINE


def test_a_delay_has_a_thousand_frames_of_jsbsim_at_most():
    sensors = {"q": {"delay_s": 1.0}}
    assert (
        Loop(_scenario(sensors=sensors, rate_hz=100, substeps=10)).frames["instruments"]["delay"][0, 1]
        == 1000
    )
    with pytest.raises(
        BadInput, match=r"sensors\.q\.delay_s is 1 s, allowed: 1000 JSBSim frames, 0\.5 s here"
    ):
        Loop(_scenario(sensors=sensors, rate_hz=200, substeps=10))


def test_random_numbers_begin_with_the_seed_each_counter_apart():
    records = [{"random": None} for _ in range(2)]
    for number, record in enumerate(records):
        assembly.seed(record, number)
    first, second = (record["random"].tolist() for record in records)
    assert first == [0, 0xD1B54A32D192ED03, 0x8CB92BA72F3D8DD7, 0xA0761D6478BD642F, 0xE7037ED1A0B428DB]
    assert second == [number ^ 1 for number in first]


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


def test_the_command_and_the_engine_are_handed_over_through_python():
    loop = Loop(_scenario())
    frame = loop.frames[0]
    frame["prediction"]["commanded"] = [0.1, -0.2, 0.05, 0.3]
    frame["control"]["power"]["output"]["command"], before = (
        12.5,
        loop.plant.read(loop.aircraft.trim.throttle),
    )
    loop.cockpit.write()
    commanded = [loop.plant.read(f"fcs/{s}-cmd-rad") for s in loop.aircraft.surfaces]
    assert commanded == pytest.approx([0.1, -0.2, 0.05, 0.3])
    assert loop.plant.read(loop.aircraft.trim.throttle) == before
    frame["control"]["power"]["output"]["in_use"] = 1
    loop.cockpit.write()
    assert loop.plant.read(loop.aircraft.trim.throttle) == pytest.approx(12.5)
    truth, fresh = frame["truth"], start_of(loop)
    truth["value"] = 0.0
    loop.cockpit.read()
    assert truth["value"] * truth["factor"] == pytest.approx(fresh)


@pytest.mark.parametrize("surface", [0, 2])
@pytest.mark.parametrize("how", HOLDING)
def test_which_surfaces_stand_still_is_noted(surface, how):
    names = ("aileron", "elevator", "rudder", "flap")
    on = {f"failures/{names[surface]}/{how}": 1.0, cockpit.UNANTICIPATED: 10.0}
    plant = SimpleNamespace(read=lambda name: on.get(name, 0.0), aircraft=SimpleNamespace(surfaces=names))
    truth = {}
    cockpit.note_failures(truth, plant)
    assert truth["immovable"] == [s == surface for s in range(4)]
    assert truth["Cm_alpha3"] == 10.0


def test_columns_of_what_a_flight_has():
    loop = Loop(_scenario(fdi={"fault_class": "all", "statistical": {}}))
    frame, with_diagnosis = loop.frames[0], loop.columns
    without = lay_out(frame, loop.scenario, False)
    assert frame["logged"]["estimators"] == 0
    assert set(with_diagnosis) > set(without)
    assert not any(name.startswith("fie_") for name in without)
    frame["control"]["power"]["config"]["enabled"] = 0
    lay_out(frame, loop.scenario, True)
    assert (frame["logged"]["estimators"], frame["logged"]["power"]) == (8, 0)


@pytest.fixture
def spare(monkeypatch):
    monkeypatch.setattr(assembly, "_spare", kept := [])
    return kept


def test_memory_is_given_back_once_and_of_a_few_flights(spare):
    arrays = [assembly.taken((n,)) for n in (30, 10, 20, 50, 40)]
    for array in arrays:
        assembly.give_back(array[1:])
        assembly.give_back(array)
    assert [block.size for block in spare] == [80, 160, 240, 400]
    small = assembly.taken((2, 10))
    assert (small.base.size, len(spare)) == (160, 3)  # the least that is large enough
    assert assembly.taken((60,)).base.size == 480
    assert assembly.taken((10,), np.uint8).base.size == 80
    assert [block.size for block in spare] == [240, 400]
    assembly.give_back(np.zeros(7))
    assembly.give_back(np.zeros(7, np.uint8))
    assert len(spare) == 3
