"""A certificate proves alarm and exclusions to a checker that shares no code with what wrote it."""

import ast
import copy
import json
import subprocess
import sys
from functools import lru_cache, reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest
from tools.drawn.certificates import altered, places

import beaver_ftc as bf
from beaver_ftc.cli.main import main
from beaver_ftc.diagnosis.types.registry import DESCRIPTIONS_IN_TYPE_ORDER, N_TYPES, TYPES
from beaver_ftc_assurance.certificates import check_certificate
from beaver_ftc_assurance.certificates.certificate import as_text, with_digest
from beaver_ftc_assurance.certificates.check_certificate import failures
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


def refusals(name, certificate, log=None):
    """Why the checker refuses a certificate of this flight."""
    _, own, scenario = proved(name)
    given = certificate, own if log is None else log, scenario
    return [*failures(*given)]


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
    assert all(said["column"] for said in certificate["statements"])
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


def test_an_alarm_of_instruments_is_that_of_the_log():
    """Larger by what nothing allows, or of another reading, it is refused."""
    for name in ("an altimeter", "a roll angle"):
        certificate, _ = flown(name)
        wider, renamed = copy.deepcopy(certificate), copy.deepcopy(certificate)
        said = wider["statements"][0]
        said["looks"][0][0] *= 2.0
        said["sides"][0] += certificate["statements"][0]["looks"][0][0]
        renamed["statements"][0]["test"] = "V"
        assert refusals(name, with_digest(wider)) == ["alarm: the log's share is smaller"]
        assert refusals(name, with_digest(wider))
        assert refusals(name, with_digest(renamed))


