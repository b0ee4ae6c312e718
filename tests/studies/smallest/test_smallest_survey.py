"""`smallest` on flights: which are flown, what each row says, and that a second start flies nothing again."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import beta, binom
from typer.testing import CliRunner

import beaver_ftc as bf
from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import metrics
from beaver_ftc.studies.smallest import survey
from beaver_ftc.studies.smallest.survey import Asked, Flight, check, fly_one, run_smallest, variants_of

STAGES = (45, 50)  # the fewest of which an order statistic bounds the 0.9 quantile from above: 36
SCENARIO = {
    "name": "sines", "duration_s": 3.0, "rate_hz": 20,
    "reference": {"q": [{"sine": {"amplitude_deg_s": 2.0, "frequency_hz": 0.4}}]},
}  # fmt: skip
EVERYTHING = {
    "environment": {"turbulence": "dryden", "severity": "light"}, "sensors": "tactical-grade",
    "actuators": "servo",
    "fdi": {"bounds": {"turbulence": "light", "sensors": "tactical-grade", "deflection_deg": 0.1}},
}  # fmt: skip
ASKED = Asked("elevator", 0.5, seed=3)
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


def test_a_row_is_what_its_flight_says():
    scenario = bf.load(SCENARIO)
    variants = dict(variants_of(scenario, "elevator"))
    rows = [fly_one(variants, ASKED, Flight("as it is", run, 60)) for run in range(3)]
    assert rows == [fly_one(variants, ASKED, Flight("as it is", run, 60)) for run in range(3)]
    assert all(row["found"] and not row["failed"] and not row["false_alarm"] for row in rows)
    nothing = fly_one(variants, ASKED, Flight("as it is", 0, 0))
    assert not nothing["found"]
    assert not nothing["certain"]
    # certain and found, against the metrics of the same loss at an instant of one's own
    loss = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.6, "at_s": 1.5}
    said = metrics(fly(scenario.with_({"faults": [loss]})))["detection"]
    assert said["delay_s"] <= said["guaranteed_delay_s"]


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


def test_a_flight_is_a_loss_at_an_instant_of_its_own_and_no_longer_than_its_answer(told):
    """On a frame between the settled references and the end; it ends two frames after the time asked for."""
    flown = told()
    given = bf.load(SCENARIO | {"duration_s": 9.0, "seed": 5, "expect": {"no_departure": True}})
    given = given.with_({"faults": [{"type": "float", "actuator": "rudder", "at_s": 1.0}]})
    variants = {"calm": given, "other": given.with_({"rate_hz": 50})}
    asked = Asked("aileron", 0.7, seed=3)
    for run in range(40):
        fly_one(variants, asked, Flight("calm", run, 35))
    instants, seeds = [], []
    for scenario in flown:
        (fault,) = scenario.faults
        loss = ("loss_of_effectiveness", "aileron", 0.35)
        assert (fault.type, fault.actuator, fault.magnitude) == loss
        assert scenario.expect.model_dump(exclude_none=True) == {}
        assert fault.at_s * 20 == pytest.approx(round(fault.at_s * 20), abs=1e-9)
        assert scenario.duration_s == pytest.approx(min(fault.at_s + 0.7 + 2 / 20, 9.0))
        instants.append(fault.at_s)
        seeds.append(scenario.seed)
    assert 2.0 <= min(instants) < 2.7
    assert 7.6 < max(instants) <= 8.3
    assert len(set(seeds)) == 40  # one of 2^31 each, so that none is small
    assert min(seeds) > 1_000
    assert max(seeds) > 2_000_000_000
    flown.clear()
    for variant, seed, size in (("calm", 3, 80), ("calm", 4, 80), ("other", 3, 80)):
        fly_one(variants, Asked("aileron", 0.7, seed), Flight(variant, 7, size))
    same, another_seed, other = flown
    assert (same.seed, same.faults[0].at_s) == (seeds[7], instants[7])  # of whatever size
    assert (another_seed.seed, another_seed.faults[0].at_s) != (seeds[7], instants[7])
    assert (other.seed, other.rate_hz) == (seeds[7], 50)
    assert other.faults[0].at_s == pytest.approx(instants[7], abs=0.5 / 20 + 0.5 / 50)


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
    assert fly_one(variants, ASKED, Flight("as it is", 1, 60)) == NOTHING | row


def size_of(variant, run):
    """The size from which a flight of a variant finds its fault, per cent; it is certain 25 later."""
    size = (20 if variant == "as it is" else 10) + 7 * run % 50
    return size if size < 68 else 1000


def row_of(flight):
    """The row of a flight that is not flown: all that is odd is of a few."""
    size = size_of(flight.variant, flight.run)
    return NOTHING | {
        "found": flight.size >= size, "certain": flight.size >= size + 25,
        "false_alarm": flight.run in ((3, 46, 5) if flight.size == 100 else (8,)),
        "failed": flight.run in ((9, 11) if flight.size == 100 else (12, 13, 14)),
        "inconclusive": {20: "wind", 21: "air", 22: "wind"}.get(flight.run), "bound_used": 0.01 * flight.run,
    }  # fmt: skip


def ordered(sizes, n, confidence):
    """The 0.9 quantile of the first n sizes as shares, with order statistics that bound it."""
    of = [*(np.sort(sizes[:n]) / 100.0), None]  # the last of all is beyond every loss
    beyond = binom.cdf(np.arange(n), n, 0.9)
    high = next((r for r in range(n) if beyond[r] >= confidence), n)
    low = max(r for r in range(n) if beyond[r] <= 1.0 - confidence)
    values = {"size": of[int(np.ceil(0.9 * n)) - 1], "low": of[low], "high": of[high]}
    return {name: None if x is None or x > 1.0 else x for name, x in values.items()} | {"flights": n}


def test_a_document_of_flights_that_find_from_known_sizes_on(monkeypatch):
    """Of fifty flights as they are two find nothing at all: there is no upper end, and nothing is certain."""
    monkeypatch.setattr(survey, "STAGES", STAGES)
    monkeypatch.setattr(survey, "FIRST", STAGES[:1])
    flown, numbers, said = [], [], []

    def fly_round(number, flights):
        numbers.append(number)
        flown.extend(flights)
        return [row_of(flight) for flight in flights]

    variants = dict.fromkeys(("as it is", "calmer"))
    found = survey._document(
        bf.load(SCENARIO), Asked("rudder", 0.4, 6), variants, survey._Flown(fly_round, said.append)
    )
    assert found.pop("versions")["beaver-ftc"]
    as_it_is, calmer = ([size_of(variant, run) for run in range(50)] for variant in variants)
    assert sorted(as_it_is)[-3:] == [67, 1000, 1000]
    at_most = {48: (beta.ppf(0.025, 48, 3), beta.ppf(0.975, 49, 2)), 45: (0.025 ** (1 / 45), 1.0)}
    used = [0.01 * flight.run for flight in flown if flight.variant == "as it is"]
    assert found == {
        "scenario": "sines", "surface": "rudder", "type": "loss_of_effectiveness", "within_s": 0.4,
        "share": 0.9, "confidence": 0.95, "seed": 6, "variant": "as it is",
        "found": ordered(as_it_is, 50, 1.0 - 0.05 / 2 / 2),
        "certain": {"size": None, "flights": 45, "at_total_loss": 43},
        "total_loss": {
            "count": 48, "of": 50, "value": 0.96, "low": pytest.approx(at_most[48][0]),
            "high": pytest.approx(at_most[48][1]),
        },
        "false_alarms": 3, "failed": 2, "inconclusive": ["air", "wind"],
        "bound_used": pytest.approx(np.median(used)), "flights_flown": len(set(flown)),
        "compared": [
            {
                "variant": "calmer", "found": ordered(calmer, 45, 1.0 - 0.05 / 2),
                "certain": {"size": (max(calmer[:45]) + 25) / 100.0, "flights": 45, "at_total_loss": 45},
                "total_loss": {
                    "count": 45, "of": 45, "value": 1.0, "low": pytest.approx(at_most[45][0]), "high": 1.0
                },
                "false_alarms": 2, "failed": 2,
            }
        ],
    }  # fmt: skip
    assert found["found"]["high"] is None
    assert None not in found["compared"][0]["found"].values()
    assert len(flown) == len(set(flown))
    assert numbers == list(range(len(said)))  # rounds, each said with the flights until then
    assert said[0] == "as it is: 45 flights"
    assert said[-1] == f"calmer: {len(flown)} flights"


EXACT = {"sensors": "ideal", "actuators": "ideal", "environment": {}, "fdi": {}, "uncertainty": {}}


@pytest.mark.parametrize(
    ("given", "without"),
    [
        ({}, []),
        ({"environment": {"turbulence": "dryden", "severity": "light"}}, ["without turbulence"]),
        (
            {"environment": {"gust": {"at_s": 1.0, "velocity_mps": [0.0, 0.0, 2.0]}}},
            ["without turbulence"],
        ),
        ({"fdi": {"bounds": {"turbulence": "light"}}}, ["without turbulence"]),
        ({"sensors": "tactical-grade"}, ["with perfect sensors"]),
        ({"fdi": {"bounds": {"sensors": "tactical-grade"}}}, ["with perfect sensors"]),
        ({"actuators": "servo"}, ["with perfect servos"]),
    ],
)
def test_what_is_only_flown_or_only_declared_is_left_out_too(given, without):
    """And with each everything of the model; whatever is left out, all else of the flight is as it was."""
    wrong = {"inertia_coupling": {"q": 0.1}, "coefficients": {"Cm_q": 1.02}}
    scenario = bf.load(SCENARIO | EXACT | {"uncertainty": wrong} | given)
    scenario = scenario.with_({"fdi.bounds.coefficients": 0.03, "fdi.bounds.inertia": 0.02})
    flown = dict(variants_of(scenario, "elevator"))
    model = "without uncertainty of the model"
    assert list(flown)[1 : list(flown).index(model)] == without
    exact = flown[model]
    assert exact.uncertainty == bf.load(SCENARIO).uncertainty != scenario.uncertainty
    bounds = exact.fdi.bounds.model_dump()
    assert (bounds["coefficients"], bounds["inertia"]) == (0.0, 0.0)
    for key in ("inertia_coupling", "constant_rad_s2"):
        assert {axis: bounds[key][axis] for axis in "pqr"} == {"p": 0.0, "q": 0.0, "r": 0.0}
    for name in without:
        left = flown[name]
        assert left.uncertainty == scenario.uncertainty
        assert left.environment.is_still
        assert left.sensors.is_ideal
        assert left.actuators.is_ideal
        assert left.fdi.bounds.coefficients == 0.03


def test_another_reference_is_of_the_axis_on_which_the_surface_shows():
    """Of every kind of signal what is an amplitude is doubled, or what is a frequency, and nothing else."""
    chirp = {"amplitude_deg_s": 1.5, "start_s": 0.5, "end_s": 2.5, "start_frequency_hz": 0.1}
    chirp["end_frequency_hz"] = 0.7
    doublet = {"amplitude_deg_s": 3.0, "start_s": 0.25, "width_s": 0.75}
    p = [{"chirp": chirp}, {"doublet": doublet}]
    q = [{"csv": {"file": "q.csv", "time_s": [0.0, 1.0, 3.0], "values_deg_s": [0.5, 2.0, -1.0]}}]
    scenario = bf.load(SCENARIO | {"reference": {"p": p, "q": q}})
    flown = dict(variants_of(scenario, "aileron"))
    louder, faster = (flown[f"with twice the {what} of reference.p"] for what in ("amplitude", "frequency"))

    def of(one):
        return [signal.shape.model_dump() for signal in one.reference.p]

    both = [signal.shape.model_dump() for signal in scenario.reference.p]
    assert of(louder) == [both[0] | {"amplitude_deg_s": 3.0}, both[1] | {"amplitude_deg_s": 6.0}]
    assert of(faster) == [both[0] | {"start_frequency_hz": 0.2, "end_frequency_hz": 1.4}, both[1]]
    assert louder.reference.q == faster.reference.q == scenario.reference.q
    # a reference from a file has no frequency, and is one all the same
    (other,) = [name for name in dict(variants_of(scenario, "elevator")) if "reference" in name]
    assert other == "with twice the amplitude of reference.q"
    (doubled,) = dict(variants_of(scenario, "elevator"))[other].reference.q
    assert (doubled.csv.time_s, doubled.csv.values_deg_s) == ((0.0, 1.0, 3.0), (1.0, 4.0, -2.0))
    (added,) = [name for name in dict(variants_of(scenario, "rudder")) if "reference" in name]
    assert added == "with a sine of 3 deg/s and 0.25 Hz as reference.r"
    (sine,) = dict(variants_of(scenario, "rudder"))[added].reference.r
    assert (sine.sine.amplitude_deg_s, sine.sine.frequency_hz, sine.sine.phase_deg) == (3.0, 0.25, 0.0)


def test_a_document_and_its_files(few, tmp_path):
    (tmp_path / "sines.yaml").write_text(json.dumps(SCENARIO))
    line = ["smallest", str(tmp_path / "sines.yaml"), "--surface", "elevator", "--within", "0.5"]
    line += ["--workers", "1", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, [*line, "--format", "json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    certain, found = document["certain"], document["found"]
    assert found["low"] <= found["size"] <= found["high"]
    assert found["size"] <= certain["size"] <= 1.0  # what is certain is found, in every flight
    assert found["flights"] in STAGES
    assert certain["flights"] == STAGES[0]
    assert [row["variant"] for row in document["compared"]] == [*COMPARED[1:]]
    folder = tmp_path / "sines-smallest-elevator"
    assert {".json", ".csv", ".html"} <= {path.suffix for path in folder.iterdir()}


def test_what_is_stopped_goes_on_and_flies_no_finished_round_again(few, tmp_path, monkeypatch):
    scenario, flown, last = bf.load(SCENARIO), [], STAGES[0] + 5

    def counted(variants, asked, flight):
        flown.append(flight)
        if len(flown) == last:
            raise KeyboardInterrupt
        return fly_one(variants, asked, flight)

    monkeypatch.setattr(survey, "fly_one", counted)
    with pytest.raises(KeyboardInterrupt):
        run_smallest(tmp_path, scenario, ASKED)
    document = run_smallest(tmp_path, scenario, ASKED)
    resumed = len(flown) - last
    flown.clear()
    last = -1
    whole = run_smallest(tmp_path / "other", scenario, ASKED)
    assert {**document, "folder": 0} == {**whole, "folder": 0}
    assert resumed <= len(flown) - STAGES[0]


@pytest.mark.parametrize(
    ("changes", "asked", "says"),
    [
        ({}, Asked("elevater", 0.5), "--surface 'elevater': allowed: aileron, elevator, rudder, flap"),
        ({"fdi": {"scheme": "none"}}, ASKED, "scheme: none diagnoses nothing"),
        ({"duration_s": 2.95}, ASKED, "sines: duration_s: too short for --within, allowed: 3 or more"),
    ],
)
def test_what_cannot_be_answered_is_a_line(changes, asked, says):
    with pytest.raises(BadInput, match=says):
        check(bf.load(SCENARIO | changes), asked)
    check(bf.load(SCENARIO), ASKED)  # just long enough: 2 s to settle, twice 0.5 s
