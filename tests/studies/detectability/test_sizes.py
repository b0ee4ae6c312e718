"""`detectability --within` on flights: which are flown, and what each row and the document say."""

import json
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.studies.detectability import sizes as survey
from beaver_ftc.studies.detectability.sizes import Flight, Request, check, fly_one
from beaver_ftc.studies.detectability.variants import variants_of

STAGES = (36,)  # the fewest of which an order statistic bounds the 0.9 quantile from above
SCENARIO = {
    "name": "sines", "duration_s": 3.0, "rate_hz": 20,
    "reference": {"q": [{"sine": {"amplitude_deg_s": 2.0, "frequency_hz": 0.4}}]},
}  # fmt: skip
EVERYTHING = {
    "environment": {"turbulence": "dryden", "severity": "light"}, "sensors": "tactical-grade",
    "actuators": "servo",
    "fdi": {"bounds": {"turbulence": "light", "sensors": "tactical-grade", "deflection_deg": 0.1}},
}  # fmt: skip
REQUEST = Request("elevator", 0.5, seed=3)
COMPARED = ("as it is", "without uncertainty of the model")


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(survey, "STAGES", STAGES)
    monkeypatch.setattr(survey, "FIRST", STAGES[:1])
    monkeypatch.setattr(
        survey, "variants_of", lambda *of: (one for one in variants_of(*of) if one[0] in COMPARED)
    )


def test_what_is_left_out_is_left_out_of_truth_and_declaration():
    scenario = bf.load(SCENARIO | EVERYTHING)
    flown = dict(variants_of(scenario, "elevator"))
    assert list(flown) == [
        "as it is", "without turbulence", "with perfect sensors", "with perfect servos",
        "without uncertainty of the model", "with twice the amplitude of reference.q",
        "with twice the frequency of reference.q",
    ]  # fmt: skip
    calm = flown["without turbulence"]
    assert (calm.environment.severity, calm.fdi.bounds.turbulence) == (None, "none")
    exact = flown["with perfect sensors"]
    assert exact.sensors.is_ideal
    assert exact.fdi.bounds.sensors.is_ideal
    servos = flown["with perfect servos"]
    assert servos.actuators.is_ideal
    assert servos.fdi.bounds.deflection_deg == 0.0
    bounds = flown["without uncertainty of the model"].fdi.bounds
    assert (bounds.coefficients, bounds.inertia) == (0.0, 0.0)
    louder = flown["with twice the amplitude of reference.q"].reference.q[0].sine
    faster = flown["with twice the frequency of reference.q"].reference.q[0].sine
    assert (louder.amplitude_deg_s, louder.frequency_hz) == (4.0, 0.4)
    assert (faster.amplitude_deg_s, faster.frequency_hz) == (2.0, 0.8)
    # of a surface that no reference moves, the axis on which it shows gets one
    assert list(dict(variants_of(scenario, "rudder")))[-1].endswith("as reference.r")


@pytest.fixture
def told(monkeypatch):
    """Rows of flights that are not flown, and the scenarios that would be: told(detection, false alarm)."""
    flown = []

    def told(false_alarm=False, closest=(), fails=False, **detection):
        nothing = {"delay_s": None, "guaranteed_delay_s": None, "inconclusive": None}
        found = SimpleNamespace(detection=SimpleNamespace(**nothing | detection), false_alarm=false_alarm)
        monkeypatch.setattr(survey, "measure", lambda landing: found)

        def fly(scenario):
            flown.append(scenario)
            if fails:
                raise SimulationFailed("it broke")
            return SimpleNamespace(closest_approach=closest)

        monkeypatch.setattr(survey, "fly", fly)
        return flown

    return told


NOTHING = {
    "found": False, "certain": False, "false_alarm": False, "inconclusive": None, "failed": False,
    "bound_used": 0.0,
}  # fmt: skip


@pytest.mark.parametrize(
    ("flight", "row"),
    [
        ({}, {}),
        ({"delay_s": 0.5, "guaranteed_delay_s": 0.51}, {"found": True}),
        ({"delay_s": 0.51, "guaranteed_delay_s": 0.5}, {"certain": True}),
        ({"delay_s": 0.0, "guaranteed_delay_s": 0.0}, {"found": True, "certain": True}),
        ({"false_alarm": True, "closest": (0.4, 0.9, 0.6)}, {"false_alarm": True, "bound_used": 0.9}),
        (
            {"inconclusive": SimpleNamespace(reasons=[{"says": "the first"}, {"says": "the second"}])},
            {"inconclusive": "the first"},
        ),
        ({"fails": True, "delay_s": 0.1}, {"failed": True}),
    ],
)
def test_a_row_says_what_was_measured_up_to_the_time_asked_for(told, flight, row):
    told(**flight)
    variants = dict(variants_of(bf.load(SCENARIO), "elevator"))
    assert fly_one(variants, REQUEST, Flight("as it is", 1, 60)) == NOTHING | row


def test_a_document_and_its_files(few, tmp_path):
    (tmp_path / "sines.yaml").write_text(json.dumps(SCENARIO))
    line = ["smallest", str(tmp_path / "sines.yaml"), "--surface", "elevator", "--within", "0.5"]
    line += ["--workers", "1", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, [*line, "--format", "json"])
    assert done.exit_code == 0, done.output
    notice = "smallest is a former name: type beaver-ftc detectability --within 0.5\n"
    assert done.stderr.startswith(notice)
    document = json.loads(done.stdout)
    certain, found = document["certain"], document["found"]
    assert found["low"] <= found["size"] <= found["high"]
    assert found["size"] <= certain["size"] <= 1.0  # what is certain is found, in every flight
    assert found["flights"] in STAGES
    assert certain["flights"] == STAGES[0]
    assert [row["variant"] for row in document["compared"]] == [*COMPARED[1:]]
    folder = tmp_path / "sines-detectability-elevator"
    assert {".json", ".csv", ".html"} <= {path.suffix for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("changes", "wanted", "says"),
    [
        ({}, Request("elevater", 0.5), "--surface 'elevater': allowed: aileron, elevator, rudder, flap"),
        ({"fdi": {"scheme": "none"}}, REQUEST, "scheme: none diagnoses nothing"),
        ({"duration_s": 2.95}, REQUEST, "sines: duration_s: too short for --within, allowed: 3 or more"),
    ],
)
def test_what_cannot_be_answered_is_a_line(changes, wanted, says):
    with pytest.raises(BadInput, match=says):
        check(bf.load(SCENARIO | changes), wanted)
    check(bf.load(SCENARIO), REQUEST)  # just long enough: 2 s to settle, twice 0.5 s
