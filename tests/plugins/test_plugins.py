"""A plug-in in the built-in one's place: what it drives, and what happens when it is no good."""

import sys
from inspect import getdoc

import culprits
import numpy as np
import pytest

from beaver_ftc.control import Law
from beaver_ftc.diagnosis import Detector, Verdict
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop.loop import fly
from beaver_ftc.plugins import DETECTORS, LAWS, VARIABLE, _hyphenated, plugin_class, register, registered
from beaver_ftc.results.metrics import metrics
from beaver_ftc.scenario.schema import load_text
from flying import Memory, scenario

FAULT = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.4, "at_s": 3}
SHORT = {"duration_s": 6, "faults": [FAULT]}


@pytest.fixture(autouse=True)
def nothing_registered(monkeypatch):
    """What a test registers goes with it."""
    monkeypatch.setenv(VARIABLE, "")


class PythonNominal:
    """The nominal law, written out from its equation: demand = xm' + Kp e + Ki int e - f, G u = demand."""

    def reset(self, context):
        self.context, self.integral = context, np.zeros(3)

    def step(self, measured, reference, verdict):
        model, trim = self.context.model, self.context.trim_rad
        error = reference.rate - measured.x
        demand = reference.acceleration + 2.0 * error + 1.0 * self.integral - model.f(measured.x, measured.y)
        G = model.G(measured.y)
        self.integral = self.integral + self.context.dt_s * error
        return np.append(np.linalg.solve(G[:, :3], demand - G[:, 3] * trim[3]), trim[3])


def _flown(log_of=None, **settings):
    log = Memory()
    return fly(log_of or scenario(**SHORT), log, **settings), log


def test_the_nominal_law_in_python_flies_like_the_compiled_one():
    _, compiled = _flown(scenario(**SHORT, control={"law": "nominal"}))
    _, python = _flown(law=PythonNominal())
    for column in ("q_rad_s", "alpha_rad", "elevator_cmd_rad", "aileron_cmd_rad"):
        assert np.allclose(python[column], compiled[column], rtol=0, atol=1e-9)
    assert np.ptp(compiled["elevator_cmd_rad"]) > 0.01


def test_what_a_detector_is_shown_is_the_flight_as_the_model_explains_it():
    class Keep(culprits.Silent):
        def step(self, measured, command):
            seen.append((measured, command))
            return Verdict()

    seen = []
    healthy = scenario(duration_s=3, uncertainty={})
    _, log = _flown(healthy, detector=Keep())
    assert [m.t_s for m, _ in seen] == pytest.approx(log["t_s"])
    assert np.array([u for _, u in seen])[:, 1] == pytest.approx(log["elevator_cmd_rad"])
    x = np.array([m.x for m, _ in seen])
    explained = np.array([m.acceleration for m, _ in seen])
    innovation = np.diff(x, axis=0) / 0.01 - explained[1:]
    assert np.abs(innovation).max() < 2e-3  # the Earth turns; nothing else is left
    assert np.abs(explained).max() > 0.05


def test_a_verdict_drives_supervisor_law_and_metrics():
    flight, log = _flown(detector=culprits.Teller())
    document = metrics(flight)
    detection = document["detection"]
    assert (detection["time_s"], detection["delay_s"], detection["axis"]) == (3.0, 0.0, "q")
    isolation = document["isolation"]
    assert (isolation["fault"], isolation["type"], isolation["correct"]) == (
        "elevator",
        "loss_of_effectiveness",
        True,
    )
    assert isolation["estimate"] == -0.4
    modes = [(step["time_s"], step["mode"]) for step in document["supervisor"]]
    assert modes == [(0.0, "nominal"), (3.0, "adaptive"), (3.01, "reallocated")]
    assert log["elevator_effectiveness_estimate"][-1] == log["elevator_effectiveness_used"][-1] == 0.6
    assert log["detected"][log["t_s"] >= 3.0].all()


def test_being_told_the_truth_is_worth_the_oracle():
    oracle, _ = _flown(scenario(**SHORT, control={"law": "oracle-published"}))
    told, _ = _flown(detector=culprits.Teller())
    deaf, _ = _flown(scenario(**SHORT, fdi={"scheme": "none"}))
    assert told.post_fault_rms_rad_s[1] < 2.0 * oracle.post_fault_rms_rad_s[1]
    assert deaf.post_fault_rms_rad_s[1] > 5.0 * oracle.post_fault_rms_rad_s[1]


def test_a_plug_in_cannot_write_into_the_flight():
    _, clean = _flown(detector=culprits.Silent())
    _, vandalised = _flown(detector=culprits.Vandal())
    assert np.array_equal(clean.rows, vandalised.rows, equal_nan=True)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("NanLaw", "the command is not finite"),
        ("ThreeSurfaces", "the command has shape (3,), allowed: 4 numbers"),
        ("TextLaw", "the command has type str, allowed: 4 numbers"),
        ("RaisingLaw", "step raised IndexError: no such layer"),
    ],
)
def test_a_bad_law_is_named(name, says):
    with pytest.raises(SimulationFailed, match=f"plug-in {_hyphenated(name)} at 0 s: ") as failed:
        fly(scenario(**SHORT, control={"law": register(f"culprits:{name}").name}))
    assert says in str(failed.value)


@pytest.mark.parametrize("name", ["culprits:Teller", "leaves:Anything", "os.path:join"])
def test_a_scenario_is_data_and_names_no_module(name):
    for key in ("fdi: {scheme: ", "control: {law: "):
        with pytest.raises(BadInput, match="is a class; a scenario names what is registered"):
            load_text(f"name: x\n{key}'{name}'}}\n")
    assert "leaves" not in sys.modules


def test_a_plug_in_cannot_end_the_program():
    with pytest.raises(SimulationFailed, match="plug-in quits at 0 s: step raised SystemExit: 0"):
        fly(scenario(**SHORT, fdi={"scheme": register("culprits:Quits").name}))
    with pytest.raises(BadInput, match="plug-in cannot-be-made: cannot be made: SystemExit: 0"):
        fly(scenario(**SHORT, fdi={"scheme": register("culprits:CannotBeMade").name}))


@pytest.mark.parametrize("group", [DETECTORS, LAWS])
def test_everything_registered_keeps_the_protocol(group):
    for name, entry in registered(group).items():
        assert entry.description().strip()
        if entry.target:
            assert getdoc(plugin_class(group, name)).startswith(entry.description())
            assert isinstance(plugin_class(group, name)(), Detector if group == DETECTORS else Law)


def test_options_reach_the_plug_in_and_unknown_ones_are_refused():
    with pytest.raises(BadInput, match=r"augmented-ekf: options.alram: unknown option, did you mean alarm\?"):
        fly(scenario(**SHORT, fdi={"scheme": "augmented-ekf", "options": {"alram": 3}}))
    deaf = fly(scenario(**SHORT, fdi={"scheme": "augmented-ekf", "options": {"alarm": 1e12}}))
    assert deaf.detection_time_s is None
