"""What commands hand on to what they are of, what they answer with it, and their exit status."""

import json
import re
from copy import deepcopy
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest

import commands
import needs
from beaver_ftc.aircraft import aircraft as of_aircraft
from beaver_ftc.cli import catalogue
from beaver_ftc.cli.main import Row
from beaver_ftc.commands import registered
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Expectation, Judged


def test_options_of_all_commands(changed):
    """Defaults, names, ranges and helps of every option; of each package by itself."""
    found = {}
    for name, target in registered().items():
        parameters = signature(Row(name, target).read()).parameters.values()
        options = {each.name: _option(each) for each in parameters}
        found.setdefault(target.partition(".")[0], {})[name] = options
    for package, commands_of_it in found.items():
        assert not changed(commands_of_it, part=package)


def _option(parameter):
    _, option = get_args(parameter.annotation)
    default = "" if parameter.default is parameter.empty else parameter.default
    ends = ["" if of is None else of for of in (option.min, option.max, option.metavar)]
    return " | ".join(map(str, (default, getattr(option, "param_decls", None), *ends, option.help)))


@pytest.fixture
def beaver(monkeypatch, tmp_path):
    """Runs a command with functions put in place: (status, standard output, what these were given)."""
    monkeypatch.chdir(tmp_path)

    def run(asked, **instead):
        given = []
        for path, result in instead.items():
            module, _, name = path.replace("__", ".").rpartition(".")
            module = module if module.startswith("beaver_ftc_") else f"beaver_ftc.{module}"
            noting = _noting(name, result, given)
            monkeypatch.setattr(import_module(module), name, noting)
        done = commands.beaver(*asked.split(), cwd=tmp_path)
        return done.returncode, re.sub(r" at 0x[0-9a-f]+", "", done.stdout), given

    return run


def _noting(name, result, given):
    def called(*of, **named):
        given.append((name, *map(_shown, of), {key: _shown(value) for key, value in named.items()}))
        return result(*of, **named) if callable(result) else deepcopy(result)

    return called


def _shown(value):
    """What can be compared of a value: of objects their names, or their fields; a time is not negative."""
    if isinstance(value, dict):
        return {key: of >= 0 if key == "took_s" else _shown(of) for key, of in value.items()}
    if isinstance(value, list | tuple):
        return list(map(_shown, value))
    if isinstance(value, str | int | float | Path | None):
        return str(value).replace(str(Path.cwd()), "HERE") if isinstance(value, Path) else value
    if isinstance(value, frozenset):
        return sorted(value)
    if is_dataclass(value) and (isinstance(value, Judged | Expectation) or not hasattr(value, "name")):
        return _shown({field.name: getattr(value, field.name) for field in fields(value)})
    return getattr(value, "vanes", getattr(value, "name", "(object)"))


CORES = {"studies__engine__workers__cores": 7}
MATRIX = {
    **CORES,
    "studies__matrix__fault_matrix__run_matrix": {"passed": False},
    "studies__matrix__fault_matrix__as_text": "m",
    "studies__matrix__pitch_lost__run_pitch_lost": {"passed": True},
    "studies__matrix__pitch_lost__as_text": "l",
}
POWER = {
    "studies__power__shown__run_power": {"a": 1},
    "studies__power__shown__as_text": "p",
    "studies__power__survey__contenders": lambda names: names,
    **CORES,
}
CHANCES = {"studies__power__probabilities__answers": ["found soon"]}
REPRODUCE = {
    **CORES,
    "studies__reproduce__reproduction__reproduce": {"passed": False},
    "studies__reproduce__reproduction__as_text": "r",
}
VERIFY = {
    "studies__verify__conduct": ["row"],
    "studies__verify__summarise": {"kept": False},
    "studies__verify__summary_text": "v",
    **CORES,
}


