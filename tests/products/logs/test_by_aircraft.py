"""A log diagnosed by its aircraft's own model: the flight's own verdict, and refusals of what a log lacks."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import csv as arrow
from pyarrow import parquet

import beaver_ftc as bf
from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.recordings import RECORDING_FILE_OF_KIND, write_recording
from beaver_ftc_logs import stepped
from beaver_ftc_logs.by_aircraft import diagnose_aircraft, load_diagnosed
from beaver_ftc_logs.loading import read_vehicle_columns
from beaver_ftc_logs.recording import Column, RecordedFlight
from beaver_ftc_logs.vehicle import Vehicle, load_vehicle
from products.logs.small import run

BEAVER = load_diagnosed("beaver")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    scenario = bf.load("elevator-partial-loss").with_({"duration_s": 9.0, "faults[0].at_s": 6.0})
    flight = bf.fly(scenario)
    flight.save(folder, report=False)
    return folder / "elevator-partial-loss", flight


def exported(folder, kind, to):
    travel = bf.aircraft("beaver").travel
    stops = {name: max(abs(one.min_rad), abs(one.max_rad)) for name, one in travel.items()}
    write_recording(folder / "log.parquet", stops, kind, to, ("dpt",))
    return to / RECORDING_FILE_OF_KIND[kind], load_vehicle(to / "vehicle.yaml")


@pytest.fixture(scope="module")
def log(flown, tmp_path_factory):
    """A table of the flight, and what its vehicle file says."""
    path, vehicle = exported(flown[0], "table", tmp_path_factory.mktemp("log"))
    return read_vehicle_columns(path, vehicle), vehicle


def changed(recording, **functions):
    """The recording with some columns as functions of their values."""
    columns = dict(recording.columns)
    for name, of in functions.items():
        columns[name] = Column(columns[name].t_s, of(columns[name].values))
    return RecordedFlight(recording.name, columns)


def only(recording, rows):
    columns = {name: Column(one.t_s[rows], one.values[rows]) for name, one in recording.columns.items()}
    return RecordedFlight(recording.name, columns)


@pytest.mark.parametrize("kind", RECORDING_FILE_OF_KIND)
def test_the_verdict_is_that_of_the_flight(flown, tmp_path, kind):
    pytest.importorskip("pyulog")
    pytest.importorskip("pymavlink")
    path, vehicle = exported(flown[0], kind, tmp_path)
    _, rows, verdict = diagnose_aircraft(read_vehicle_columns(path, vehicle), vehicle, BEAVER)
    flight = flown[1]
    assert verdict["detection_s"] == pytest.approx(flight.detection.time_s, abs=1e-9)
    assert verdict["isolation_s"] == pytest.approx(flight.isolation.time_s, abs=1e-9)
    assert (verdict["isolated"], verdict["type"]) == ("elevator", "loss_of_effectiveness")
    assert rows.faulty.tolist() == [int(flag) for flag in flight.log["detected"]]
    assert verdict["credible"] == {"share": 1.0, "reasons": []}


def test_a_name_that_was_withdrawn_and_returned_counts_from_its_return(log, monkeypatch):
    def replayed(diagnosis, arrays, rate_hz):
        t_s = np.arange(len(arrays[0])) / rate_hz
        names = np.where((t_s >= 6.5) & (t_s < 7.5), "rudder", "elevator")
        verdicts = [
            Verdict(detected=at_s >= 6.0, isolated=str(name) if at_s >= 6.0 else None)
            for at_s, name in zip(t_s, names, strict=True)
        ]
        healthy = np.ones((len(t_s), 4))
        return stepped.Replayed(verdicts, 0.0 * healthy, healthy, healthy[0], healthy[0])

    monkeypatch.setattr("beaver_ftc_logs.by_aircraft.replay_samples", replayed)
    assert diagnose_aircraft(*log, BEAVER)[2]["isolation_s"] == pytest.approx(7.5, abs=0.02)


def test_a_loss_of_nearly_all_that_would_show_is_not_a_number_of_one_digit(log, monkeypatch):
    def replayed(diagnosis, arrays, rate_hz):
        healthy = np.ones((len(arrays[0]), 4))
        return stepped.Replayed([Verdict()] * len(healthy), 0.004 * healthy, healthy, healthy[0], healthy[0])

    monkeypatch.setattr("beaver_ftc_logs.by_aircraft.replay_samples", replayed)
    assert "not even a complete loss would show" in diagnose_aircraft(*log, BEAVER)[2]["can_separate"][0]


def test_bounds_hold_but_for_the_second_in_which_the_fault_begins(log):
    recording, vehicle = log
    _, rows, _ = diagnose_aircraft(recording, vehicle, BEAVER)
    truth = np.ones((len(rows.t_s), 4))
    truth[rows.t_s >= 6.0 - 1e-9, 1] = 0.6
    held = (rows.effectiveness_low <= truth) & (truth <= rows.effectiveness_high)
    wrong = rows.t_s[~held.all(axis=1)]
    assert ((wrong >= 6.0 - 1e-9) & (wrong < 6.0 + stepped.BOUND_WINDOW_S)).all()
    later = rows.t_s > 7.0
    assert np.median((rows.effectiveness_high - rows.effectiveness_low)[later, 1]) < 0.1


def test_a_flight_cut_short_says_the_same_up_to_the_cut(log):
    recording, vehicle = log
    _, whole, _ = diagnose_aircraft(recording, vehicle, BEAVER)
    _, cut, _ = diagnose_aircraft(only(recording, slice(0, 700)), vehicle, BEAVER)
    for name in (
        "faulty",
        "isolated_surfaces",
        "effectiveness",
        "effectiveness_low",
        "effectiveness_high",
        "credible",
    ):
        np.testing.assert_array_equal(getattr(whole, name)[:700], getattr(cut, name), err_msg=name)


def test_nothing_is_said_across_a_gap_and_where_a_number_is_missing(log):
    recording, vehicle = log
    rows = np.r_[0:300, 330:900]
    holed = changed(only(recording, rows), p_rad_s=lambda p: np.where(np.arange(len(p)) == 100, np.nan, p))
    _, found, verdict = diagnose_aircraft(holed, vehicle, BEAVER)
    assert found.credible[100] == 0
    assert (found.credible == 0).sum() == 1
    assert (
        found.effectiveness_low[[100, 101, 300]] == 0.0
    ).all()  # a frame has to end before anything is known
    assert [one["says"] for one in verdict["credible"]["reasons"]] == ["a number is missing"]
    assert verdict["isolated"] == "elevator"


def test_outside_the_envelope_nothing_is_said(log):
    recording, vehicle = log
    fast = changed(recording, airspeed_mps=lambda v: 2.0 * v, qdyn_pa=lambda q: 4.0 * q)
    _, rows, verdict = diagnose_aircraft(fast, vehicle, BEAVER)
    assert not rows.faulty.any()
    assert rows.credible.mean() < 0.02
    assert verdict["detection_s"] is None
    assert "airspeed is outside 30 to 55 m/s" in str(verdict["credible"]["reasons"])


def test_a_log_of_another_aircraft_is_not_credible(log):
    """Rates twice as large as this aircraft's commands can make them: no fault of a surface does that."""
    recording, vehicle = log
    turned = changed(recording, **dict.fromkeys(("p_rad_s", "q_rad_s", "r_rad_s"), lambda rate: 2.0 * rate))
    vehicle = vehicle.model_copy(update={"attitude": None})
    _, rows, verdict = diagnose_aircraft(turned, vehicle, BEAVER)
    assert not rows.faulty.any()
    assert "another aircraft" in verdict["credible"]["reasons"][0]["says"]


