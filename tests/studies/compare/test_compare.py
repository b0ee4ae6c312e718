"""The command, the document it writes, the standard sets, and finished runs side by side."""

import json
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.compare.leaderboard import (
    MARK,
    as_text,
    makers_of,
    write_leaderboard,
)
from beaver_ftc.studies.compare.runs import figure_of, read_runs
from beaver_ftc.studies.compare.scores import better_than_ours, document_of
from beaver_ftc.studies.compare.trial import (
    CALIBRATION,
    LAW,
    ORACLE,
    SCHEME,
    STATISTICAL,
    Entry,
    SetFlight,
    benchmark_folder,
    entries_of,
    fly_case,
    grade_of,
    of_set,
    of_sweep,
    set_names,
    with_entry,
)
from beaver_ftc.studies.present.page import contents, write_files
from commands import beaver

BEAVER = Path(sys.executable).with_name("beaver-ftc")
SWEEP = """
base:
  name: few
  duration_s: 5
  reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.4}}]}
  faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 3}]
runs: 3
vary: {"faults[0].magnitude": {uniform: [0.3, 0.9]}}
"""


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    file = tmp_path_factory.mktemp("sweep") / "few.yaml"
    file.write_text(SWEEP)
    return file


def _run(*arguments):
    return CliRunner().invoke(app, ["compare", *map(str, arguments)])


