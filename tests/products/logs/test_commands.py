"""`identify` and `diagnose` as a user gives them."""

import json

import numpy as np
import pytest
from pyarrow import parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.model import model_file_text
from products.logs import synthetic
from products.logs.small import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory, wing_model):
    root = tmp_path_factory.mktemp("commands")
    (root / "wing.yaml").write_text(synthetic.VEHICLE)
    synthetic.write_csv(root / "flight.csv", synthetic.fly(120.0, parts=((60, 100, 1.0, 0.5),), seed=9))
    (root / "wing.json").write_text(model_file_text(wing_model))
    return root


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
    each = [f"{surface}_{of}" for surface in ("right", "left") for of in ("effectiveness", "low", "high")]
    assert table.column_names[:9] == ["t_s", "faulty", "named", *each]
    assert table.num_rows == 1200
    assert set(table["named"].to_pylist()) <= {"", "left", "right", "right+left", "unknown"}
    assert "http" not in (written / "report.html").read_text().replace("http-equiv", "")


def test_a_model_with_a_mistake_is_one_line(folder, tmp_path):
    text = (folder / "wing.json").read_text()
    (tmp_path / "bad.json").write_text(text.replace('"rate_hz"', '"rate"', 1))
    with pytest.raises(BadInput) as error:
        run("diagnose", folder / "flight.csv", "--model", tmp_path / "bad.json", "--out", tmp_path)
    assert "bad.json:" in str(error.value)
    assert "rate: unknown key" in str(error.value)
    assert not list(tmp_path.glob("flight*"))


@pytest.mark.parametrize("options", [(), ("--score",)])
def test_labels_are_read_for_the_score_alone(folder, tmp_path, options):
    """Shuffled labels: the rows are the same, to the bit; only a score differs."""
    rng = np.random.default_rng(3)
    columns = synthetic.fly(120.0, parts=((60, 100, 1.0, 0.5),), seed=9)
    for surface in ("right", "left"):
        rng.shuffle(columns[f"{surface}_effectiveness"])
    shuffled = synthetic.write_csv(tmp_path / "flight.csv", columns)
    tables, verdicts = [], []
    for path, out in ((folder / "flight.csv", tmp_path / "one"), (shuffled, tmp_path / "other")):
        run("diagnose", path, "--model", folder / "wing.json", "--out", out, *options)
        tables.append(parquet.read_table(out / "flight" / "diagnosis.parquet"))
        verdicts.append(json.loads((out / "flight" / "verdict.json").read_text()))
    assert tables[0].equals(tables[1])
    assert (verdicts[0].pop("score", None) == verdicts[1].pop("score", None)) is (not options)
    assert verdicts[0] == verdicts[1]


@pytest.mark.parametrize(("name", "change", "says"), [
    ("p_rad_s", lambda p: p * np.nan, "column p_rad_s holds no number"),
    ("p_rad_s", lambda p: 0.0 * p + 0.1, "rate p does not move"),
    ("p_rad_s", lambda p: np.where(np.arange(len(p)) < 30, p, np.nan), "samples known to be healthy"),
])  # fmt: skip
def test_a_spoilt_log_is_one_line_and_nothing_is_written(folder, tmp_path, name, change, says):
    columns = synthetic.fly(120.0, seed=9)
    columns[name] = change(columns[name])
    left = {name: values for name, values in columns.items() if values is not None}
    path = synthetic.write_csv(tmp_path / "spoilt.csv", left)
    with pytest.raises(BadInput) as error:
        run("identify", path, "--vehicle", folder / "wing.yaml", "--out", tmp_path / "model.json")
    assert says in str(error.value)
    assert len(str(error.value).splitlines()) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["spoilt.csv"]


@pytest.mark.parametrize("out", [".", "wing.html", "flight.csv", "wing.yaml"])
def test_a_model_file_in_the_place_of_another_is_refused(folder, monkeypatch, out):
    monkeypatch.chdir(folder)
    with pytest.raises(BadInput, match="allowed: a name such as"):
        run("identify", "flight.csv", "--vehicle", "wing.yaml", "--out", out)


def test_what_is_missing_is_named_the_vehicle_first():
    for given, missing in (
        ([], "--vehicle"),
        (["--out", "m.json"], "--vehicle"),
        (["--vehicle", "alfa"], "--out"),
    ):
        with pytest.raises(BadInput, match=f"^identify: {missing} is missing, allowed: --vehicle FILE --out"):
            run("identify", "flight.csv", *given)
