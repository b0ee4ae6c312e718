"""`identify` and `diagnose` as a user gives them."""

import json

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from beaver_ftc.cli.main import app
from beaver_ftc.documents.errors import BadInput
from products.logs import synthetic


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
    done = run(
        "identify", root / "training.csv", "--vehicle", root / "wing.yaml", "--out", root / "wing.json",
        "--format", "json",
    )  # fmt: skip
    (root / "said.json").write_text(done.stdout)
    return root


def test_identify_says_how_good_it_is_as_json(folder):
    document = json.loads((folder / "said.json").read_text())
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


def diagnosed(folder, path, out, *options):
    """The rows of one flight through the command, as a table."""
    run("diagnose", path, "--model", folder / "wing.json", "--out", out, *options)
    return parquet.read_table(out / path.stem / "diagnosis.parquet")


@pytest.mark.parametrize("options", [(), ("--score",)])
def test_labels_are_read_for_the_score_alone(folder, tmp_path, options):
    """Shuffled labels: the rows are the same, to the bit; only a score differs."""
    rng = np.random.default_rng(3)
    columns = synthetic.fly(120.0, parts=((60, 100, 1.0, 0.5),), seed=9)
    for surface in ("right", "left"):
        rng.shuffle(columns[f"{surface}_effectiveness"])
    shuffled = synthetic.write_csv(tmp_path / "flight.csv", columns)
    one = diagnosed(folder, folder / "flight.csv", tmp_path / "one", *options)
    other = diagnosed(folder, shuffled, tmp_path / "other", *options)
    assert one.equals(other)
    verdicts = [
        json.loads((tmp_path / name / "flight" / "verdict.json").read_text()) for name in ("one", "other")
    ]
    assert (verdicts[0].pop("score", None) == verdicts[1].pop("score", None)) is (not options)
    assert verdicts[0] == verdicts[1]


def spoilt(folder, name, change):
    columns = synthetic.fly(120.0, seed=9)
    changed = change(columns)
    return synthetic.write_csv(folder / name, changed if isinstance(changed, dict) else columns)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c["p_rad_s"].fill(np.nan), "column p_rad_s holds no number"),
        (lambda c: c["p_rad_s"].fill(0.1), "rate p does not move"),
        (lambda c: c.pop("q_rad_s") is None, "no column q_rad_s"),
        (lambda c: c["t_s"].__setitem__(50, 0.0), "t_s: row 51: time does not increase"),
        (lambda c: c["p_rad_s"].__imul__(1e9), "column p_rad_s holds"),
        (lambda c: c["p_rad_s"].__imul__(1e3), "allowed: rates in rad/s, up to 60"),
        (lambda c: c["p_rad_s"].__setitem__(slice(30, None), np.nan), "samples known to be healthy"),
        (lambda c: {name: values[:20] for name, values in c.items()}, "has 20 samples of the rates"),
    ],
)
def test_a_spoilt_log_is_one_line_and_nothing_is_written(folder, tmp_path, change, says):
    path = spoilt(tmp_path, "spoilt.csv", change)
    with pytest.raises(BadInput) as error:
        run("identify", path, "--vehicle", folder / "wing.yaml", "--out", tmp_path / "model.json")
    assert says in str(error.value)
    assert len(str(error.value).splitlines()) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["spoilt.csv"]


def test_what_is_missing_is_named_the_vehicle_first():
    for given, missing in (
        ([], "--vehicle"),
        (["--out", "m.json"], "--vehicle"),
        (["--vehicle", "alfa"], "--out"),
    ):
        with pytest.raises(BadInput, match=f"^identify: {missing} is missing, allowed: --vehicle FILE --out"):
            run("identify", "flight.csv", *given)
