"""A certificate proves alarm and exclusions to a checker that shares no code with what wrote it."""

import ast
import copy
import json
import subprocess
import sys
from functools import lru_cache, reduce
from hashlib import sha256
from math import erfc, sqrt
from operator import getitem
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
import yaml
from tools.drawn.certificates import altered, places

import beaver_ftc as bf
from beaver_ftc.cli.main import main
from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, N_TYPES, TYPES
from beaver_ftc_assurance.certificates import check_certificate, tape
from beaver_ftc_assurance.certificates.certified import as_text, with_digest
from beaver_ftc_assurance.certificates.check_certificate import Refused, check_statement_form, failures
from beaver_ftc_assurance.separation import certified
from flying import SINES
from samples import samples

CHECKER = Path(__file__).parents[4] / "tools/check_certificate.py"
GYRO = {"noise_std_deg_s": 0.02, "bias_deg_s": 0.05, "scale_error": 1e-3}
GYROS = {"p": GYRO, "q": GYRO, "r": GYRO}
COARSE = dict.fromkeys("pqr", GYRO | {"quantum_deg_s": 0.02})
LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.5, "at_s": 0.5}
STUCK = {"type": "stuck", "actuator": "aileron", "position_deg": 5, "at_s": 0.5}
SOUND = {"fault_class": "all", "sensor_monitor": "never"}
DOUBTED = {"sensor_monitor": "always"}


def chance(surface, **bounds):
    """A flight whose verdict is that of the statistical test."""
    fdi = {"statistical": {}, "authority": "statistical", "bounds": {"sensors": GYROS, **bounds}}
    fault = LOSS | {"actuator": surface, "magnitude": 0.9, "at_s": 1.0}
    return {"faults": [fault], "sensors": GYROS, "fdi": fdi}


FLIGHTS = {
    "loss": {"faults": [LOSS]},
    "loss with release": {"faults": [LOSS | {"end_s": 0.8}]},
    "loss, slow filters": {
        "faults": [LOSS],
        "fdi": {"sharpen": {"pole_bank": False}},
    },
    "loss, as published": {
        "faults": [LOSS],
        "fdi": {"thresholds": "published", "sharpen": "none"},
    },
    "abrupt loss": {"faults": [LOSS | {"magnitude": 0.1}], "fdi": {"fault_profile": "abrupt"}},
    "substeps": {"faults": [STUCK], "substeps": 3, "rate_hz": 50, "fdi": SOUND},
    "any type": {"faults": [STUCK], "fdi": SOUND},
    "any type with release": {"faults": [STUCK | {"end_s": 0.9}], "fdi": SOUND},
    "gyros": {"faults": [LOSS], "sensors": COARSE, "fdi": {"bounds": {"sensors": COARSE}}},
    "filters begun long ago": {  # what a fault can have done to them before the frames kept counts
        "faults": [LOSS | {"actuator": "rudder", "magnitude": 0.6, "at_s": 1.0}],
        "sensors": GYROS,
        "fdi": {"bounds": {"sensors": GYROS}},
    },
    "tolerances": {
        "faults": [STUCK],
        "fdi": SOUND | {"bounds": {"coefficients": 0.05, "inertia": 0.02}},
    },
    "another aircraft": {
        "aircraft": "jsbsim:c172p",
        "initial": {"airspeed_mps": 50},
        "faults": [LOSS],
    },
    "chance": chance("rudder", coefficients=0.03),
    "chance, a step": chance("aileron", coefficients=0.03),
    "chance, in moving air": chance("aileron", turbulence="light")
    | {"environment": {"turbulence": "dryden", "severity": "light"}},
    "an altimeter": {
        "faults": [{"sensor": "altitude", "type": "bias", "magnitude": 3, "at_s": 1.0}],
        "fdi": DOUBTED,
    },
    "a roll angle": {
        "faults": [{"sensor": "phi", "type": "bias", "magnitude": 0.1, "at_s": 1.0}],
        "fdi": DOUBTED,
    },
    "blocks": {
        "faults": [STUCK],
        "sensors": GYROS,
        "fdi": SOUND | {"bounds": {"sensors": GYROS}},
    },
    "no vane": {"faults": [{"sensor": "alpha", "type": "lost", "at_s": 1.0}], "fdi": DOUBTED},
    "no fault": {},
}
CHANCE = [name for name in FLIGHTS if name.startswith("chance")]