def check(*arguments):
    """Exit status of the checker by itself, what it prints, and what it says on standard error."""
    command = [sys.executable, CHECKER, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def test_a_path_without_a_certificate_ends_in_one_line(tmp_path):
    (tmp_path / "text.json").write_text("no certificate")
    (tmp_path / "list.json").write_text("[1, 2]")
    for name in ("nothing", "text.json", "list.json", "."):
        status, _, says = check(tmp_path / name, "log.parquet")
        assert (status, says.count("\n")) == (1, 1)
        assert says.startswith("no certificate at FOLDER, or CERTIFICATE LOG [SCENARIO]: ")


def test_what_is_stuck_is_neither_floating_nor_lost_and_a_repair_proves_nothing_against_it():
    for name in ("any type", "any type with release"):
        certificate, _ = flown(name)
        types = {said["what"] for said in certificate["statements"]}
        assert {"aileron float", "aileron loss_of_effectiveness"} <= types
        assert "aileron stuck" not in types


def test_a_parameter_that_varies_is_not_held_to_be_one_number():
    """Frames that contradict each other for every constant loss may be those of a loss that varies."""
    certificate, _ = flown("any type")
    of = {said["what"]: said for said in certificate["statements"] if said["what"]}
    constant, varying = (of[f"aileron loss_of_effectiveness{more}"] for more in ("", " that varies"))
    assert constant["theta"] == "constant while it shows"
    assert constant["frame"] <= varying["frame"]
    event = {name: varying[name] for name in ("what", "column", "frame")}
    refused = refusals("any type", with_digest(certificate | {"statements": [constant | event]}))
    assert refused == [
        "aileron loss_of_effectiveness that varies excluded: theta of this type is not one number"
    ]


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


def test_the_fault_that_is_there_cannot_be_excluded():
    """The numbers of another surface's exclusion say nothing of the true one."""
    certificate, _ = flown("loss")
    other = copy.deepcopy(certificate)
    said = next(one for one in other["statements"] if one["what"] == "rudder")
    said |= {"what": "elevator", "column": "fie_elevator_excluded"}
    why = refusals("loss", with_digest(other))
    assert why == [f"elevator excluded: fie_elevator_excluded is not set in row {said['frame']}"]


def test_a_smaller_declared_bound_is_not_that_of_the_scenario():
    certificate, _ = flown("loss")
    other = copy.deepcopy(certificate)
    other["declared"]["b"] = {}
    assert refusals("loss", with_digest(other)) == ["b on p is smaller than the scenario's bound"]
    _, _, scenario = proved("loss")
    assert "SHA-256 of scenario.yaml" in next(failures(certificate, flown("loss")[1], scenario + "\n"))


GYRO_Q = "the declared error of gyro q is not that of the scenario"
HEAD = {
    "dt_s": ((1 - 1e-6, 1 + 1e-6), "dt_s is not the frame of the scenario"),
    "instants": ((2,), "instants: not those of the scenario"),
    "omega_E": ((1 - 1e-6, 1 + 1e-6), "omega_E is not the Earth's rate"),
    "declared o q": ((0.99, 1.01), GYRO_Q),
    "declared B q": ((0.99, 1.01), GYRO_Q),
    "declared m q": ((0.99, 1.01), GYRO_Q),
    "declared g q": ((0.99,), "g on q is not allowed"),
}


@pytest.mark.parametrize("field", HEAD)
def test_a_number_of_the_head_that_is_not_the_scenarios_is_refused_by_name(field):
    certificate, _ = flown("gyros")
    *within, name = field.split()
    factors, says = HEAD[field]
    for factor in factors:
        other = copy.deepcopy(certificate)
        reduce(getitem, within, other)[name] *= factor
        assert refusals("gyros", with_digest(other)) == [says]


COURSES = {
    ("hardover up", "pace_rad_s"): (lambda pace: (1 + 1e-9) * pace, "pace_rad_s is not half the rate limit"),
    ("hardover up", "stops"): (lambda stops: [stops[0] * (1 - 1e-9)], "the stop is not that of the log"),
    ("bias", "stops"): (lambda stops: [stops[0], 1.01 * stops[1]], "stops"),
    ("bias that grows", "stops"): (lambda stops: [1.01 * stops[0], stops[1]], "stops"),
    ("rate_limit", "ordered"): (lambda ordered: ordered[:-1], "ordered: frames are missing"),
    ("rate_limit", "near"): (lambda near: -near, "near is nearer than the order itself"),
}


@pytest.mark.parametrize(("kind", "field"), COURSES)
def test_what_a_course_takes_from_log_and_scenario_is_refused_by_name(kind, field):
    other = copy.deepcopy(flown("any type")[0])
    (said,) = (one for one in other["statements"] if one["what"] == f"aileron {kind}")
    change, says = COURSES[kind, field]
    said[field] = change(said[field])
    assert refusals("any type", with_digest(other)) == [f"aileron {kind} excluded: {says}"]


EARLY = 30  # a row before any fault
EMPTY = {name: {} for name in "cbgoBm"}


def single_frame(k, log, **more):
    """A term of one frame, as the log has it."""
    of = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2"}
    copies = {name: [[float(log[f"{axis}_{column}"][k]) for axis in "pqr"]] for name, column in of.items()}
    return {"weight": 1.0, "d": [0.0, 1.0, 0.0], "first": k, "frame": k, **copies, **more}


FORGED = {
    "another frame than the log's": lambda log: (
        {"dt_s": 1e-7}, {"theta": "any", "terms": [single_frame(EARLY, log)]}
    ),
    "noise denied": lambda log: ({"declared": EMPTY}, {"theta": "any", "terms": [single_frame(EARLY, log)]}),
    "a constant error beyond the whole": lambda log: (
        {"declared": EMPTY | {"B": dict.fromkeys("pqr", 1e3)}},
        {"theta": "any", "terms": [single_frame(EARLY, log)]},
    ),
    "a filter that grows": lambda log: (
        {}, {"theta": "any", "terms": [single_frame(EARLY, log, pole_per_s=-5.0, since=10)]}
    ),
    "a weight below zero": lambda log: (
        {}, {"theta": "any", "terms": [single_frame(EARLY, log, weight=-1.0)]}
    ),
    "a bound below zero": lambda log: ({}, {"test": "V", "looks": [[1.0, 0.0, -2.0]]}),
    "a level below zero": lambda log: ({}, {
        "likelihood": "t_s", "level": -50.0, "sense": "either", "axes": [1], "R": [1e-6], "first": EARLY,
        "P": [[1e-6, 0], [0, 1e-6]], "Y": [[0, 0], [0, 0]], "tolerance": [],
        "frames": [{"jitter": [0], "drift": [[0]], "signature": [1.0]}],
    }),
}  # fmt: skip


@pytest.mark.parametrize("road", FORGED)
@pytest.mark.parametrize("event", ["before any fault", "at the alarm"])
def test_a_statement_that_its_own_numbers_make_true_is_refused(road, event):
    """Before any fault by the log's column; at the alarm itself by what the scenario declares. That the sides
    are not those that it states comes after all else: then it would be accepted with others."""
    certificate, log = flown("gyros")
    more, evidence = FORGED[road](log)
    early = {"what": "rudder", "column": "fie_rudder_excluded", "frame": EARLY}
    alarm = {"what": None, "column": "detected", "frame": int(np.argmax(log["detected"]))}
    said = (early if event == "before any fault" else alarm) | evidence
    said["sides"] = [[9.0, 9.0], [1.0, 1.0]] if "likelihood" in said else [9.0, 1.0]
    refused = refusals("gyros", with_digest(certificate | more | {"statements": [said]}))
    assert refused
    assert not any("the stated sides" in why for why in refused)


@pytest.mark.parametrize("where", ["document", "statement", "term"])
def test_no_field_is_there_that_is_not_known(where):
    certificate, _ = flown("loss")
    other = copy.deepcopy(certificate)
    said = other["statements"][0]
    {"document": other, "statement": said, "term": said["terms"][0]}[where]["comment"] = "true"
    assert "the field comment is not known" in refusals("loss", with_digest(other))[0]


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
