"""Every built-in scenario, by name, in an empty folder: text and JSON; some with a report."""

import json
import re

import pytest

from samples import AT_NIGHT

from .installation import ROOT

SCENARIOS = sorted(path.stem for path in (ROOT / "scenarios").glob("*.yaml"))
BATCHES = [SCENARIOS[start::8] for start in range(8)]  # a process each: small enough to share among workers
REPORTED = SCENARIOS[:: 1 if AT_NIGHT else 8]  # figures take fifty times as long as the flight
CONTRACT = {"log.parquet", "metrics.json", "scenario.yaml"}
PNG = b"\x89PNG\r\n\x1a\n"
# How a value looks that nobody has put in words.
UNSAID = re.compile(r"\b(None|True|False|nan|inf)\b|[\[{]['\"]|<[\w.]+ object|\w+_deg_s\b: ")


def _verdicts(text):
    """{scenario: its part of the text}, by the headlines `name: PASSED`."""
    parts = re.split(
        r"^([\w-]+): (PASSED|FAILED|flown[^,\n]*)(?:, the aircraft was LOST)?$", text, flags=re.MULTILINE
    )
    assert parts[0] == ""
    return {name: (verdict, said) for name, verdict, said in zip(*[iter(parts[1:])] * 3, strict=True)}


def _warnings(stderr):
    """Its lines, but those of the first flight that uses a part of the code, and how far a slow one is."""
    passing = re.compile(r"beaver-ftc: (compiling|making ready) |[\w-]+: \d+%$")
    return [line for line in stderr.splitlines() if not passing.match(line)]


def _only_warnings(stderr, names):
    return all(re.match(rf"({'|'.join(names)}): warning: \S", line) for line in _warnings(stderr))


@pytest.mark.parametrize("name", REPORTED)
def test_a_report_is_whole_and_has_its_figures_and_expectations(name, beaver, tmp_path):
    assert beaver("run", name).returncode == 0
    folder = tmp_path / "runs" / name
    assert {path.name for path in folder.iterdir()} == CONTRACT | {"figures", "report.html"}
    figures = list((folder / "figures").iterdir())
    assert len(figures) > 3
    assert all(figure.suffix == ".png" and figure.read_bytes().startswith(PNG) for figure in figures)
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert report.rstrip().endswith("</html>")
    assert not re.search(r"(src|href)=[\"']?(https?:)?//", report)
    metrics = json.loads((folder / "metrics.json").read_text())
    assert [
        expectation["name"] for expectation in metrics["expectations"] if expectation["name"] not in report
    ] == []


@pytest.mark.parametrize("names", BATCHES, ids=lambda names: names[0])
def test_built_in_scenarios_in_text_and_in_json(names, beaver, tmp_path):
    text = beaver("run", *names, "--no-report")
    assert _only_warnings(text.stderr, names), text.stderr
    assert text.returncode == 0, text.stdout
    verdicts = _verdicts(text.stdout)
    assert list(verdicts) == names
    for name, (verdict, said) in verdicts.items():
        assert verdict == "PASSED"
        assert said.splitlines()[-1].split() == ["results", f"runs/{name}"]
        assert not UNSAID.search(said), said
        log = tmp_path / "runs" / name / "log.parquet"
        assert log.read_bytes()[-4:] == b"PAR1"

    flown = beaver("run", *names, "--format", "json", "--no-report", "--out", "again")
    assert flown.returncode == 0
    assert _warnings(flown.stderr) == _warnings(text.stderr)
    document = json.loads(flown.stdout)
    assert document["passed"] is True
    assert [run["scenario"] for run in document["runs"]] == names
    for run in document["runs"]:
        folder = tmp_path / run.pop("folder")
        assert {path.name for path in folder.iterdir()} == CONTRACT
        assert json.loads((folder / "metrics.json").read_text()) == run
        for name in ("metrics.json", "log.parquet", "scenario.yaml"):
            first = tmp_path / "runs" / run["scenario"] / name
            assert (folder / name).read_bytes() == first.read_bytes()