def test_a_command_of_the_other_sign_is_refused_but_in_declared_turbulence(tmp_path):
    sine = [{"sine": {"amplitude_deg_s": 3.0, "frequency_hz": 0.4}}]
    scenario = bf.load({"name": "swung", "duration_s": 8.0, "reference": dict.fromkeys("pqr", sine)})
    bf.fly(scenario).save(tmp_path, report=False)
    path, vehicle = exported(tmp_path / "swung", "table", tmp_path)
    recording = read_vehicle_columns(path, vehicle)
    turned = changed(recording, rudder_command=np.negative)
    assert diagnose_aircraft(recording, vehicle, BEAVER)[2]["faulty"] is False
    with pytest.raises(BadInput, match=r"answer the command of rudder the other way round.*`scale: -1` fit"):
        diagnose_aircraft(turned, vehicle, BEAVER)
    (tmp_path / "moving.yaml").write_text("name: moving\nfdi: {bounds: {turbulence: light}}\n")
    moving = load_diagnosed("beaver", str(tmp_path / "moving.yaml"))
    assert diagnose_aircraft(turned, vehicle, moving)[2]["faulty"] in (False, True)


def without(vehicle, **keys):
    return Vehicle.model_validate(vehicle.model_dump(exclude_unset=True) | keys)


LACKS = [
    ({"flow": {"alpha_rad": "alpha_rad"}}, {}, "flow: no beta_rad, allowed: a column for each of alpha_rad"),
    ({"airspeed": None}, {}, "airspeed: is missing"),
    ({"airspeed": "tas"}, {}, "no column tas, allowed: a log that has it; it has "),
    ({}, {"alpha_rad": 57.3 * 12}, "flow.alpha_rad is .* in the middle, allowed: rad"),
    ({}, {"qdyn_pa": np.nan}, "no 50 samples in turn"),
    ({}, {"qdyn_pa": 0.01}, "make a density of 0.01.* kg/m3, allowed: 0.2 to 1.6"),
    ({}, {"elevator_command": 60.0}, "command of elevator reaches .* rad, allowed: its stop, 0.49 rad"),
]