def _flown(scenario, options, say):
    """A flight that tells the options it was asked with."""
    metrics = {"scenario": scenario.name, "passed": False, "expectations": []}
    asked = {name: str(value) for name, value in vars(options).items()}
    return SimpleNamespace(save=lambda out, report: out / f"report {report}", metrics=metrics | asked)


SITL = {"beaver_ftc_links__sitl__serve__serve": _flown, "results__verdict__verdict_text": "verdict"}
SURVEY = {
    "studies__detectability__run_survey": {"points": [1], "pairs": [2]},
    "studies__detectability__text": "d",
}
SAID = {
    "studies__detectability__run_survey": {
        what: [{"fault": "aileron"}, {"fault": "rudder"}] for what in ("points", "pairs")
    },
    "studies__detectability__answers": ["a line"],
}
BENCH = {"studies__bench__measure__bench": {"b": 1}, "studies__bench__measure__text_of": "bench"}
DERIVE = {
    "beaver_ftc_aircraft__derive__derivation__derive": SimpleNamespace(
        name="made", aircraft=SimpleNamespace(folder=Path("folder/made"))
    ),
    "scenario__validate_scenario": SimpleNamespace(name="first"),
    "loop__fly": None,
    "beaver_ftc_aircraft__derive__derived__document_of": {"d": 2},
    "beaver_ftc_aircraft__derive__derived__text_of": "derived",
}
COMPARE = {
    **CORES,
    "studies__compare__trial__of_set": lambda name, most: [SimpleNamespace(set=name)] * 2,
    "studies__compare__trial__of_sweep": lambda path, most: [SimpleNamespace(set="of-a-sweep")],
    "studies__compare__trial__entries_of": lambda schemes, laws: [*schemes, *laws],
    "studies__compare__leaderboard__run_comparison": {"c": 1},
    "studies__compare__leaderboard__as_text": "c\n",
    "studies__compare__leaderboard__write_leaderboard": None,
    "studies__compare__trial__set_names": ["one", "two"],
    "studies__compare__tune__tune": lambda methods, *how: {
        "methods": [f"{method.grade} {method.name}" for method in methods],
        "how": how,
    },
    "studies__compare__tune__write_tuned": lambda document, folder: folder / "tuned.json",
    "studies__compare__tune__as_text": str,
    "studies__compare__tune__read_tuned": lambda path: {"read": str(path)},
    "studies__compare__runs__write_runs": [SimpleNamespace(name="r", document="r")],
    "studies__compare__runs__labels": lambda runs: ["first"],
    "studies__compare__runs__as_text": "runs",
    "beaver_ftc_logs__recorded__benchmark__run_benchmark": {"rec": 1},
    "beaver_ftc_logs__recorded__benchmark__as_text": "recorded",
    "beaver_ftc_logs__recorded__benchmark__result_files": {"flights.png": b"picture"},
    "beaver_ftc_logs__recorded__benchmark__update_page": None,
    "beaver_ftc_logs__recorded__other_days__run_other_days": {"o": 1},
}
FLIGHT = {"scenario": "x", "passed": True}
RUN = {
    "results__writer__run": lambda scenario, *_: FLIGHT | {"passed": scenario.name != "fault-free"},
    "results__verdict__verdict_text": "verdict",
}
SWEEP = {
    "studies__engine__workers__start_early": None,
    "studies__sweep__campaign__run_sweep": {"s": 1},
    "studies__sweep__campaign__replay": {"passed": True, "folder": "f"},
    "studies__sweep__summary_page__summary_text": "swept",
    "studies__sweep__summary_page__verdict": Judged("many"),
    "results__verdict__verdict_text": "verdict",
    "results__junit__write_junit": None,
}
LIVE = {
    "beaver_ftc_live__page__serve__serve": lambda load, out, place, say: say(
        f"{load().name} at {place}", ["one"][: place.guests]
    )
}
MISMATCH = {
    "studies__mismatch__study__run_mismatch": lambda scenario, *_: ({"m": scenario.name}, "tally"),
    "studies__mismatch__tables__mismatch_text": "split",
    "studies__mismatch__tables__comparison_text": "compared",
    "studies__mismatch__study__write_comparison": "folder",
    "studies__mismatch__study__entry": lambda of: of["m"],
    "studies__mismatch__bound__recommended_for": {"recommended": 3},
    "studies__mismatch__study__run_map": [4],
}
IDENTIFY = {
    "beaver_ftc_logs__mixing__load_vehicle_for_logs": ("vehicle", ["mixed"]),
    "beaver_ftc_logs__samples__load_flights_for_fit": ["flight"],
    "beaver_ftc_logs__identification__scale_if_better": (
        [SimpleNamespace(name="pressed", n_log_parts=2, notes=["long"])],
        "described",
    ),
    "beaver_ftc_logs__identification__identify": SimpleNamespace(
        identification_results={"i": 1}, settings=SimpleNamespace(model_dump=lambda by_alias: {"s": 2})
    ),
    "beaver_ftc_logs__identification__identification_text": "fitted",
    "beaver_ftc_logs__model__model_file_text": "text",
    "studies__engine__store__write_whole": None,
    "beaver_ftc_logs__pages__render_identification": "page",
    "beaver_ftc_logs__pages__refuse_foreign_file": None,
}
DIAGNOSE = {
    "beaver_ftc_logs__detectors__check_detector_name": None,
    "beaver_ftc_logs__model__load_model": SimpleNamespace(vehicle="vehicle", groups="groups"),
    "beaver_ftc_logs__samples__stream_flights": ["one", "two"],
    "beaver_ftc_logs__findings__as_text": lambda each: each["flight"],
    "beaver_ftc_logs__detectors__diagnose_with_detector": "rows",
    "beaver_ftc_logs__findings__verdict_document": lambda of, *_: {"flight": of},
    "beaver_ftc_logs__scoring__score_diagnosis": 0.5,
    "beaver_ftc_logs__pages__write_diagnosis": "folder",
    "beaver_ftc_logs__replay__is_log_of_run": lambda path: path.name == "log.parquet",
    "beaver_ftc_logs__replay__replay_run_log": ("columns", {"flight": "ours"}),
    "beaver_ftc_logs__replay__as_text": "replayed",
    "beaver_ftc_logs__pages__write_results": "folder",
}
BY_AIRCRAFT = {
    "beaver_ftc_logs__by_aircraft__load_diagnosed": SimpleNamespace(
        name="diagnosed", aircraft=SimpleNamespace(surfaces=("left", "right"))
    ),
    "beaver_ftc_logs__by_aircraft__read_inputs": lambda part, *_: SimpleNamespace(
        name=f"inputs of {part}", samples=f"samples of {part}"
    ),
    "beaver_ftc_logs__by_aircraft__diagnose_inputs": lambda inputs, _: (
        f"rows by {inputs.name}", {"flight": inputs.samples},
    ),
    "beaver_ftc_logs__by_aircraft__as_text": lambda each: each["flight"],
    "beaver_ftc_logs__readers__check_exists": None,
    "beaver_ftc_logs__samples__read_vehicle_parts": ["part 1", "part 2"],
    "beaver_ftc_logs__mixing__load_vehicle_for_logs": ("vehicle", ["mixed"]),
    "beaver_ftc_logs__scoring__score_diagnosis": 0.5,
    "beaver_ftc_logs__pages__write_aircraft_diagnosis": "folder",
}  # fmt: skip
IMPORT = {
    "beaver_ftc_aircraft__gtm__conversion__convert": SimpleNamespace(name="gtm", folder=Path("folder/gtm")),
    "scenario__validate_scenario": SimpleNamespace(name="first"),
    "loop__fly": None,
    "beaver_ftc_aircraft__gtm__conversion__document_of": {"d": 3},
    "beaver_ftc_aircraft__gtm__conversion__text_of": "imported",
}
SUBMIT = {
    "beaver_ftc_live__challenge__folders__source_of": "source",
    "beaver_ftc_live__challenge__grading__tried": {
        "kind": "law",
        "class": "Mine",
        "walls": [],
        "points": 61.5,
    },
    "beaver_ftc_live__challenge__folders__keep": lambda source, name, to: to / f"{name}-7.py",
}
SMALLEST = {
    "studies__smallest__survey__run_smallest": {"folder": "f"},
    "studies__smallest__survey__as_text": "s",
    **CORES,
}
DECAY = {
    "studies__decay__survey__run_decay": {"folder": "f"},
    "studies__decay__survey__as_text": "d",
    **CORES,
}
MECHANISMS = {
    "studies__mechanisms__command__run_mechanisms": {"folder": "f", "passed": False},
    "studies__mechanisms__command__as_text": "m",
    **CORES,
}
EVIDENCE = RUN | {
    "beaver_ftc_assurance__evidence__plan__load_plan": lambda name: SimpleNamespace(
        name=name, file=SimpleNamespace(name="of-" + name)
    ),
    "beaver_ftc_assurance__evidence__shown__run_plan": {"passed": False, "e": 1},
    "beaver_ftc_assurance__evidence__shown__as_text": "e",
    "beaver_ftc_assurance__evidence__shown__as_expectations": (Expectation("A", True, None, "met"),),
    "beaver_ftc_assurance__evidence__shown__of_flight": lambda plan, name: (
        SimpleNamespace(name=name),
        tuple(Expectation(of, of == "A", None, f"met: {of}") for of in "AB"),
    ),
    "results__junit__write_junit": None,
    **CORES,
}
SEPARATE = {
    "beaver_ftc_assurance__separation__separate": lambda scenario, rate_deg_s: {"passed": rate_deg_s > 10.0},
    "beaver_ftc_assurance__separation__write": Path("folder"),
    "beaver_ftc_assurance__separation__as_text": "apart",
}
GRADE = {
    "beaver_ftc_live__challenge__grading__grade": {"g": 1},
    "beaver_ftc_live__challenge__grading__as_text": "graded",
    **CORES,
}
RARE = {
    "studies__engine__workers__start_early": None,
    **CORES,
    "studies__sweep__rare__run_rare": {"r": 1},
    "studies__sweep__rare__as_text": "rare",
}
ASKED = [
    ("run fault-free", RUN),
    ("run rudder-stuck --csv --acmi --as ulog --no-report --out o --format json", RUN),
    ("run fault-free rudder-stuck", RUN), ("run nothing.yaml --format json", RUN),
    ("sweep elevator-effectiveness", SWEEP), ("sweep nothing.yaml --format json --junit j.xml", SWEEP),
    ("sweep elevator-effectiveness --search delay --workers 3 --out o --format json --keep-logs all", SWEEP),
    ("sweep elevator-effectiveness --keep-logs 3,17 --certificate --resume", SWEEP),
    ("sweep elevator-effectiveness --certificate --no-report --workers 2", SWEEP),
    ("sweep elevator-effectiveness --keep-logs failed --certificate", SWEEP),
    ("sweep elevator-effectiveness --keep-logs 3,x", SWEEP),
    ("sweep elevator-effectiveness --replay 3", SWEEP), ("sweep elevator-effectiveness --backend ray", SWEEP),
    ("sweep elevator-effectiveness --replay 0 --format json", SWEEP),
    ("sweep elevator-effectiveness --rare no_departure", RARE),
    ("sweep elevator-effectiveness --rare no_departure --workers 2 --out o --format json", RARE),
    ("smallest fault-free --surface rudder", SMALLEST),
    ("smallest rudder-stuck --surface flap --within 2 --seed 3 --workers 2 --out o --format json", SMALLEST),
    ("decay fault-free", DECAY),
    ("decay rudder-stuck --flights 3 --seed 2 --workers 2 --out o --format json", DECAY),
    ("mechanisms", MECHANISMS),
    ("mechanisms --draws 2 --seed 3 --workers 2 --out o --format json", MECHANISMS),
    ("evidence flight-controls", EVIDENCE),
    ("evidence flight-controls --workers 2 --out o --format json --junit j.xml", EVIDENCE),
    ("evidence flight-controls --replay one", EVIDENCE),
    ("evidence flight-controls --replay one --no-report --out o --format json", EVIDENCE),
    ("separate fault-free", SEPARATE), ("separate fault-free --rate-deg-s 5 --out o --format json", SEPARATE),
    ("challenge grade .", GRADE), ("challenge grade . --workers 2 --format json", GRADE),
    ("challenge grade nowhere", GRADE), ("check nothing", {}), ("challenge submit mine.py", SUBMIT),
    ("challenge submit in/mine.py --student ada --to autumn", SUBMIT),
    ("challenge submit mine.py --to autumn --format json", SUBMIT),
    ("live", LIVE), ("live rudder-stuck --port 80 --out o", LIVE),
    ("live rudder-stuck --aircraft beaver", LIVE), ("live --guests 1", LIVE), ("live --host 0.0.0.0", LIVE),
    ("sitl fault-free --as ardupilot", SITL), ("sitl fault-free --as px4 --mavlink nowhere", SITL),
    ("sitl fault-free --as px4 --port 1 --rate 200 --hold 3 --mavlink h:14550 --page 0 --format json", SITL),
    ("mismatch fault-free", MISMATCH), ("mismatch fault-free --variant declared,engine-neglected", MISMATCH),
    ("mismatch fault-free rudder-stuck --map --no-report --format json --out o", MISMATCH),
    ("mismatch fault-free --format json --map", MISMATCH), ("mismatch nothing.yaml --format json", MISMATCH),
    ("mismatch fault-free --variant linearised,linearised", MISMATCH),
    ("identify a b --vehicle v --out o/model.yaml", IDENTIFY),
    ("identify a --vehicle v --out m.yaml --reader ulog --format json", IDENTIFY),
    ("diagnose a --model m", DIAGNOSE),
    ("diagnose a --model m --score --detector x --out o --format json", DIAGNOSE),
    ("diagnose log.parquet", DIAGNOSE), ("diagnose log.parquet --out o --format json", DIAGNOSE),
    ("diagnose log.parquet other.csv", DIAGNOSE),
    ("diagnose a --aircraft beaver", BY_AIRCRAFT), ("diagnose a b --aircraft x --vehicle v", BY_AIRCRAFT),
    ("diagnose a --aircraft x --scenario s --vehicle v --score --out o --reader ulog", BY_AIRCRAFT),
    ("diagnose a --aircraft x --vehicle v --certificate --format json", BY_AIRCRAFT),
    ("validate fault-free elevator-effectiveness", {}),
    ("validate nothing.yaml fault-free --format json", {}),
    ("new mine", {}), ("new mine --like nothing", {}), ("new mine --out a.yaml", {}), ("new a.b", {}),
    ("new other --like rudder-stuck --out made/here", {}), ("show nothing", {}),
    ("matrix", MATRIX),
    ("matrix --airspeed 35 --airspeed 40 --workers 3 --declared --turbulence light --format json", MATRIX),
    ("matrix --pitch-lost --out o --airspeed 45", MATRIX),
    ("matrix --aircraft beaver --workers 0", MATRIX), ("matrix --aircraft beaver", MATRIX),
    ("matrix --pitch-lost --declared", MATRIX), ("matrix --pitch-lost --aircraft beaver", MATRIX),
    ("matrix --declared --aircraft beaver", MATRIX), ("matrix --turbulence light", MATRIX),
    ("power", POWER),
    ("power --grid full --schemes a,,b --workers 2 --out o --format json", POWER),
    ("power --turbulence none --sensors ideal", POWER),
    ("reproduce", REPRODUCE), ("reproduce --workers 5 --out o --format json", REPRODUCE),
    ("verify", VERIFY),
    ("verify --hours 0.5 --faults 3 --seed 4 --workers 2 --steps --out o --format json", VERIFY),
    ("power --surface rudder --airspeed 40 --altitude 900 --aircraft beaver-split", POWER | CHANCES),
    ("power --surface flap", POWER),
    ("detectability fault-free --surface rudder --airspeed 40 --airspeed 50 --altitude 0", SAID),
    ("detectability fault-free --surface flap", SAID),
    ("detectability fault-free --aircraft beaver-split --format json", SURVEY),
    ("detectability fault-free --out o", SURVEY), ("detectability fault-free --format json", SURVEY),
    ("bench --rounds 3", BENCH), ("bench --no-parts --format json", BENCH), ("bench --rounds 2", BENCH),
    ("derive x", DERIVE), ("derive x --out o --envelope e --format json", DERIVE),
    ("derive x --engines", DERIVE), ("derive x --engines --out o", DERIVE),
    ("import gtm x.mat", IMPORT), ("import gtm x.mat --out o --format json", IMPORT),
    ("compare --benchmark", COMPARE),
    ("compare --benchmark --set one --flights 3 --laws lqr --format json", COMPARE),
    ("compare --sweep s --schemes rls-monitor --workers 4 --leaderboard page --out o", COMPARE),
    ("compare --sweep s --schemes rls-monito --laws lq", COMPARE),
    ("compare --tune --laws lqr --grade exact", COMPARE), ("compare --tune --draw 2", COMPARE),
    ("compare --benchmark --draw 2", COMPARE),
    ("compare --tune --schemes augmented-ekf,none --trials 9 --seed 3 --flights 9 --format json", COMPARE),
    ("compare --benchmark --set one --schemes zhang2005 --tuned mine.json --format json", COMPARE),
    ("compare --tune --grade windy", COMPARE), ("compare --tune --laws lq", COMPARE),
    ("compare a b", COMPARE), ("compare a b --out o --format json", COMPARE),
    ("compare --flights recorded", COMPARE),
    ("compare --flights recorded --out o --leaderboard page.md", COMPARE),
    ("compare --flights recorded --other-days --leaderboard page.md --format json", COMPARE),
    ("compare --flights recorded --other-days", COMPARE),
    ("compare", COMPARE), ("compare a --tune", COMPARE), ("compare --tune --flights recorded", COMPARE),
    ("compare --tune --flights 0", COMPARE), ("compare --tune --flights 1", COMPARE),
    ("compare --tune --flights -3", COMPARE), ("compare --tune --set x", COMPARE),
    ("compare --benchmark --grade exact", COMPARE),
    ("compare --tune --tuned a", COMPARE), ("compare --benchmark --other-days", COMPARE),
]  # fmt: skip


