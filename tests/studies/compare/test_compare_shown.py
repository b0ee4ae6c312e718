"""A comparison of made flights, all of it: document, tables, page, figure; and runs side by side."""

import json
from math import inf, nan
from pathlib import Path

import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare import runs
from beaver_ftc.studies.compare.leaderboard import (
    MARK,
    as_text,
    figure_of,
    lost,
    makers_of,
    page_of,
    write_leaderboard,
)
from beaver_ftc.studies.compare.replay import Trace, _statistic, alarms_at
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.trial import LAW, SCHEME, Result, SetFlight, Trial, entries_of
from beaver_ftc.studies.engine.workers import Case
from beaver_ftc.studies.present.figures import panels
from flying import scenario
from kept import page, picture

SCHEMES, LAWS = ("observer", "none"), ("lqr", "nominal")


def result(entry, k, healthy):
    """Ours is good, the observer late, lqr better but for one departure; nothing is like anything else."""
    late = {SCHEME: 0.1, "observer": 0.4, "none": inf}[entry.scheme] * (1 + k)
    detected = not healthy and late < 2.0
    rms = {LAW: 1.5, "lqr": 1.2, "nominal": 4.0, "oracle": 1.0}[entry.law] * (
        1 + 0.1 * k * (entry.law != "oracle")
    )
    departed = entry.law == "lqr" and k == 3
    return Result(
        entry, false_alarm=(entry.scheme, k) == ("observer", 1), fault_free_s=1200.0 - 100 * k,
        faulted=not healthy, delay_s=late if detected else inf, isolated="elevator" if detected else None,
        correct=detected and k != 2, isolation_delay_s=late + 0.2 if detected and k != 2 else inf,
        rms_deg_s=inf if departed else rms, departed=departed, us=5.0 + len(entry.scheme) + k,
        before_deg_s=0.3 * rms, after_deg_s=rms, travel_deg_s=2.0 + k, energy_deg2_s2=12.0 + 3 * k,
        error="could not be trimmed" if (entry.law, k) == ("nominal", 4) else None,
    )  # fmt: skip


def traces(k, healthy):
    steps = () if healthy else ((0.0, 0.4), (0.1 * (k + 1), 1.5), (1.0, 3.0 + k))
    rises = ((0.0, 0.1), (100.0 * (k + 1), 0.3 + 0.1 * k))
    ours = Trace(0.3 + 0.1 * k, steps, not healthy, 1200.0, 2.0, rises)
    noisy = Trace(1.5 if k == 1 else 0.2, steps, not healthy, 1200.0, 3.0, ((50.0, 1.5 if k == 1 else 0.2),))
    return {SCHEME: ours, "observer": noisy}


@pytest.fixture
def compared():
    entries = entries_of(SCHEMES, LAWS)
    trials = [
        Trial(name, [result(entry, k, healthy) for entry in entries], traces(k, healthy))
        for name, healthy in (("faulty", False), ("healthy", True))
        for k in range(5)
    ]
    trials[0].failures.append("observer, on a recorded flight: ValueError: no")
    return document_of(trials, entries) | {"versions": {"ours": "1", "theirs": "2"}}


def test_all_that_is_found(compared, changed):
    assert not changed({name: part["lines"] for name, part in compared["sets"].items()}, "lines")
    assert not changed(
        {n: {k: v for k, v in part.items() if k != "lines"} for n, part in compared["sets"].items()}
    )


def test_all_that_is_shown(compared, changed, tmp_path):
    assert not changed(as_text(compared).splitlines(), "text")
    figure = figure_of(compared)
    assert not changed(picture(figure), "figure")
    assert all(line.get_visible() for axes in figure.axes for line in axes.xaxis.get_gridlines())
    (tmp_path / "comparison.png").write_bytes(b"a picture")
    assert not changed(page(page_of(compared, "Comparison: made", tmp_path)), "page")
    write_leaderboard(compared, tmp_path / "board.md")
    text = (tmp_path / "board.md").read_text()
    assert text.startswith(
        f"# Benchmark\n\n{MARK}\n\nMade with ours 1, theirs 2.\n\n## faulty: 5 flights\n\n| scheme "
    )
    assert not changed([line for line in text.splitlines() if not line.startswith("|")], "board")
    assert list(makers_of("made")) == ["comparison.json", "comparison.png", "comparison.html"]


@pytest.mark.parametrize("below", ["", f"{MARK}\n\nold\n", f"{MARK}\n\nold\n\n{MARK}\n\nolder\n"])
def test_what_was_written_above_the_mark_stays(below, compared, tmp_path):
    board = tmp_path / "board.md"
    board.write_text(f"# Mine\n\nWords.\n\n{below}")
    write_leaderboard(compared, board)
    assert board.read_text().startswith(f"# Mine\n\nWords.\n\n{MARK}\n\nMade with ours 1")
    assert "old" not in board.read_text()


def test_a_detector_without_a_statistic_is_far_from_the_level():
    said = [Verdict(detected=alarm, statistic=value) for alarm, value in ((1, nan), (0, nan), (1, 0.5))]
    assert list(map(_statistic, said)) == [1e6, 0.0, 0.5]


def test_a_case_that_ends_its_process_has_no_results_and_says_why():
    found = lost(Case(3, SetFlight("faulty", scenario())), "killed")
    assert found == Trial("faulty", failures=["test: killed"])


