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
from given import given
from samples import samples

CHECKER = Path(__file__).parents[4] / "tools/check_certificate.py"
LOSS = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.5, "at_s": 0.5}


GIVEN = given(__file__)
FLIGHTS = GIVEN["flights"]
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


def single_frame(k, log, **more):
    """A term of one frame, as the log has it."""
    of = {"x": "measured_rad_s", "F": "design_rad_s2", "eta_bar": "eta_bar_rad_s2"}
    copies = {name: [[float(log[f"{axis}_{column}"][k]) for axis in "pqr"]] for name, column in of.items()}
    return {"weight": 1.0, "d": [0.0, 1.0, 0.0], "first": k, "frame": k, **copies, **more}


def changed_to(value, node, key, log):
    """What a row of `refused` puts in the place of what a node has there."""
    match value:
        case {"times": factor}:
            return factor * node[key]
        case {"frame": k, **more}:
            return [single_frame(k, log, **more)]
    return value


def holder_of(document, place):
    """What holds a place, its keys with dots between them; and the last key."""
    *within, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    return reduce(getitem, within, document), last


@pytest.mark.parametrize(("name", "what", "changes", "says"), GIVEN["refused"])
def test_what_is_another_is_refused_in_words(name, what, changes, says):
    certificate, log = flown(name)
    other = copy.deepcopy(certificate)
    found = [other] if what == "document" else [one for one in other["statements"] if one["what"] == what]
    for place, value in changes.items():
        node, key = holder_of(found[0], place)
        node[key] = changed_to(value, node, key, log)
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
