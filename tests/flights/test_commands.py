"""`identify` and `diagnose` as a user gives them."""

import json

import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.errors import BadInput
from flights import synthetic


def run(*arguments):
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("commands")
    (root / "wing.yaml").write_text(synthetic.VEHICLE)
    flown = synthetic.fly(400.0, parts=((150, 220, 1.0, 0.5), (300, 340, 0.4, 1.0)), seed=5)
    synthetic.write_csv(root / "training.csv", flown)
    synthetic.write_csv(root / "flight.csv", synthetic.fly(120.0, parts=((60, 100, 1.0, 0.5),), seed=9))
    run("identify", root / "training.csv", "--vehicle", root / "wing.yaml", "--out", root / "wing.json")
    return root


def test_identify_says_how_good_it_is_as_json(folder):
    done = run(
        "identify", folder / "training.csv", "--vehicle", folder / "wing.yaml", "--out", folder / "b.json",
        "--format", "json",
    )  # fmt: skip
    document = json.loads(done.stdout)
    assert {"tests", "collinear", "colour", "spectrum", "output_error"} <= document["identified"].keys()
    tests = document["identified"]["tests"]
    assert [test["left_out"] for test in tests] == ["second half", "first half"]
    assert all(0.2 < test["explained"]["p"] < 1.0 for test in tests)


def test_diagnose_writes_the_contract(folder, tmp_path):
    done = run(
        "diagnose", folder / "flight.csv", "--model", folder / "wing.json", "--out", tmp_path,
        "--format", "json", "--score",
    )  # fmt: skip
    (verdict,) = json.loads(done.stdout)["flights"]
    assert verdict["score"]["classes"] > 0.85
    assert verdict["can_separate"]
    written = tmp_path / "flight"
    assert {path.name for path in written.iterdir()} == {"diagnosis.parquet", "verdict.json", "report.html"}
    table = parquet.read_table(written / "diagnosis.parquet")
    expected = ["t_s", "faulty", "named"]
    for surface in ("right", "left"):
        expected += [f"{surface}_effectiveness", f"{surface}_low", f"{surface}_high"]
    assert table.column_names[: len(expected)] == expected
    assert table.num_rows == 1200
    assert set(table["named"].to_pylist()) <= {"", "left", "right", "right+left", "unknown"}
    page = (written / "report.html").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert "can and cannot separate" in page


def test_without_score_nothing_is_compared(folder, tmp_path):
    done = run(
        "diagnose", folder / "flight.csv", "--model", folder / "wing.json", "--out", tmp_path,
        "--format", "json",
    )  # fmt: skip
    assert "score" not in json.loads(done.stdout)["flights"][0]


def test_a_model_with_a_mistake_is_one_line(folder, tmp_path):
    text = (folder / "wing.json").read_text()
    (tmp_path / "bad.json").write_text(text.replace('"rate_hz"', '"rate"', 1))
    with pytest.raises(BadInput) as error:
        run("diagnose", folder / "flight.csv", "--model", tmp_path / "bad.json", "--out", tmp_path)
    assert "bad.json:" in str(error.value)
    assert "rate: unknown key" in str(error.value)
    assert not list(tmp_path.glob("flight*"))
