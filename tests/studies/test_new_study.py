"""A study that is unlike those there is added to a copy of the package: by its module, and a row.

It fits a curve over flights, and has a table, a page and a picture of its own. Nothing else of the copy is
touched: the command line, its help, resuming, and what may be replaced follow from the module.
"""

import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import beaver_ftc
from beaver_ftc.documents.files import data_root
from beaver_ftc.plant import conditions

ROW = '    "curve": "beaver_ftc.studies.curve:Curve",\n'
MODULE = '''"""How the angle of attack of level flight goes with airspeed: a curve through flights."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.metrics import as_json
from beaver_ftc.scenario.schema import load
from beaver_ftc.commands import Document, Reporter, StudyCommand, WorkersOption
from beaver_ftc.studies.engine.study import Study, run_into
from beaver_ftc.studies.present.figures import panels
from beaver_ftc.studies.present.page import Makers, Pictures, Table, as_html
from beaver_ftc.studies.present.tables import aligned, as_csv

NAME = "level-flight-curve"
HEAD = ("airspeed, m/s", "alpha, deg")


def fly_one(airspeed_mps: float) -> Document:
    """The row of a flight: where it is held."""
    with Path("flown.txt").open("a") as noted:
        noted.write(f"{airspeed_mps:g}\\n")
    if airspeed_mps > 46 and Path("storm").exists():
        raise SimulationFailed("a storm")
    kept = Columns("alpha_rad")
    asked = {"name": "level", "duration_s": 0.2, "rate_hz": 20, "initial": {"airspeed_mps": airspeed_mps}}
    fly(load(asked), kept)
    return {"airspeed_mps": airspeed_mps, "alpha_deg": float(np.rad2deg(kept["alpha_rad"][0]))}


def document_of(rows: list[Document], degree: int) -> Document:
    """Rows, and the polynomial through them, highest power first."""
    x, y = ([row[key] for row in rows] for key in ("airspeed_mps", "alpha_deg"))
    fitted = np.polyfit(x, y, degree)
    worst = float(np.abs(np.polyval(fitted, x) - y).max())
    return {"flights": rows, "fit": fitted.tolist(), "worst_deg": worst, "passed": worst < 0.5}


def cells(document: Document) -> list[tuple[str, ...]]:
    return [(f"{row['airspeed_mps']:g}", f"{row['alpha_deg']:.2f}") for row in document["flights"]]


def drawn(document: Document):
    figure, grid = panels(1, 1, 5.0, 3.0, "level flight")
    x = [row["airspeed_mps"] for row in document["flights"]]
    grid[0, 0].plot(x, [row["alpha_deg"] for row in document["flights"]], "o")
    grid[0, 0].plot(x, np.polyval(document["fit"], x))
    return figure


def page_of(document: Document):
    parts = ["Level flight.", Pictures([("the curve", "curve")]), Table(HEAD, cells(document))]
    return lambda folder: as_html("Level flight", parts, {"curve": folder / "curve.png"})


FILES: Makers = {
    "curve.json": as_json,
    "curve.csv": lambda document: as_csv(document["flights"]),
    "curve.png": drawn,
    "curve.html": page_of,
}


@dataclass(frozen=True)
class Curve(StudyCommand):
    """Fit a curve through level flights.

    Exit status 1 if it is off by half a degree.

    degree: Degree of the polynomial.
    airspeed: Airspeed, m/s; once for each.
    out: Folder for the results: `level-flight-curve` in it.
    """

    degree: Annotated[int, typer.Option(min=1, max=9)] = 2
    airspeed: list[float] | None = None
    workers: WorkersOption = None
    out: Path = Path("runs")

    FILES = FILES
    PLUGINS = False

    def run(self, reporter: Reporter) -> Document:
        """Fly each airspeed, and fit."""
        speeds_mps = self.airspeed or [38.0, 41.0, 44.0, 47.0, 50.0]
        study = Study(NAME, speeds_mps, fly_one, lambda rows: document_of(rows, self.degree), FILES)
        return run_into(study, self.out, self.workers or 1, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """A table and the fit."""
        fit = " ".join(f"{each:.4g}" for each in document["fit"])
        return aligned([HEAD, *cells(document)]) + f"\\n\\nfit: {fit}\\n\\nresults: {document['folder']}"
'''


