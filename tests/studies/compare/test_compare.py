"""The command, the document it writes, the standard sets, and finished runs side by side."""

import json
from collections import Counter

import pytest
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweeps import load_sweep
from beaver_ftc.studies.compare.leaderboard import MARK, as_text, write_leaderboard
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.sets import CALIBRATION, benchmark_folder, of_set, of_sweep, set_names
from beaver_ftc.studies.compare.trial import (
    LAW,
    ORACLE,
    SCHEME,
    STATISTICAL,
    Entry,
    entries_of,
    fly_case,
    grade_of,
    with_entry,
)
from commands import beaver

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


def test_the_board_is_written_below_its_mark_and_what_stands_above_stays(compared, tmp_path):
    document, board = compared[0], tmp_path / "board.md"
    board.write_text(f"# Mine\n\nWords.\n\n{MARK}\n\nold\n\n{MARK}\n\nolder\n")
    write_leaderboard(document, board)
    text = board.read_text()
    assert text.startswith(f"# Mine\n\nWords.\n\n{MARK}\n\nMade with ")
    assert "old" not in text
    said = document["sets"]["few"]["who_is_better"].values()
    assert all(sentence in text and sentence in as_text(document) for sentence in said)


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
        (("--sweep", "nowhere.yaml", "--trials", "7"), "--trials: allowed: only with --tune"),
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


def test_finished_runs_stand_side_by_side(tmp_path):
    for name, law in (("a", "nominal"), ("b", "fault-tolerant")):
        (tmp_path / f"{name}.yaml").write_text(
            f"name: {name}\nduration_s: 5\ncontrol: {{law: {law}}}\n"
            "reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.4}}]}\n"
            "faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.5, at_s: 2}]\n"
        )
    assert beaver("run", "a.yaml", "b.yaml", "--no-report", cwd=tmp_path).returncode == 0
    folders = [tmp_path / "runs" / name for name in "ab"]
    metrics = json.loads((folders[0] / "metrics.json").read_text())
    metrics["envelope"] = {"exits": 65, "outside_s": 3.75, "exits_left_out": 1}  # one more than are listed
    (folders[0] / "metrics.json").write_text(json.dumps(metrics))
    done = _run(*folders, "--out", tmp_path / "out")
    assert done.exit_code == 0
    rows = {line.split("  ")[0]: line for line in done.output.splitlines()}
    assert "post RMS q, deg/s *" in rows
    assert "law *" in rows
    assert "scheme" in rows
    assert rows["outside the envelope, s *"].split()[-2:] == ["3.75", "0"]
    assert rows["faults"].count("elevator loss of effectiveness magnitude 0.5 at 2 s") == 2
    assert "* differs between the runs" in rows
    written = {path.name for path in (tmp_path / "out" / "runs").iterdir()}
    assert written == {"runs.json", "runs.png", "runs.html"}
    done = _run(*folders, "--out", tmp_path / "out", "--format", "json")
    assert set(json.loads(done.stdout)["runs"]) == {"a", "b"}