def test_an_alarm_ends_the_time_in_which_one_would_be_false():
    one = Trace(2.0, (), False, 3600.0, rises=((10.0, 0.5), (900.0, 1.0), (1800.0, 2.0)))
    assert [one.fault_free_s(level) for level in (0.4, 0.5, 1.0, 2.0)] == [10.0, 900.0, 1800.0, 3600.0]
    assert [one.false_alarm(level) for level in (1.9, 2.0)] == [True, False]
    assert alarms_at([one, Trace(0.1, (), False, 7200.0)], 1.0) == (1, 2.5)


LIMITED = {"actuator": "elevator", "type": "rate_limit", "scale": 0.02, "at_s": 12.0, "end_s": 20.0}
BEFORE = {"p": 0.1, "q": 0.2, "r": 0.3}
BIASED = {"sensor": "p", "type": "bias", "bias_deg_s": 1, "abrupt": True, "at_s": 2}


FLOWN = {
    "initial": {"airspeed_mps": 45.0, "altitude_m": 1828.8}, "control": {"law": "nominal"},
    "fdi": {"scheme": "none"}, "faults": [LIMITED, BIASED],
}  # fmt: skip


def run_of(folder, faults=FLOWN["faults"], **changes):
    metrics = {
        "scenario": "first", "seed": 7, "false_alarm": False, "passed": True,
        "detection": {"delay_s": 0.25, "guaranteed_delay_s": None},
        "isolation": {"fault": "elevator", "delay_s": 0.5, "estimate": -0.412},
        "tracking": {"pre_fault_rms_deg_s": BEFORE, "post_fault_rms_deg_s": {"p": 1.0}},
        "envelope_exits": [{"start_s": 3.0, "end_s": 4.5}, {"start_s": 6.0, "end_s": 6.25}],
        "departure": None, "fault": {"at_s": 12.0},
    }  # fmt: skip
    return runs.Run(Path(folder), metrics | changes, FLOWN | {"faults": faults})


def test_runs_side_by_side(changed, tmp_path):
    lost = {"departure": {"signal": "alpha_rad", "time_s": 20.456}, "passed": False, "false_alarm": True}
    tracked = {"pre_fault_rms_deg_s": BEFORE, "post_fault_rms_deg_s": None}
    nothing = {"fault": None, "delay_s": None, "estimate": None}
    healthy = run_of(tmp_path / "b", [], fault=None, isolation=nothing, tracking=tracked, **lost)
    assert not changed(runs.as_text([run_of(tmp_path / "a"), healthy]).splitlines())
    assert runs.labels([run_of("x/a"), run_of("y/a")]) == ["x/a", "y/a"]


def test_runs_leave_a_figure_a_document_and_a_report(monkeypatch, tmp_path):
    reports, folders = [], [tmp_path / "a", tmp_path / "b"]
    monkeypatch.setattr(runs, "read_runs", lambda given: [run_of(folder) for folder in given])
    monkeypatch.setattr(runs, "figure_of", lambda given: panels(1, 1, 2.0, 2.0)[0])
    monkeypatch.setattr("beaver_ftc.results.report.write_report", lambda *given: reports.append(given))
    found = runs.write_runs(tmp_path / "out", folders)
    there = tmp_path / "out" / "runs"
    assert found == [run_of(folder) for folder in folders]
    read = [run.metrics | {"folder": str(run.folder), "flown": FLOWN} for run in found]
    assert json.loads((there / "runs.json").read_text()) == read
    assert (there / "runs.png").read_bytes()[1:4] == b"PNG"
    assert [(path.name, *rest) for path, *rest in reports] == [("runs.html", folders, ["a", "b"])]


def test_folders_that_are_no_runs_are_all_named(tmp_path):
    for name, metrics in (("a", "{"), ("b", None), ("c", "{}"), ("e", "[" * 100_000), ("f", "null")):
        (tmp_path / name).mkdir()
        for file, content in (("metrics.json", metrics), ("log.parquet", ""), ("scenario.yaml", "{}")):
            if content is not None:
                (tmp_path / name / file).write_text(content)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "metrics.json").write_text(
        json.dumps({key: {} for key in ("flight", "detection", "isolation", "tracking")})
    )
    (tmp_path / "g").mkdir()
    for file, content in (
        ("metrics.json", (tmp_path / "d" / "metrics.json").read_text()),
        ("log.parquet", ""),
    ):
        (tmp_path / "g" / file).write_text(content)
    (tmp_path / "g" / "scenario.yaml").write_text("[" * 100_000)
    with pytest.raises(BadInput) as said:
        runs.read_runs([tmp_path / name for name in "abcdefg"])
    allowed = "allowed: a result folder of beaver-ftc run"
    unreadable = f"metrics.json or scenario.yaml cannot be read, {allowed}"
    assert str(said.value).splitlines() == [
        f"{tmp_path / 'a'}: {unreadable}", f"{tmp_path / 'b'}: holds no metrics.json, {allowed}",
        f"{tmp_path / 'c'}: {unreadable}", f"{tmp_path / 'd'}: holds no log.parquet, {allowed}",
        *(f"{tmp_path / name}: {unreadable}" for name in "efg"),
    ]  # fmt: skip
