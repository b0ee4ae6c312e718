"""What is tested here is the wheel: nothing of the checkout is imported, and what it needs is in it."""

import json

from .installation import ROOT

IMPORTED = """
import json, sys
import beaver_ftc.cli.main, beaver_ftc.results.writer, beaver_ftc.loop.loop
files = [module.__file__ for name, module in sys.modules.items() if name.partition(".")[0] == "beaver_ftc"]
print(json.dumps({"files": [file for file in files if file], "path": sys.path}))
"""


def test_every_module_comes_from_the_wheel(started, tmp_path):
    done = started.run(started.python, "-c", IMPORTED, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert len(found["files"]) > 20
    assert [file for file in found["files"] if not file.startswith(str(started.folder))] == []
    assert str(ROOT / "src") not in found["path"]
    assert not started.folder.is_relative_to(ROOT)


def test_the_wheel_carries_the_aircraft_and_the_scenarios_as_they_are_here(started):
    (data,) = started.folder.glob("lib/python*/site-packages/beaver_ftc/data")
    for kind in ("aircraft", "scenarios", "evidence"):
        ours = {
            path.relative_to(ROOT): path.read_bytes() for path in (ROOT / kind).rglob("*") if path.is_file()
        }
        theirs = {
            path.relative_to(data): path.read_bytes() for path in (data / kind).rglob("*") if path.is_file()
        }
        assert ours == theirs


def test_list_names_every_built_in_scenario_and_sweep(started, tmp_path):
    done = started.beaver("list", "--format", "json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    listed = json.loads(done.stdout)
    for kind, folder in (
        ("scenarios", "scenarios"), ("sweeps", "scenarios/sweeps"), ("plans", "evidence")
    ):  # fmt: skip
        files = {path.stem for path in (ROOT / folder).glob("*.yaml")}
        assert {entry["name"] for entry in listed[kind]} == files
