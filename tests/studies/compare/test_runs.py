"""Folders that hold no finished run."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.compare import runs

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


def test_a_fault_says_which_damage_it_is_and_when_it_ends():
    damage = {"type": "damage", "case": "tip-off", "at_s": 1.0, "end_s": 3.0}
    assert runs.fault_words(damage) == "tip-off damage at 1 s to 3 s"
