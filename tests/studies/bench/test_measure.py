"""What is timed, how often, and what is made of it: with clocks and contenders made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.bench import measure
from beaver_ftc.studies.bench.contenders import Bare, InnovationDetector, ProportionalInversion, take_over
from beaver_ftc.studies.bench.parts import PARTS
from flying import scenario


@pytest.fixture
def timed(monkeypatch):
    """Contenders that only say what they are, and times that follow from their place and the round."""
    asked = []

    class Loop:
        def __init__(self, case, at_s, detector=None, law=None):
            plugged = [type(one).__name__ for one in (detector, law) if one is not None]
            self.moment, self.says = f"{case.name} at {at_s:g} s", ["loop", at_s, *plugged]

        def with_frame(self, frame):
            return SimpleNamespace(says=f"frame with {frame} parts")

    def interleave(contenders, rounds, frames):
        asked.append({"who": [one.says for one in contenders], "rounds": rounds, "frames": frames})
        places, turns = np.arange(len(contenders)), np.arange(rounds)[:, None]
        return (10.0 + 3.0 * places + places**2) * (1.0 + 0.1 * turns + 0.01 * turns * places)

    def bare(moment, runs=1):
        return SimpleNamespace(says=["bare", moment, runs])

    monkeypatch.setattr(measure, "interleave", interleave)
    monkeypatch.setattr(measure, "ClosedLoop", Loop)
    monkeypatch.setattr(measure, "Bare", bare)
    monkeypatch.setattr(measure, "take_over", lambda case, at_s: f"{case.name} at {at_s:g} s")
    monkeypatch.setattr(measure, "frame_with", lambda i: i)
    monkeypatch.setattr(
        measure, "Straightforward",
        lambda case, at_s, frames: SimpleNamespace(says=["straightforward", at_s, frames]),
    )  # fmt: skip
    monkeypatch.setattr(
        measure, "WholeFlight",
        lambda case, log=None: SimpleNamespace(says=["flight", case.duration_s, len(case.faults), bool(log)]),
    )  # fmt: skip
    return asked


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("processor\t: 0\nmodel name\t: A chip: fast\n", "A chip: fast"),
        ("processor\t: 0\nBogoMIPS\t: 50\n", "aarch64"),
        (None, "aarch64"),
    ],
)
def test_a_machine_is_said_by_its_processors_name_or_by_its_kind(lines, said, monkeypatch):
    def read(path, encoding):
        if lines is None:
            raise FileNotFoundError(path)
        return lines

    monkeypatch.setattr(measure.Path, "read_text", read)
    monkeypatch.setattr(measure.platform, "machine", lambda: "aarch64")
    assert measure._processor() == said


def test_what_a_benchmark_times_and_says(timed, monkeypatch, changed):
    said, kinds = [], []
    monkeypatch.setattr(measure, "by_kind", lambda rounds: kinds.append(rounds) or {"kind": {}})
    document = measure.bench(24, True, said.append)
    machine = document.pop("machine")
    assert set(machine) == {"processor", "cores", "python", "jsbsim", "numba", "numpy", "native_properties"}
    assert (list(document["parts"]), kinds) == (["calling", *PARTS], [24])
    assert not changed({"document": document, "asked": timed, "said": said})
    timed.clear()
    short = measure.bench(6, with_parts=False)
    assert short["parts"] == short["before_alarm"]["parts"] == {}
    assert [(len(one["who"]), one["rounds"]) for one in timed] == [(2, 6), (2, 6), (6, 3), (3, 3)]


def test_kinds_of_flights_take_turns_after_a_warm_up(monkeypatch, changed):
    flown = []

    def fly(sweep, changes, run, alike):
        flown.append([sweep.name, sorted(changes), run, alike])
        return (1.0 + run) * np.array([1e-3, 2e-3, (1.0 + 0.1 * len(flown)) * 1e-2, 4e-3]), 1500, 6e-3

    monkeypatch.setattr(measure, "_flown", fly)
    between = []
    found = measure.by_kind(3, lambda: between.append(len(flown)))
    assert between == [0, 6, 12, 18]
    assert not changed({"found": found, "flown": flown})


def test_a_flight_is_taken_apart_at_its_marks(monkeypatch):
    """A clock that is read is a second older: parts are a second each, the changes' no part at all."""
    clock, ran = iter(range(1000)), []
    plant = SimpleNamespace(run=lambda: ran.append(1))
    flight = SimpleNamespace(frames=7)
    loop = SimpleNamespace(
        plant=plant, chunks=lambda: [1, 2], land=lambda: flight, release=lambda: ran.append(0)
    )
    monkeypatch.setattr(measure.time, "process_time", lambda: float(next(clock)))
    monkeypatch.setattr(measure, "Loop", lambda case: loop)
    monkeypatch.setattr(measure, "measure", lambda flight: {})
    monkeypatch.setattr(measure, "row_of", lambda assignment, found, flight: None)
    monkeypatch.setattr(measure, "scenario_of", lambda sweep, assignment: scenario(substeps=3))
    measure.conditions._trims["old"] = None
    sweep = load_sweep("elevator-effectiveness")
    parts, runs, alone_s = measure._flown(sweep, {}, 0)
    assert (parts.tolist(), runs, alone_s) == ([1.0] * 4, 21, 1.0)
    assert ran == [1] * 21 + [0]
    assert "old" not in measure.conditions._trims
    found = []
    monkeypatch.setattr(measure.conditions, "find_trim", found.append)
    changed, _, _ = measure._flown(sweep, {"duration_s": 1.0}, 0, alike=True)
    assert len(found) == 1, "the trim of flights that begin alike is known before"
    assert changed.tolist() == [2.0, 1.0, 1.0, 1.0], "a second goes by between two readings"