@pytest.mark.parametrize(("keys", "factors", "says"), LACKS, ids=[one[2][:24] for one in LACKS])
def test_what_a_log_lacks_is_said(log, keys, factors, says):
    recording, vehicle = log
    scaled = {name: (lambda values, by=by: values * by) for name, by in factors.items()}
    with pytest.raises(BadInput, match=says):
        diagnose_aircraft(changed(recording, **scaled), without(vehicle, **keys), BEAVER)


def test_a_log_too_slow_or_uneven_is_refused(log):
    recording, vehicle = log
    with pytest.raises(
        BadInput, match="is logged at 10 Hz, allowed: an aircraft's model takes 20 to 1000 Hz"
    ):
        diagnose_aircraft(only(recording, slice(0, None, 10)), vehicle, BEAVER)
    rng = np.random.default_rng(3)
    uneven = only(recording, np.flatnonzero(rng.uniform(size=900) < 0.7))
    with pytest.raises(BadInput, match="no 50 samples in turn, evenly spaced"):
        diagnose_aircraft(uneven, vehicle, BEAVER)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("aircraft: beaver-split\n", "flies beaver-split, allowed: a scenario of beaver"),
        ("fdi: {sensor_monitor: always}\n", "wants accelerations, which a log has not"),
        ("fdi: {scheme: none}\n", "fdi.scheme is none, so no diagnosis would run, allowed: a scenario with"),
    ],
)
def test_a_scenario_that_does_not_fit_is_refused(tmp_path, text, says):
    (tmp_path / "other.yaml").write_text(f"name: other\n{text}")
    with pytest.raises(BadInput, match=says):
        load_diagnosed("beaver", str(tmp_path / "other.yaml"))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--aircraft", "beavr"], "--aircraft: 'beavr'"),
        (["--aircraft", "beaver", "--model", "m.json"], "--model and --aircraft: allowed: one of them"),
        (["--scenario", "fault-free"], "--scenario fault-free: allowed: only with --aircraft NAME"),
        (["--score"], "--score: allowed: only with --model MODEL or --aircraft NAME"),
        (["--detector", "x"], "--detector: allowed: only with --model MODEL"),
        (["--reader", "ulog"], "--reader: allowed: only with --model MODEL"),
        (["--aircraft", "beaver", "--detector", "x"], "--aircraft with --detector x: allowed: none"),
        (["--aircraft", "beaver"], "no vehicle.yaml beside it, allowed: --vehicle FILE"),
    ],
)
def test_options_that_contradict(tmp_path, options, says):
    (tmp_path / "flight.csv").write_text("t_s,p\n0,1\n")
    with pytest.raises(BadInput, match=re.escape(says)):
        run("diagnose", tmp_path / "flight.csv", *options)


def test_the_command_writes_rows_verdict_and_page(flown, tmp_path):
    path, _ = exported(flown[0], "table", tmp_path)
    truth = arrow.read_csv(path).to_pandas()
    truth["elevator_truth"] = np.where(truth["t_s"] >= 6.0 - 1e-9, 0.6, 1.0)
    truth.to_csv(path, index=False)
    with (tmp_path / "vehicle.yaml").open("a") as file:
        file.write("labels: {elevator: elevator_truth}\n")
    told = ["--aircraft", "beaver", "--scenario", str(flown[0] / "scenario.yaml"), "--score"]
    done = run("diagnose", path, *told, "--out", tmp_path / "d", "--format", "json")
    (verdict,) = json.loads(done.stdout)["flights"]
    assert (verdict["aircraft"], verdict["isolated"]) == ("beaver", "elevator")
    assert verdict["score"]["mean_error"] < 0.01
    rows = parquet.read_table(tmp_path / "d" / "flight" / "diagnosis.parquet")
    each = [f"{name}_{what}" for name in BEAVER[0].surfaces for what in ("effectiveness", "low", "high")]
    assert rows.column_names == ["t_s", "faulty", "named", *each, "credible"]
    assert "The model is that of beaver" in (tmp_path / "d" / "flight" / "report.html").read_text()


shares, sizes = st.floats(-1.0, 0.0), st.floats(-3.0, 3.0)


@given(theta=shares, slopes=st.tuples(sizes, sizes, sizes), off=st.tuples(sizes, sizes, sizes))
def test_a_loss_explains_what_it_does_within_the_bound(theta, slopes, off):
    bound = np.abs(off)
    expected = np.array(slopes)[None, :, None]
    innovation = (theta * expected[0, :, 0] + 0.999 * np.array(off))[None, :, None]
    least, greatest = stepped._explaining_losses(innovation, bound[None, :, None], expected)
    assert least[0, 0] <= theta <= greatest[0, 0]
