"""A flight in Python: what a run would have written, as tables, records and figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import beaver_ftc as bf
from beaver_ftc.results.writer import run
from flying import loss, scenario

pytestmark = pytest.mark.usefixtures("figures_in_short")
SHORT = {"duration_s": 3.0, "faults": [loss(at_s=1.5)], "expect": {"isolated_as": "rudder"}}


@pytest.fixture(scope="module")
def flight():
    return bf.fly(scenario(**SHORT))


@pytest.fixture(scope="module")
def folder(tmp_path_factory, figures_in_short):
    out = tmp_path_factory.mktemp("runs")
    run(scenario(**SHORT), out)
    return out / "test"


class TestFlown:
    def test_without_a_log_there_is_the_verdict_alone(self, flight, tmp_path):
        bare = bf.fly(scenario(**SHORT), log=False)
        assert bare.metrics == flight.metrics
        for asked in (lambda: bare.log, lambda: bare.plot("tracking"), lambda: bare.save(tmp_path)):
            with pytest.raises(bf.BadInput, match="kept no log, allowed: fly it with log=True"):
                asked()

    def test_saved_is_what_a_run_writes(self, flight, folder, tmp_path):
        saved = flight.save(tmp_path)
        assert files(saved) == files(folder)
        for name in files(folder):
            assert (saved / name).read_bytes() == (folder / name).read_bytes(), name

    def test_an_interrupted_flight_gets_its_report_at_once_without_figures(self, flight, folder, tmp_path):
        stopped = replace(flight, metrics=flight.metrics | {"interrupted_s": 2.5})
        saved = stopped.save(tmp_path)
        assert files(saved) == [name for name in files(folder) if not str(name).startswith("figures")]
        assert "INTERRUPTED" in (saved / "report.html").read_text(encoding="utf-8")

    def test_opened_is_what_was_saved(self, flight, folder, tmp_path):
        opened = bf.open_run(folder)
        assert opened.metrics == flight.metrics
        assert opened.scenario == flight.scenario
        assert repr(opened) == repr(flight)
        pd.testing.assert_frame_equal(opened.log, flight.log, check_exact=True)
        assert opened.log.attrs == flight.log.attrs
        assert files(opened.save(tmp_path)) == files(folder)


class TestViews:
    def test_a_plot_shows_the_log(self, flight):
        axes = flight.plot("tracking").axes[1]
        curve = next(line for line in axes.lines if line.get_label() == "aircraft")
        np.testing.assert_allclose(curve.get_ydata(), np.rad2deg(flight.log["q_rad_s"]))

    def test_another_view_is_refused(self, flight):
        with pytest.raises(bf.BadInput, match="view: 'trackin' is not known, did you mean tracking"):
            flight.plot("trackin")


class TestPlugIns:
    class Sleepy:
        """Never sees anything."""

        def reset(self, context):
            pass

        def step(self, measured, command):
            return bf.Verdict()

    def test_an_object_diagnoses(self, flight):
        assert flight.detection.detected
        assert not bf.fly(scenario(**SHORT), detector=self.Sleepy()).detection.detected

    @pytest.mark.parametrize("of", ["detector", "law"])
    @pytest.mark.parametrize("given", [Sleepy, object(), "sleepy"])
    @pytest.mark.parametrize("flies", [bf.fly, bf.Simulation])
    def test_anything_else_is_refused(self, flies, given, of):
        with pytest.raises(bf.BadInput, match=rf"^{of}: .* allowed: an object with reset and step"):
            flies(scenario(**SHORT), **{of: given})


def files(folder: Path):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


DAMAGED = (
    "",
    "{",
    "null",
    "[]",
    "3",
    "{}",
    "[" * 100_000,
    '{"flight": 3}',
    '{"flight": {}, "detection": null}',
)


@pytest.mark.parametrize("text", DAMAGED)
def test_a_folder_whose_metrics_are_damaged_is_no_result(tmp_path, text):
    (tmp_path / "metrics.json").write_text(text)
    (tmp_path / "scenario.yaml").write_text("name: x")
    with pytest.raises(
        bf.BadInput, match=r"no metrics\.json can be read there, allowed: the result folder of a run"
    ):
        bf.open_run(tmp_path)
