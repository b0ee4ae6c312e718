"""Which YAML files pytest collects as what, without a pytest of their own."""

import pytest

from beaver_ftc import pytest_plugin as plugin
from beaver_ftc.pytest_plugin import ScenarioFile, SweepFile

SCENARIO, SWEEP = "name: one\nduration_s: 1\n", "name: many\nbase: fault-free\nruns: 3\n"


def file(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


KINDS = {  # name, text: as it is found, named, found with --beaver, named with --beaver
    "marked": ("a.scenario.yaml", "", [ScenarioFile] * 4),
    "marked in short": ("a.scenario.yml", "", [ScenarioFile] * 4),
    "scenario": ("a.yaml", SCENARIO, [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "sweep": ("a.yaml", SWEEP, [None, SweepFile, None, SweepFile]),
    "sweep by what varies": ("a.yaml", "name: a\nvary: {}\n", [None, SweepFile, None, SweepFile]),
    "base alone": ("a.yaml", "name: a\nbase: fault-free\n", [None] * 4),
    "another tool's": ("a.yaml", "services: {}\n", [None] * 4),
    "name alone": ("a.yaml", "name: a\n", [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "name and no key of ours": ("a.yaml", "name: a\nzebra: 1\n", [None] * 4),
    "description alone": ("a.yaml", "description: a\n", [None] * 4),
    "nearly a key": ("a.yaml", "FAUTLS: []\n", [None, ScenarioFile, ScenarioFile, ScenarioFile]),
    "empty": ("a.yaml", "", [None] * 4),
    "a list": ("a.yaml", "- a\n", [None] * 4),
    "cannot be read": ("a.yaml", "name: [a\n", [None, None, ScenarioFile, ScenarioFile]),
}


@pytest.mark.parametrize("name", KINDS)
def test_what_a_file_is_collected_as(tmp_path, name):
    called, text, kinds = KINDS[name]
    path = file(tmp_path, called, text)
    ways = [(named, all_of_them) for all_of_them in (False, True) for named in (False, True)]
    assert [plugin._kind(path, *way) for way in ways] == kinds


@pytest.mark.parametrize(("beside", "result"), [
    (("scenario.yaml", "metrics.json"), True), (("scenario.yaml", "log.parquet"), True),
    (("sweep.json", "results.parquet"), True), (("scenario.yaml", "results.parquet"), False),
    (("metrics.json",), False), ((), False),
])  # fmt: skip
def test_what_a_run_has_written_is_collected_where_it_is_named(tmp_path, beside, result):
    for one in beside:
        file(tmp_path, one, "")
    path = file(tmp_path, "below/a.yaml", SCENARIO)
    assert plugin._is_a_result(tmp_path) is result
    assert plugin._kind(path, False, True) is (None if result else ScenarioFile)
    assert plugin._kind(path, True, True) is ScenarioFile