@lru_cache
def proved(name):
    """A flight's certificate as it is read back, its log, and the text of its scenario."""
    flight = bf.fly({"name": "test", "duration_s": 2.0, "reference": SINES, **FLIGHTS[name]})
    proof = flight.proof()
    return json.loads(as_text(proof.certificate)), proof.log, proof.scenario


def flown(name):
    """A flight's certificate, and its log."""
    return proved(name)[:2]


def refusals(name, certificate):
    """Why the checker refuses a certificate of this flight."""
    return [*failures(certificate, *proved(name)[1:])]


def set_at_end(log):
    """Columns of the alarm and of the exclusions that are set as the flight ends."""
    return {name for name in log if name == "detected" or name.endswith("_excluded") if log[name][-1] > 0}


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_checker_accepts_a_flights_certificate(name):
    certificate, log = flown(name)
    assert refusals(name, certificate) == []
    stated = {said["column"] for said in certificate["statements"]} - {None}
    left_out = {said["column"] for said in certificate["without"]} - {None}
    assert stated | left_out == set_at_end(log)
    assert left_out == set() or name in ("gyros", *CHANCE)  # with exact gyros all of a surface is certified
    assert bool(stated) == bool(log["detected"].any())
    assert len(as_text(certificate)) <= 200_000


def test_chance_excludes_what_moves_nothing_where_it_raised_the_alarm():
    """A lost rudder shows in roll and yaw, which an elevator does not move."""
    certificate, log = flown("chance")
    (said,) = (said for said in certificate["statements"] if said["what"] == "elevator")
    alarm = certificate["statements"][0]
    assert said["as"] == "alarm"
    assert 1 not in alarm["axes"]
    assert log["fie_elevator_excluded"][said["frame"]] == 1.0
    other = copy.deepcopy(certificate)
    next(one for one in other["statements"] if one["what"] == "elevator")["what"] = "rudder"
    refused = refusals("chance", with_digest(other))
    assert refused == ["rudder excluded: fie_elevator_excluded is another column than that of this event"]
    before = copy.deepcopy(certificate)
    before["statements"][0]["frame"] += 1
    assert refusals("chance", with_digest(before))


def test_an_alarm_of_instruments_is_no_larger_than_that_of_the_log():
    for name in ("an altimeter", "a roll angle"):
        other = copy.deepcopy(flown(name)[0])
        said = other["statements"][0]
        said["sides"][0] += said["looks"][0][0]
        said["looks"][0][0] *= 2.0
        assert refusals(name, with_digest(other)) == ["alarm: the log's share is smaller"]


def test_the_alarm_of_a_flight_with_a_doublet_is_proved_as_without_it():
    """Also if a reading is missing, which a column of the log must say."""
    certificate, _, scenario = proved("no vane")
    held = {"duration_s": 0.0, "time_s": 0.0, "commands_rad": {}}
    with_doublet = certified(bf.load(yaml.safe_load(scenario)), held)
    assert with_doublet.document["statements"] == certificate["statements"]


def test_a_type_that_is_excluded_after_the_tape_has_no_statement(monkeypatch):
    monkeypatch.setattr(tape, "KEPT_AFTER_EVENT_S", 0.05)
    certificate, *proof = proved.__wrapped__("any type")
    assert [*failures(certificate, *proof)] == []
    late = {said["what"] for said in certificate["without"]}
    assert late == {"aileron rate_limit", "aileron bias that grows"}