@pytest.fixture(scope="module")
def compared(sweep):
    names = ("--schemes", "observer-constant,augmented-ekf", "--laws", "nominal,lqr")
    out = sweep.parent / "out"
    done = _run("--sweep", sweep, *names, "--workers", 1, "--out", out, "--format", "json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout), out / "few"


def test_a_comparison_has_everything_asked_for(compared):
    document, folder = compared
    part = document["sets"]["few"]
    pairs = [(row["scheme"], row["law"]) for row in part["lines"]]
    assert pairs == [
        (SCHEME, LAW), ("observer-constant", LAW), ("augmented-ekf", LAW),
        (SCHEME, "nominal"), (SCHEME, "lqr"), (SCHEME, ORACLE),
    ]  # fmt: skip
    assert set(part["trade_off"]) == {SCHEME, "observer-constant", "augmented-ekf"}
    assert part["flights"] == 3
    assert part["errors"] == []
    oracle = part["lines"][-1]
    assert (oracle["ratio_median"], oracle["ratio_90"]) == (1.0, 1.0)
    assert part["lines"][0]["detection_rate"] == 1.0
    nominal = part["lines"][3]
    assert nominal["ratio_median"] > 2.0
    assert sorted(path.name for path in folder.iterdir()) == [
        "comparison.html", "comparison.json", "comparison.png"
    ]  # fmt: skip
    page = (folder / "comparison.html").read_text()
    assert "augmented-ekf" in page
    assert "http" not in page.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "exactly one of RUN..., --sweep FILE, --benchmark, --tune"),
        (("--benchmark", "--tune"), "exactly one of"),
        (("--benchmark", "--set", "publisched"), "no benchmark set 'publisched', allowed: "),
        (("--benchmark", "--schemes", "efk", "--flights", "1"), "--schemes: unknown scheme 'efk'"),
        (("--benchmark", "--laws", "lqx", "--flights", "1"), "--laws: unknown law 'lqx'"),
        (("--sweep", "nowhere.yaml"), "no such file"),
        (("--tune", "--set", "published"), "--set: allowed: only with --benchmark"),
        (("nowhere",), "nowhere: holds no metrics.json, allowed: a result folder"),
    ],
)
def test_bad_usage_is_one_line_and_exit_status_2(tmp_path, arguments, says):
    done = beaver("compare", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_plug_in_that_fails_spoils_only_its_own_line(sweep):
    entries = entries_of(["json:JSONDecoder", "observer-constant"], [LAW])
    document = document_of([fly_case(case, entries) for case in of_sweep(sweep)[:1]], entries)
    part = document["sets"]["few"]
    broken, fine = part["lines"][0], part["lines"][1]
    assert (broken["flights"], broken["failed"]) == (0, 1)
    assert (fine["flights"], fine["failed"], fine["detection_rate"]) == (1, 0, 1.0)
    assert any("json:JSONDecoder" in error for error in part["errors"])
    assert as_text(document)


def test_options_are_the_named_schemes_alone():
    named = Scenario(name="n", fdi={"scheme": "augmented-ekf", "options": {"noise": 2.0}})
    assert with_entry(named, Entry("augmented-ekf", LAW), {}).fdi.options == {"noise": 2.0}
    assert with_entry(named, Entry("observer-constant", LAW), {}).fdi.options == {}


def test_values_chosen_fly_on_their_grade_unless_the_scenario_says_otherwise():
    """Options and keys of the scenario; and our scheme with its statistical detector."""
    detectors = {
        "augmented-ekf": {"noise": 3.0, "alarm": 4.0},
        STATISTICAL: {"fdi.statistical.misnaming": 0.1},
    }
    laws = {"nominal": {"control.proportional_per_s": 5.0, "control.integral_per_s2": 6.0}}
    chosen = {"exact": {"detectors": detectors, "laws": laws}}
    given = {
        "fdi": {"scheme": "augmented-ekf", "options": {"noise": 2.0}},
        "control": {"integral_per_s2": 7.0},
    }
    flown = with_entry(Scenario(name="n", **given), Entry("augmented-ekf", "nominal"), chosen)
    assert flown.fdi.options == {"noise": 2.0, "alarm": 4.0}
    assert (flown.control.proportional_per_s, flown.control.integral_per_s2) == (5.0, 7.0)
    ours = with_entry(Scenario(name="n", **given), Entry(STATISTICAL, LAW), chosen)
    assert (ours.fdi.scheme, ours.fdi.statistical.misnaming, ours.fdi.options) == (SCHEME, 0.1, {})
    noisy = Scenario(name="n", sensors="tactical-grade", fdi={"bounds": {"sensors": "tactical-grade"}})
    assert with_entry(noisy, Entry("augmented-ekf", LAW), chosen).fdi.options == {}


def test_a_case_that_cannot_be_flown_is_said():
    scenario = Scenario(name="low", initial={"airspeed_mps": 20.0, "manifold_pressure_inhg": 10.0})
    entries = entries_of([SCHEME], [LAW])
    document = document_of([fly_case(SetFlight("s", scenario), entries)], entries)
    assert document["sets"]["s"]["lines"][0]["failed"] == 1
    assert document["sets"]["s"]["errors"]


def _line(scheme, law, **changes):
    ours = {"false_alarms_per_h": 0.0, "detection_rate": 0.9, "delay_median_s": 0.1, "delay_90_s": None,
            "isolation_rate": 0.8, "ratio_median": 1.5, "ratio_90": 2.0, "departures": 0}  # fmt: skip
    return {"scheme": scheme, "law": law, **ours, **changes}


def test_a_set_without_faults_can_be_drawn(tmp_path):
    scenario = Scenario(name="still", duration_s=2)
    entries = entries_of([SCHEME, "none"], ["lqr"])
    document = document_of([fly_case(SetFlight("healthy", scenario), entries)], entries)
    row = document["sets"]["healthy"]["lines"][0]
    assert (row["detection_rate"], row["false_alarms_per_h"]) == (None, 0.0)
    write_files(tmp_path, contents(makers_of("still"), document))
    assert as_text(document)
    assert "Comparison: still" in (tmp_path / "comparison.html").read_text()


def test_what_is_better_than_ours_is_said_and_nothing_else():
    lines = [
        _line(SCHEME, LAW),
        _line("none", LAW, false_alarms_per_h=0.0, delay_median_s=None),
        _line("rival", LAW, delay_90_s=5.0, detection_rate=0.8, delay_median_s=None),
        _line(SCHEME, "lqr", ratio_median=0.7, ratio_90=None),
        _line(SCHEME, ORACLE, ratio_median=1.0, ratio_90=1.0),
    ]
    free = {
        SCHEME: {"detection_rate": 0.9, "delay_median_s": 0.1},
        "rival": {"detection_rate": 1.0, "delay_median_s": 0.2},
    }
    assert better_than_ours(lines, free) == [
        "rival has the better 90 % detection delay, s: 5 against never",
        "with no false alarm, rival has the better detection rate: 1 against 0.9",
        "lqr has the better median tracking ratio to the oracle: 0.7 against 1.5",
    ]


def test_the_leaderboard_keeps_what_was_written_by_hand(tmp_path, compared):
    path = tmp_path / "board.md"
    path.write_text(f"# Mine\n\nWords.\n\n{MARK}\n\nold\n")
    write_leaderboard(compared[0], path)
    text = path.read_text()
    assert text.startswith(f"# Mine\n\nWords.\n\n{MARK}\n\nMade with beaver-ftc ")
    assert "old" not in text
    assert "| adaptive-estimators |" in text
    assert "What loses:" in text


CALIBRATED_ON = [CALIBRATION + grade for grade in FLIGHT_GRADES]


@pytest.mark.parametrize("name", [*set_names(), *CALIBRATED_ON])
def test_every_standard_set_is_sound(name):
    """Its flights can be drawn, and fly on values of their own."""
    cases = of_set(name)
    assert len({case.scenario.name for case in cases}) == len(cases)
    assert len({case.scenario.seed for case in cases}) == len(cases)
    assert all(case.scenario.fdi.scheme == SCHEME for case in cases)
    if name in CALIBRATED_ON:
        assert {CALIBRATION + grade_of(case.scenario) for case in cases} == {name}


def test_nothing_is_tuned_on_what_is_compared():
    """Neither the seeds of flights nor those that sweeps are drawn with."""
    tuned_on = {case.scenario.seed for name in CALIBRATED_ON for case in of_set(name)}
    compared = {case.scenario.seed for name in set_names() for case in of_set(name)}
    assert not tuned_on & compared
    drawn = Counter(load_sweep(path).file.seed for path in benchmark_folder().glob("*/*.yaml"))
    assert max(drawn.values()) == 1


def test_the_sets_cover_the_fault_types():
    types = {fault.type for case in of_set("fault-types") for fault in case.scenario.faults}
    assert types == {"bias", "stuck", "float", "oscillatory", "loss_of_effectiveness"}
    assert not any(case.scenario.faults for case in of_set("healthy"))


def test_finished_runs_stand_side_by_side(tmp_path):
    for name, law in (("a", "nominal"), ("b", "fault-tolerant")):
        (tmp_path / f"{name}.yaml").write_text(
            f"name: {name}\nduration_s: 5\ncontrol: {{law: {law}}}\n"
            "reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.4}}]}\n"
            "faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.5, at_s: 2}]\n"
        )
    assert beaver("run", "a.yaml", "b.yaml", "--no-report", cwd=tmp_path).returncode == 0
    folders = [tmp_path / "runs" / name for name in "ab"]
    done = _run(*folders, "--out", tmp_path / "out")
    assert done.exit_code == 0
    rows = {line.split("  ")[0]: line for line in done.output.splitlines()}
    assert "post RMS q, deg/s *" in rows
    assert "law *" in rows
    assert "scheme" in rows
    assert rows["faults"].count("elevator loss of effectiveness magnitude 0.5 at 2 s") == 2
    assert "* differs between the runs" in rows
    figure = figure_of(read_runs(folders))
    assert figure.get_suptitle() == "Tracking errors of a, b"
    for axes in figure.axes:
        assert [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"] == [2.0]
    assert (tmp_path / "out" / "runs" / "runs.png").stat().st_size > 10_000
    page = (tmp_path / "out" / "runs" / "runs.html").read_text()
    assert page.count('<p class="folder">') == 2
    done = _run(*folders, "--out", tmp_path / "out", "--format", "json")
    assert set(json.loads(done.stdout)["runs"]) == {"a", "b"}


def test_entries_are_every_scheme_with_our_law_and_every_law_with_our_scheme():
    assert entries_of(["x"], ["y"]) == [
        Entry("x", LAW), Entry(SCHEME, "y"), Entry(SCHEME, LAW), Entry(SCHEME, ORACLE)
    ]  # fmt: skip


def test_a_comparison_that_is_killed_goes_on_to_the_same_document(sweep, compared, tmp_path):
    names = ("--schemes", "observer-constant,augmented-ekf", "--laws", "nominal,lqr", "--workers", "2")
    command = [BEAVER, "compare", "--sweep", sweep, *names, "--out", tmp_path / "again"]
    parts = tmp_path / "again" / ".few.flown" / "parts"
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    patience = time.monotonic() + 300
    while process.poll() is None and not list(parts.glob("*.json")) and time.monotonic() < patience:
        time.sleep(0.01)
    process.kill()
    process.wait()
    kept = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.json")}
    assert kept
    subprocess.run([*command, "--format", "json"], check=True, capture_output=True)
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["few"]
    document = json.loads((tmp_path / "again" / "few" / "comparison.json").read_text())
    for each in (document, compared[0]):
        for row in each["sets"]["few"]["lines"]:
            row["us"] = 0.0  # the one thing that is measured on the clock
    assert document["sets"] == compared[0]["sets"]


def test_a_result_whose_scenario_is_no_yaml_is_said_in_one_line(tmp_path):
    (tmp_path / "metrics.json").write_text("{}")
    (tmp_path / "log.parquet").touch()
    (tmp_path / "scenario.yaml").write_text("name: [")
    with pytest.raises(BadInput, match=r"metrics\.json or scenario\.yaml cannot be read") as said:
        read_runs([tmp_path])
    assert "\n" not in str(said.value)
