"""Every built-in sweep: checked, one flight of it by name, and a short copy of it; some copies twice."""

import json
import re

import pyarrow.parquet
import pytest
import yaml

from samples import AT_NIGHT

from .installation import ROOT

SWEEPS = sorted(path.stem for path in (ROOT / "scenarios" / "sweeps").glob("*.yaml"))
FLIGHTS = 2
REPORTED = SWEEPS[:: 1 if AT_NIGHT else 7]
LONGEST_S = 15


def shortened(sweep):
    """The same sweep with two flights, or a grid of two points a key, that end 15 s after the last fault."""
    given = {"runs": FLIGHTS} if sweep.get("sampling") != "grid" else {"vary": _coarse(sweep["vary"])}
    changed = sweep.get("set", {})
    longest_s = LONGEST_S + max((float(at_s) for at_s in _fault_times(sweep)), default=0.0)
    return {
        **sweep,
        **given,
        "set": {**changed, "duration_s": min(longest_s, changed.get("duration_s", longest_s))},
    }


def _fault_times(sweep):
    """When faults strike in the base that is written in the file, or in what it sets."""
    base = sweep["base"] if isinstance(sweep["base"], dict) else {}
    for faults in (base.get("faults", ()), sweep.get("set", {}).get("faults", ())):
        yield from (fault["at_s"] for fault in faults)
    for key, how in sweep["vary"].items():
        if key.endswith(".at_s") and "uniform" in how:
            yield max(how["uniform"])


def _coarse(vary):
    return {
        key: {"linspace": [*how["linspace"][:2], 2]} if "linspace" in how else {"choice": how["choice"][:2]}
        for key, how in vary.items()
    }


def flights_of(sweep):
    """How many flights a shortened sweep has."""
    return 2 ** len(sweep["vary"]) if sweep.get("sampling") == "grid" else FLIGHTS


@pytest.mark.parametrize("name", SWEEPS)
def test_built_in_sweep(name, beaver, tmp_path):
    one = beaver("sweep", name, "--replay", "0", "--no-report", "--format", "json")
    assert one.returncode in (0, 1), one.stderr
    flight = json.loads(one.stdout)
    assert flight["passed"] is (one.returncode == 0)
    assert (tmp_path / flight["folder"] / "log.parquet").exists()

    short = shortened(yaml.safe_load((ROOT / "scenarios" / "sweeps" / f"{name}.yaml").read_text()))
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(short, sort_keys=False))
    text = beaver("sweep", "short.yaml", "--workers", "1", *["--no-report"] * (name not in REPORTED))
    assert "Traceback" not in text.stderr, text.stderr
    assert re.match(rf"{name}: (PASSED|FAILED|flown, nothing was expected)\n", text.stdout), text.stderr
    assert (text.returncode == 1) is ("MISSED" in text.stdout)
    assert text.returncode in (0, 1)

    summary = json.loads((tmp_path / "runs" / name / "summary.json").read_text())
    assert summary["passed"] is (text.returncode == 0)
    table = pyarrow.parquet.read_table(tmp_path / "runs" / name / "results.parquet")
    assert table.column_names[0] == "run"
    assert table["run"].to_pylist() == list(range(flights_of(short)))
    if name not in REPORTED:
        return
    assert (tmp_path / "runs" / name / "report.html").read_text().rstrip().endswith("</html>")
    again = beaver(
        "sweep", "short.yaml", "--workers", "1", "--no-report", "--format", "json", "--out", "again"
    )
    assert again.returncode == text.returncode
    assert json.loads(again.stdout)["passed"] is summary["passed"]
    assert pyarrow.parquet.read_table(tmp_path / "again" / name / "results.parquet").equals(table)