def _are_there(rows):
    """The rows of commands that are installed, without what is put in place in packages that are not."""
    known = {name.partition(" ")[0] for name in registered()}
    for asked, instead in rows:
        there = {path: of for path, of in instead.items() if find_spec(_package(path))}
        if asked.split()[0] in known and (there == instead or "recorded" not in asked):
            yield asked, there


def _package(path):
    first = path.partition("__")[0]
    return first if first.startswith("beaver_ftc_") else "beaver_ftc"


ASKED = [*_are_there(ASKED)]


def _kind(asked):
    """The command; of recorded flights by itself."""
    return asked.split()[0] + (" recorded" if "--flights recorded" in asked else "")


KINDS = dict.fromkeys(_kind(asked) for asked, _ in ASKED)


def test_no_command_is_left_out():
    elsewhere = {"list", "schema", "trim", "linearise"}  # below, and in test_interface.py
    assert {name.split()[0] for name in registered()} <= {*KINDS, *elsewhere}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_handed_on_and_answered(beaver, kind, changed):
    assert not changed({asked: beaver(asked, **instead) for asked, instead in ASKED if _kind(asked) == kind})


@needs.service("compare_recorded")
def test_the_picture_beside_a_page_is_renewed(beaver, tmp_path):
    (tmp_path / "images").mkdir()
    beaver("compare --flights recorded --leaderboard page.md", **COMPARE)
    assert (tmp_path / "images" / "recorded-flights.png").read_bytes() == b"picture"
    answered = json.loads(beaver("compare --flights recorded --format json --out other", **COMPARE)[1])
    assert answered["folder"] == str(Path("other") / "recorded-flights")


