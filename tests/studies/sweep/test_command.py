"""`beaver-ftc sweep` as its users call it."""

import json

import pytest

from commands import beaver

from .conftest import SHORT

EXPECTING = SHORT + "expect: {detection_rate: {at_least: 0.999, confidence: 0.99}}\n"


@pytest.fixture
def call(tmp_path):
    def run(text, *arguments):
        (tmp_path / "short.yaml").write_text(text)
        done = beaver("sweep", "short.yaml", *arguments, cwd=tmp_path)
        return done.returncode, done.stdout, done.stderr

    return run


def test_json_is_one_document_and_a_missed_expectation_exits_with_1(call):
    status, answer, complaints = call(EXPECTING, "--format", "json", "--no-report", "--workers", "1")
    document = json.loads(answer)
    assert status == 1
    assert document["passed"] is False
    assert document["folder"] == "runs/short"
    assert document["flights"] == 48
    assert "Traceback" not in complaints


def test_text_says_the_verdict_and_a_replay_is_a_run(call, tmp_path):
    status, answer, _ = call(SHORT, "--no-report", "--workers", "1")
    assert status == 0
    assert answer.startswith("short: flown, nothing was expected")
    assert "beaver-ftc sweep short.yaml --replay" in answer
    status, answer, complaints = call(SHORT, "--replay", "3", "--no-report")
    assert status == 0, complaints
    assert "short-0003" in answer
    assert (tmp_path / "runs" / "short" / "flights" / "short-0003" / "metrics.json").exists()


@pytest.mark.parametrize(
    ("text", "arguments", "says"),
    [
        (SHORT.replace("runs: 48", "runs: -1"), (), "short.yaml:4: runs: -1 is out of range"),
        (SHORT, ("--keep-logs", "some"), "--keep-logs: 'some' is not known"),
        (SHORT, ("--keep-logs", "1,48"), "--keep-logs: there is no flight 48, allowed: 0 to 47"),
        (SHORT, ("--replay", "48"), "there is no flight 48, allowed: 0 to 47"),
        (SHORT, ("--backend", "slurm"), "slurm"),
        (SHORT, ("--ray-address", "auto"), "--ray-address: allowed: only with --backend ray"),
    ],
)
def test_a_mistake_is_one_line_and_exits_with_2(call, text, arguments, says):
    status, answer, complaints = call(text, *arguments)
    assert status == 2
    assert says in complaints
    assert answer == ""
    assert "Traceback" not in complaints