def test_a_detector_in_python_compares_a_frame_with_the_model():
    """Over 0.1 s the rate changes by 0.05 rad/s; the model says 0.3 rad/s2, with 0.2 declared."""

    def measured(x, bound):
        return SimpleNamespace(
            x=np.array([0.0, x, 0.0]), acceleration=np.array([0.0, 0.3, 0.0]), eta_bar=np.full(3, bound)
        )

    for bound, alarm in ((0.2001, False), (0.1999, True)):
        detector = InnovationDetector()
        detector.reset(SimpleNamespace(dt_s=0.1))
        assert not detector.step(measured(5.0, bound), None).detected, "there is no frame before the first"
        said = [detector.step(measured(x, bound), None).detected for x in (5.05, 5.08)]
        assert said == [alarm, alarm], "once raised an alarm stays"


def test_what_is_as_much_as_is_declared_raises_no_alarm():
    """Half a rad/s2 over half a second, of which the model says a quarter: a quarter is declared."""
    detector, x = InnovationDetector(), np.array([0.25, 0.0, 0.0])
    detector.reset(SimpleNamespace(dt_s=0.5))
    for k in range(2):
        seen = SimpleNamespace(x=k * x, acceleration=np.array([0.25, 0.0, 0.0]), eta_bar=np.full(3, 0.25))
        assert not detector.step(seen, None).detected


def test_a_law_in_python_inverts_the_model_on_its_feedback():
    G = np.array([[-8.0, 0.1, 0.5, 0.2], [0.3, -10.0, 0.0, -2.0], [-0.5, 0.0, -4.0, 0.1]])
    f, x = np.array([0.1, -0.2, 0.3]), np.array([0.01, 0.02, -0.03])
    law = ProportionalInversion()
    model = SimpleNamespace(f=lambda x, y: f, G=lambda y: G)
    law.reset(SimpleNamespace(model=model, trim_rad=np.array([9.0, 9.0, 9.0, 0.15])))
    reference = SimpleNamespace(rate=np.array([0.05, -0.05, 0.1]), acceleration=np.array([0.2, 0.1, -0.1]))
    u = law.step(SimpleNamespace(x=x, y=None), reference, Verdict())
    assert u[3] == 0.15
    assert f + G @ u == pytest.approx(reference.acceleration + 3.0 * (reference.rate - x))


def test_jsbsim_alone_runs_so_often_a_frame_from_the_moment_on():
    moment = take_over(scenario(duration_s=1), 0.1)
    for runs in (1, 3):
        bare = Bare(moment, runs)
        bare.prepare()
        bare.fly(4)
        assert bare.plant.read("simulation/sim-time-sec") == pytest.approx(0.01 * 4 * runs)
    Bare(moment, 1).fly(2)
    assert bare.plant.read("simulation/sim-time-sec") == pytest.approx(0.14)
