"""Who asks for one JSON document gets one, also of what cannot be done."""

import json
import sys
from pathlib import Path

import pytest

import needs
from commands import beaver

BEAVER = str(Path(sys.executable).parent / "beaver-ftc")
IDENTIFY = ["identify", "nope.csv", "--vehicle", "nope", "--out", "model.json"]


@pytest.mark.parametrize(
    "asked",
    [
        ["compare", "nope"],
        pytest.param(["derive", "nope"], marks=needs.command("derive")),
        ["trim", "nope"],
        pytest.param(IDENTIFY, marks=needs.command("identify")),
        pytest.param(["diagnose", "nope.csv", "--model", "nope.json"], marks=needs.command("diagnose")),
        ["run", "nope"],
    ],
    ids=lambda asked: asked[0],
)
def test_a_refusal_is_one_document(tmp_path, asked):
    done = beaver(*asked, "--format", "json", cwd=tmp_path)
    assert done.returncode == 2
    assert json.loads(done.stdout)["errors"] == done.stderr.splitlines()
    assert list(tmp_path.iterdir()) == []