def check(*arguments):
    """Exit status of the checker by itself, what it prints, and what it says on standard error."""
    command = [sys.executable, CHECKER, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def test_a_path_without_a_certificate_ends_in_one_line(tmp_path):
    (tmp_path / "text.json").write_text("no certificate")
    (tmp_path / "list.json").write_text("[1, 2]")
    (tmp_path / "deep.json").write_text("[" * 100_000)
    for name in ("nothing", "text.json", "list.json", "deep.json", "."):
        status, _, says = check(tmp_path / name, "log.parquet")
        assert (status, says.count("\n")) == (1, 1)
        assert says.startswith("no certificate at FOLDER, or CERTIFICATE LOG [SCENARIO]: ")


def test_what_is_stuck_is_neither_floating_nor_lost_and_a_repair_proves_nothing_against_it():
    for name in ("any type", "any type with release"):
        certificate, _ = flown(name)
        types = {said["what"] for said in certificate["statements"]}
        assert {"aileron float", "aileron loss_of_effectiveness"} <= types
        assert "aileron stuck" not in types


ALTERED = [
    "loss",
    "gyros",
    "substeps",
    "any type",
    "tolerances",
    "another aircraft",
    "an altimeter",
    "a roll angle",
    "blocks",
    "no vane",
    *CHANCE,
]


@pytest.mark.parametrize("name", ALTERED)
def test_whatever_number_is_altered_the_checker_refuses_it(name):
    """As it is, and with the digest written anew: no number is there that decides nothing."""
    certificate, _ = flown(name)
    known = [*places(certificate)]
    rng = np.random.default_rng(7)
    size = samples(60 if len(certificate["statements"]) < 9 else 20)
    for i in rng.choice(len(known), size=min(size, len(known)), replace=False):
        other = altered(certificate, known[i])
        assert refusals(name, other), known[i]
        assert refusals(name, with_digest(other)), known[i]


EARLY = 30  # a row before any fault


def single_frame(k, log, **more):
    """A term of one frame, as the log has it."""
    of = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2"}
    copies = {name: [[float(log[f"{axis}_{column}"][k]) for axis in "pqr"]] for name, column in of.items()}
    return {"weight": 1.0, "d": [0.0, 1.0, 0.0], "first": k, "frame": k, **copies, **more}


def times(factor):
    """Changes a number by a factor."""
    return lambda value, log: factor * value


def frame(k, **more):
    """Puts the frame k in the place of a sum's terms."""
    return lambda value, log: [single_frame(k, log, **more)]


GYRO_Q = "the declared error of gyro q is not that of the scenario"
NO_ORDER = "the frames of a term are not in order"
WHERE_SHOWN = {"theta": "constant while it shows"}
# Of a document, or of a statement in it, what is another, by key; why it is refused, "" if it is not.
REFUSED = [
    ("gyros", "document", {"dt_s": times(1 + 1e-6)}, "dt_s is not the frame of the scenario"),
    ("gyros", "document", {"instants": times(2)}, "instants: not those of the scenario"),
    ("gyros", "document", {"omega_E": times(1 + 1e-6)}, "omega_E is not the Earth's rate"),
    ("gyros", "document", {"declared.o.q": times(0.99)}, GYRO_Q),
    ("gyros", "document", {"declared.B.q": times(1.01)}, GYRO_Q),
    ("gyros", "document", {"declared.m.q": times(0.99)}, GYRO_Q),
    ("gyros", "document", {"declared.g.q": times(0.99)}, "g on q is not allowed"),
    ("loss", "document", {"declared.b": {}}, "b on p is smaller than the scenario's bound"),
    ("any type", "aileron hardover up", {"pace_rad_s": times(1 + 1e-9)}, "pace_rad_s is not half the rate"),
    ("any type", "aileron hardover up", {"stops.0": times(1 - 1e-9)}, "the stop is not that of the log"),
    ("any type", "aileron bias", {"stops.1": times(1.01)}, "stops"),
    ("any type", "aileron bias that grows", {"stops.0": times(1.01)}, "stops"),
    ("any type", "aileron rate_limit", {"ordered": [0.0]}, "ordered: frames are missing"),
    ("any type", "aileron rate_limit", {"near": times(-1)}, "near is nearer than the order itself"),
    ("any type", "aileron rate_limit", {"near": 5.0}, "0.0844909 is not more than 5"),
    ("loss", "rudder", {"least": -1.1}, "least is not the end of theta's range in the log"),
    ("loss", "rudder", {"most": 0.1}, "most is not the end of theta's range in the log"),
    ("any type", "aileron float", {"what": "aileron bias", "column": "aileron_bias_excluded", "frame": 54},
     "a sum of frames says nothing of this type"),
    ("loss", "rudder", {"theta": "constant"}, "the scenario does not declare a constant parameter"),
    ("abrupt loss", None, {"theta": "constant"}, "the scenario does not declare a constant parameter"),
    ("abrupt loss", "rudder", {"theta": "constant"}, ""),
    ("abrupt loss", "rudder", {"theta": "constant", "terms": frame(EARLY)},
     "a frame before the alarm may be healthy"),
    ("loss", "rudder", WHERE_SHOWN, "only a fault type is at fault where health fails"),
    ("any type", "aileron float", WHERE_SHOWN | {"terms": frame(EARLY)}, "health explains a frame"),
    ("any type", "aileron float", WHERE_SHOWN | {"terms": frame(52, since=49, pole_per_s=9.0)},
     "health explains a frame"),
    ("any type", "aileron loss_of_effectiveness that varies", WHERE_SHOWN,
     "theta of this type is not one number"),
    ("loss", "rudder", {"terms": frame(52)}, "a frame after the event cannot have caused it"),
    ("loss", "rudder", {"terms": frame(51, pole_per_s=5.0, since=51)}, NO_ORDER),
    ("gyros", "rudder", {"terms.0.since": 38}, NO_ORDER),
    ("loss", None, {"terms.0.h": [0.0]}, "an alarm has no effect of a fault"),
    ("loss", "rudder", {"terms.0.x.0.0": times(1.01)}, "x is not that of the log"),
    ("tolerances", "rudder", {"terms.0.rest.0.0": -1.0}, "rest: a part of a bound is below zero"),
    ("tolerances", "rudder", {"terms.0.rest.0.0": times(1.01)}, "the declared bounds are not the log's"),
    ("any type", "rudder_position", {"terms.0.h.0": times(1.01)}, "h is not that of the log"),
    ("filters begun long ago", "aileron", {"terms.0.fault": 0.0}, "the effect before the written"),
    ("gyros", "document", {"declared": {name: {} for name in "cbgoBm"}}, "the declared error of gyro p is"),
    ("gyros", "rudder", {"terms.0.pole_per_s": -5.0}, "term: pole_per_s is not allowed"),
    ("gyros", "rudder", {"terms.0.weight": -1.0}, "term: weight is not allowed"),
    ("gyros", "rudder", {"frame": EARLY, "terms": frame(EARLY)}, "fie_rudder_excluded is not set in row 30"),
    ("loss", "rudder", {"what": "elevator", "column": "fie_elevator_excluded"}, "fie_elevator_excluded is"),
    ("an altimeter", None, {"looks.0.2": -2.0}, "looks: a bound is below zero"),
    ("an altimeter", None, {"test": "V"}, "the log has another test in this row"),
    ("chance", None, {"level": -50.0}, "statement: level is not allowed"),
    ("gyros", "rudder", {"theta": "course"},
     "statement: theta is not allowed, allowed: One of: any, constant, constant while it shows."),
    ("gyros", "rudder", {"looks": [[1.0, 2.0, 3.0]]}, "the statement has no evidence, or more than one kind"),
    ("gyros", "rudder", {"note": "true"}, "statement: the field note is not known"),
    ("gyros", "document", {"note": "true"}, "certificate: the field note is not known"),
    ("gyros", "rudder", {"terms.0.note": "true"}, "term: the field note is not known"),
    ("gyros", "rudder", {"terms.0.d": [0.0, 0.0, 0.0]}, "the direction is zero"),
    ("gyros", "rudder", {"terms.0.first": 54}, "the frames are not in order"),
    ("gyros", "rudder", {"terms.0.r": [-0.1] * 16}, "term: r is not allowed"),
    ("gyros", "rudder", {"terms.0.fault": -0.1}, "term: fault is not allowed"),
    ("any type", "aileron bias", {"bounds.0.Z.0": 0.0}, "the surface does not act along this direction"),
    ("any type", "aileron bias", {"bounds": []}, "the evidence is empty"),
    ("any type", "aileron hardover up", {"pace_rad_s": 0.0}, "statement: pace_rad_s is not allowed"),
    ("any type", "aileron rate_limit", {"step": -1e-9}, "statement: step is not allowed"),
    ("chance", None, {"axes": [2, 2]}, "axes: one or two different ones are allowed"),
    ("chance", None, {"axes": [0, 3]}, "statement: axes is not allowed"),
    ("chance", None, {"sense": "more"}, "statement: sense is not allowed"),
    ("chance", None, {"R.0": -1.0}, "statement: R is not allowed"),
    ("chance", None, {"P.3.0": 0.31}, "P is no covariance"),
    ("chance", None, {"P.2.2": -1e-9}, "P is no covariance"),
    ("chance", None, {"first": 0}, "frames are missing"),
    ("chance", None, {"tolerance": [0.0]}, "statement: tolerance is not allowed"),
    ("chance", None, {"frames.0.jitter.0": -0.1}, "frame: jitter is not allowed"),
    ("chance", None, {"frames.1.drift": [[2.0, 0.3], [0.2, 1.0]]}, "drift is no covariance"),
    ("chance", None, {"frames.0.drift": [[0.1, 0.3], [0.3, 0.1]]}, "drift is no covariance"),
    ("chance", None, {"frames.0.keep": 1.1}, "frame: keep is not allowed"),
    ("chance", None, {"frames.1.keep": 0.9}, "the frames have different fields"),
    ("chance", None, {"frames.0.pace": -0.1}, "frame: pace is not allowed"),
    ("no vane", None, {"frame": 4.5}, "statement: the field frame is missing, or no row"),
    ("no vane", None, {"frame": True}, "statement: the field frame is missing, or no row"),
    ("no vane", None, {"missing": [4]}, "the log says that another reading is missing, or none"),
    ("no vane", "document", {"format": 4}, "this checker reads format 5, not 4"),
    ("no vane", "document", {"declared": []}, "certificate: declared is not allowed, allowed: A mapping."),
]  # fmt: skip


def holder_of(document, place):
    """What holds a place, its keys with dots between them; and the last key."""
    *within, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    return reduce(getitem, within, document), last


@pytest.mark.parametrize(("name", "what", "changes", "says"), REFUSED)
def test_what_is_another_is_refused_in_words(name, what, changes, says):
    certificate, log = flown(name)
    other = copy.deepcopy(certificate)
    found = [other] if what == "document" else [one for one in other["statements"] if one["what"] == what]
    for place, value in changes.items():
        node, key = holder_of(found[0], place)
        node[key] = value(node[key], log) if callable(value) else value
    refused = refusals(name, with_digest(other))
    whys = [why.rpartition(" excluded: ")[2].removeprefix("alarm: ")[: len(says)] for why in refused]
    assert whys[:1] == [says] * bool(says)


def test_a_sum_needs_the_rate_of_the_earth_with_its_bounds():
    other = flown("loss")[0] | {}
    del other["omega_E"]
    assert "omega_E is missing" in refusals("loss", with_digest(other))[0]


def parts(value, *above):
    """Each number, text and list of a statement, by its keys."""
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    if above:
        yield ".".join(map(str, above)), value
    for key in keys:
        yield from parts(value[key], *above, key)


ANY_LENGTH = {"frames", "looks", "bounds", "stops", "ordered", "sides", "sides.0", "sides.1"}


@pytest.mark.parametrize(
    ("name", "n"), [("substeps", 1), ("any type", 10), ("an altimeter", 0), ("chance", 0)]
)
def test_what_has_another_form_anywhere_is_refused(name, n):
    said = flown(name)[0]["statements"][n] | {"what": "flap"}
    check_statement_form(said)
    for place, value in parts(said):
        others = (3, {}) if isinstance(value, str) else ("text", float("nan"), float("inf"), {})
        shorter = [value[:-1]] if isinstance(value, list) and place not in ANY_LENGTH else []
        for other in (*others, *shorter):
            wrong = copy.deepcopy(said)
            node, key = holder_of(wrong, place)
            node[key] = other
            with pytest.raises((Refused, ValueError)):  # a matrix of uneven rows is none
                check_statement_form(wrong), (place, other)


NOT_TOGETHER = "certificate, log and scenario do not fit together: "


@pytest.mark.parametrize(("log", "text", "says"), [
    ({}, None, ""),
    ({}, "a: 1", "the scenario is no scenario"), ({}, "[1", f"{NOT_TOGETHER}ParserError"),
    ({"t_s": 0.01001 * np.arange(200)}, None, "dt_s: the log's rows are not that far apart"),
    ({"t_s": 0.01 * np.arange(201)}, None, "the log has 201 rows, not 200: the certificate belongs to anoth"),
    ({"watch_missing": "none"}, None, "alarm: the numbers do not fit the log: ValueError"),
])  # fmt: skip
def test_another_log_or_scenario_is_refused_in_words(log, text, says):
    certificate, own, scenario = proved("no vane")
    if text is not None:
        why = next(failures(certificate, own, text))
        assert why.startswith("SHA-256 of scenario.yaml does not match: it was edited")
        certificate = with_digest(certificate | {"scenario_sha256": sha256(text.encode()).hexdigest()})
    found = [*failures(certificate, own | log, scenario if text is None else text)]
    assert [one[: len(says)] for one in found] == [says] * bool(says)


def test_a_level_is_that_of_a_test_in_each_frame_at_the_declared_rate():
    """So often in an hour of frames a normal variable is beyond it."""
    certificate, _, scenario = proved("chance")
    declared = yaml.safe_load(scenario)
    per_h, frames_per_h = declared["fdi"]["statistical"]["false_alarms_per_h"], 3600.0 * declared["rate_hz"]
    least = -NormalDist().inv_cdf(per_h / frames_per_h)
    assert 0.5 * erfc(least / sqrt(2.0)) * frames_per_h == pytest.approx(per_h)
    other = copy.deepcopy(certificate)
    says = "alarm: level: the declared rate allows no smaller one"
    for factor in (1 - 1e-6, 1 + 1e-6):
        other["statements"][0]["level"] = factor * least
        assert (refusals("chance", with_digest(other))[0] == says) == (factor < 1)


def test_the_checker_takes_numpy_and_readers_of_the_files_alone():
    tree = ast.parse(Path(check_certificate.__file__).read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    others = {name.partition(".")[0] for name in imported} - set(sys.stdlib_module_names)
    assert others == {"numpy", "pyarrow", "yaml"}  # the log's and the scenario's reader


def test_by_the_command_line(tmp_path, monkeypatch, capsys):
    def beaver(*arguments):
        monkeypatch.setattr(sys, "argv", ["beaver-ftc", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code or 0, *capsys.readouterr()

    monkeypatch.chdir(tmp_path)
    scenario = {"name": "mine", "duration_s": 1.0, "reference": SINES, "faults": [LOSS]}
    Path("mine.yaml").write_text(json.dumps(scenario))
    fly = "run", "mine.yaml", "--certificate", "--no-report"
    assert beaver(*fly)[0] == 0
    found = status, printed, _ = check("runs/mine")
    assert (status, printed.splitlines()[-1]) == (0, "3 statements hold")
    assert beaver("check", "runs/mine")[:2] == found[:2]
    written = Path("runs/mine/certificate.json")
    written.write_text(written.read_text().replace('"frame":51', '"frame":52', 1))
    status, _, says = check(written, "runs/mine/log.parquet")
    assert (status, beaver("check", "runs/mine")[0]) == (1, 1)
    assert says == "SHA-256 does not match: the file was edited, or belongs to another log\n"
    Path("mine.yaml").write_text(json.dumps(scenario | {"fdi": {"scheme": "zhang2005"}}))
    status, _, says = beaver(*fly)
    assert (status, "mine: fdi.scheme: 'zhang2005'" in says) == (2, True)


@pytest.mark.parametrize("kind", range(N_TYPES))
def test_the_checker_defines_every_type_as_its_row_does(kind):
    """It is written apart from the rows."""
    row, words, travel = TYPES[kind], DESCRIPTIONS_IN_TYPE_ORDER[kind], (-0.2, 0.7)
    if row.frames_test:
        found = check_certificate.COURSES[words]
        assert found == (row.frames_test.replace(" ", "_"), row.stop_direction)
        return
    relation = row.deflection_relation
    expected = relation.command_gain, relation.theta_is_share, row.has_constant_parameter
    found = check_certificate.RELATIONS[words](*travel)
    assert found == (*expected, *relation.theta_span(*travel))