def test_a_trim_as_a_table(beaver, changed):
    status, shown, _ = beaver("trim --airspeed-mps 40 --altitude-m 1000 --flap-deg 5 --engine-rpm 1900")
    assert not changed([status, [re.sub(r"\S+(?= m/s2 or)", "tiny", line) for line in shown.splitlines()]])
    status, shown, _ = beaver("trim --airspeed-mps 46 --format json")
    document = json.loads(shown)
    assert (document["airspeed_mps"], document["envelope_valid"], list(document["residual"])) == (
        46.0, True, ["udot_mps2", "vdot_mps2", "wdot_mps2", "pdot_rad_s2", "qdot_rad_s2", "rdot_rad_s2"],
    )  # fmt: skip
    assert (
        beaver("trim --airspeed-mps 60 --altitude-m 0")[1].splitlines()[-1].startswith("outside the flight-")
    )


def test_what_there_is_to_choose_from(beaver, changed):
    document = json.loads(beaver("list --format json")[1])
    for kind in ("schemes", "laws", "faults", "signals"):
        assert not changed(catalogue._section(kind, document[kind]).splitlines(), part=kind)
    assert list(document) == [
        "scenarios", "sweeps", "plans", "aircraft", "schemes", "laws", "faults", "signals"
    ]  # fmt: skip
    assert {"name", "description"} == set(document["scenarios"][0])
    names = [entry["name"] for entry in document["aircraft"]]
    assert names[:2] == ["beaver", "beaver-split"]
    assert "jsbsim:c172x" in names
    assert names[2] == "gtm"
    derived = {entry["description"].partition("package, ")[2] for entry in document["aircraft"][3:]}
    assert derived <= {"derived", "derived at first use"}