EACH = """
import json, sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from beaver_ftc.cli.main import main
found = []
for asked in json.loads(sys.argv[1]):
    sys.argv, out, err, status = ["beaver-ftc", "curve", *asked], StringIO(), StringIO(), 0
    with redirect_stdout(out), redirect_stderr(err):
        try:
            main()
        except SystemExit as ended:
            status = ended.code or 0
    found.append((status, out.getvalue(), err.getvalue()))
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package with the study in it; the files of it that differ from ours."""
    root = tmp_path_factory.mktemp("copied")
    ours, package = Path(beaver_ftc.__path__[0]), root / "beaver_ftc"
    shutil.copytree(ours, package)
    (package / "studies" / "curve.py").write_text(MODULE)
    rows = package / "commands.py"
    rows.write_text(re.sub(r"^(COMMANDS = \{\n)", rf"\1{ROW}", rows.read_text(), flags=re.MULTILINE))
    touched = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*")
        if path.is_file() and not _same(path, ours / path.relative_to(package))
    ]
    for folder in ("aircraft", "scenarios"):
        shutil.copytree(data_root() / folder, package / "data" / folder, dirs_exist_ok=True)
    return root, sorted(touched)


def _same(path, ours):
    return ours.is_file() and filecmp.cmp(path, ours, shallow=False)


@pytest.fixture
def curve(copied, tmp_path):
    """Runs commands of the copy in one process: of each (status, standard output, standard error)."""

    def run(*commands):
        done = subprocess.run(
            [sys.executable, "-c", EACH, json.dumps(commands)],
            cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120,
            env={**os.environ, "PYTHONPATH": str(copied[0]), "NUMBA_DISABLE_JIT": "1"},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


def test_two_files_are_touched(copied):
    assert copied[1] == ["commands.py", "studies/curve.py"]


def see_its_help(text):
    assert "Exit status 1 if it is off by half a degree." in text
    assert re.search(r"--degree <int range> +Degree of the polynomial. +\[default: 2; 1<=x<=9\]", text)
    assert "--format <text|json>" in text
    assert "--plugin" not in text


def test_it_has_help_and_is_flown_told_and_written(curve, tmp_path):
    out = ["--out", "there"]
    first, helped, second = curve(out, ["--help"], [*out, "--format", "json", "--degree", "1"])
    assert helped[0] == 0
    see_its_help(helped[1])
    status, text, _ = first
    folder = tmp_path / "there" / "level-flight-curve"
    assert (status, text.splitlines()[0]) == (0, "airspeed, m/s  alpha, deg")
    assert text.endswith(f"results: there/{folder.name}\n")
    assert sorted(path.name for path in folder.iterdir()) == [
        "curve.csv", "curve.html", "curve.json", "curve.png",
    ]  # fmt: skip
    assert "data:image/png;base64" in (folder / "curve.html").read_text()
    status, text, _ = second  # in place of the first
    found = json.loads(text)
    assert status == int(found["worst_deg"] >= 0.5)
    assert json.loads((folder / "curve.json").read_text())["fit"] == found["fit"]
    speeds_mps = [row["airspeed_mps"] for row in found["flights"]]
    trimmed = [np.rad2deg(conditions.trim(airspeed_mps=V).alpha_rad) for V in speeds_mps]
    A = np.vander(speeds_mps, 2)
    assert found["fit"] == pytest.approx(np.linalg.solve(A.T @ A, A.T @ trimmed), rel=1e-2)
