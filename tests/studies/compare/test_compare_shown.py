"""A comparison of made flights, all of it: document, tables, page, figure; and runs side by side."""

import json
from math import inf
from pathlib import Path

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare import runs
from beaver_ftc.studies.compare.leaderboard import (
    MARK,
    as_text,
    figure_of,
    makers_of,
    page_of,
    write_leaderboard,
)
from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.trial import LAW, SCHEME, Result, Trial, entries_of
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


KEYS = json.dumps({key: {} for key in ("flight", "detection", "isolation", "tracking")})
UNREADABLE = "metrics.json or scenario.yaml cannot be read"


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({}, "holds no metrics.json"),
        ({"metrics.json": KEYS}, "holds no log.parquet"),
        *(
            ({"metrics.json": text, "log.parquet": ""}, UNREADABLE)
            for text in ("{", "{}", "null", "[" * 100_000)
        ),
        ({"metrics.json": KEYS, "log.parquet": "", "scenario.yaml": "[" * 100_000}, UNREADABLE),
        ({"metrics.json": KEYS, "log.parquet": "", "scenario.yaml": "name: ["}, UNREADABLE),
    ],
)
def test_folders_that_are_no_runs_are_named_a_line_each(files, says, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        for file, text in ({"scenario.yaml": "{}"} | files).items():
            (tmp_path / name / file).write_text(text)
    with pytest.raises(BadInput) as said:
        runs.read_runs([tmp_path / "a", tmp_path / "b"])
    allowed = "allowed: a result folder of beaver-ftc run"
    assert str(said.value).splitlines() == [f"{tmp_path / name}: {says}, {allowed}" for name in ("a", "b")]