def test_an_aircraft_is_there_once_its_file_is(monkeypatch, tmp_path):
    """A folder alone is none; of JSBSim's aircraft each says of itself whether it is derived."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    of_aircraft.imported_folder("gtm").mkdir(parents=True)
    monkeypatch.setattr(of_aircraft, "is_derived", lambda name: name == "c172x")
    listed = dict(catalogue._aircraft())
    assert listed["gtm"].startswith("not imported yet, allowed after ")
    assert listed["jsbsim:c172x"] == "from the jsbsim package, derived"
    assert listed["jsbsim:c172p"] == "from the jsbsim package, derived at first use"


def test_schemas_of_both_kinds_of_file(beaver):
    for asked, title in (("schema", "beaver-ftc scenario"), ("schema --sweep", "beaver-ftc sweep")):
        assert json.loads(beaver(asked)[1])["title"] == title


def test_who_is_chosen():
    from beaver_ftc.cli.compare import _chosen
    from beaver_ftc.plugins import LAWS, registered

    assert _chosen("--laws", LAWS, None, "fault-tolerant", alone=True) == list(registered(LAWS))
    assert _chosen("--laws", LAWS, None, "fault-tolerant", alone=False) == []
    assert _chosen("--laws", LAWS, "lqr, fault-tolerant,lqr", "fault-tolerant", alone=True) == [
        "fault-tolerant",
        "lqr",
    ]
    with pytest.raises(BadInput) as caught:
        _chosen("--laws", LAWS, "lq,nomina", "fault-tolerant", alone=True)
    assert [line.partition(",")[0] for line in str(caught.value).splitlines()] == [
        "--laws: unknown law 'lq'", "--laws: unknown law 'nomina'",
    ]  # fmt: skip
