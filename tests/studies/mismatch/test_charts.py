"""The mismatch as pictures: all that each of them shows, of small documents made by hand."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.model import Metrics
from beaver_ftc.studies.mismatch import charts
from beaver_ftc.studies.mismatch.linear import analyse
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import COLUMNS, ETA_BAR, TOTAL, UNEXPLAINED, column
from flying import scenario

PEAKS = {
    "p": {"sinusoids": 0.02, "fault": 0.5, "inertia": 0.005, "engine": 2e-5, "sensors": 0.0199e-3},
    "q": {"engine": 0.04, "actuators": 0.01, "sinusoids": 0.02, "coefficients": 0.03, "sensors": 0.004},
    "r": {"earth_rotation": 1e-6, "wind_turbulence": 0.003, "simplification": 0.002, "integration": 1e-4},
}
BOUND = 0.025
FLOWN = Metrics.of({
    "fault": {"at_s": 1.0}, "detection": {"time_s": 1.2}, "isolation": {"time_s": 1.5},
    "departure": {"time_s": 2.5},
})  # fmt: skip


@pytest.fixture
def found():
    """p within its bound but for the fault, q beyond it, r over no bound with what it has most of."""

    def of(axis, name):
        peak = PEAKS[axis].get(name, 0.0)
        return {"max": peak, "bound_share": None if name == "wind_turbulence" and peak else peak / BOUND}

    axes = {axis: {name: of(axis, name) for name in (*SOURCES, UNEXPLAINED)} for axis in "pqr"}
    axes["q"]["inertia"]["bound_share"] = charts.LEAST_SHARE  # just not shown
    axes["r"][UNEXPLAINED]["bound_share"] = 2 * charts.LEAST_SHARE
    return {"scenario": "case", "axes": axes}


@pytest.fixture
def frames(tmp_path, found):
    """Each column another wave, as high as the document says."""
    t = np.arange(0.0, 3.0, 0.05)
    columns = {"t_s": t}
    for axis, of in found["axes"].items():
        for i, (name, figures) in enumerate(of.items()):
            columns[column(axis, name)] = figures["max"] * np.sin((i + 1) * t)
        columns[column(axis, TOTAL)] = sum(columns[column(axis, name)] for name in of)
        columns[column(axis, ETA_BAR)] = BOUND + 0.001 * t
    with ParquetLog(tmp_path / "mismatch.parquet") as log:
        log.open(COLUMNS)
        log.write(np.column_stack([columns[name] for name in COLUMNS]))
    return tmp_path / "mismatch.parquet"


@pytest.fixture(scope="module")
def analysis():
    return analyse(
        scenario(design_model={"engine_terms": False}, uncertainty={"coefficients": {"Cm_q": 1.1}})
    )


def test_every_picture_has_its_file(found, frames, analysis):
    made = charts.figures(frames.parent, found, FLOWN, analysis)
    assert {name: figure.get_suptitle().splitlines()[-1] for name, figure in made.items()} == {
        f"mismatch-{name}.png": "case" for name in ("sources", "bound", "linear", "zeros", "response")
    }
    assert all(isinstance(figure, Figure) for figure in made.values())
