"""`beaver-ftc mismatch` as its users meet it: documents, files, variants, the map, mistakes."""

import json

import numpy as np
import pytest

import commands
from beaver_ftc.results.log import StoredLog
from beaver_ftc.studies.engine.study import run_into
from beaver_ftc.studies.mismatch import over_envelope
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.variants import VARIANTS, variant_of
from flying import loss, scenario

SHORT = """
name: short
duration_s: 4
reference: {q: [{sine: {amplitude_deg_s: 3, frequency_hz: 0.5}}]}
faults: [{actuator: elevator, type: loss_of_effectiveness, magnitude: 0.4, at_s: 2}]
uncertainty: {coefficients: {Cm_alpha: 1.01, Cl_p: 0.98}}
"""


def beaver(folder, *arguments):
    return commands.beaver(*arguments, cwd=folder)


@pytest.fixture(scope="module")
def flown_folder(tmp_path_factory, figures_in_short):
    folder = tmp_path_factory.mktemp("mismatch")
    (folder / "short.yaml").write_text(SHORT)
    done = beaver(folder, "mismatch", "short.yaml", "--out", "out", "--format", "json")
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


def test_the_document_agrees_with_the_frames_file(flown_folder):
    folder, found = flown_folder
    frames = StoredLog(folder / "out" / "short" / "mismatch.parquet").read()
    for axis in "pqr":
        total = frames[f"{axis}_total_rad_s2"]
        parts = sum(frames[f"{axis}_{name}_rad_s2"] for name in (*SOURCES, "unexplained"))
        assert total == pytest.approx(parts, abs=1e-12)
        for name in (*SOURCES, "total"):
            values = frames[f"{axis}_{name}_rad_s2"]
            assert found["axes"][axis][name]["rms"] == pytest.approx(np.sqrt(np.mean(values**2)), rel=1e-9)
            assert found["axes"][axis][name]["max"] == pytest.approx(np.abs(values).max(), rel=1e-12)


def test_a_bound_of_nothing_is_no_trouble(tmp_path):
    """A design so good that nothing is admitted: shares of nothing are null, in words `no bound`."""
    nothing = "fdi: {bounds: {constant_rad_s2: {p: 0, q: 0, r: 0}, inertia_coupling: {p: 0, q: 0, r: 0}}}\n"
    (tmp_path / "short.yaml").write_text(SHORT + nothing)
    done = beaver(tmp_path, "mismatch", "short.yaml", "--out", "out", "--no-report")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "short" / "mismatch.json").read_text())
    assert found["bound"]["q"]["exceeded_times"] >= 1
    assert found["recommended"]["constant_rad_s2"]["q"] > 0.0


def test_variants_are_flown_side_by_side(tmp_path):
    (tmp_path / "short.yaml").write_text(SHORT)
    done = beaver(
        tmp_path,
        "mismatch",
        "short.yaml",
        "--out",
        "out",
        "--no-report",
        "--variant",
        "declared, engine-neglected ,mass=1.2",
    )
    assert done.returncode == 0, done.stderr
    assert "short-engine-neglected" in done.stdout
    comparison = json.loads((tmp_path / "out" / "mismatch-comparison" / "mismatch.json").read_text())
    assert [run["scenario"] for run in comparison["runs"]] == [
        "short",
        "short-engine-neglected",
        "short-mass-1-2",
    ]
    plain, neglected, _ = comparison["runs"]
    assert neglected["q_worst_ratio"] > 5 * plain["q_worst_ratio"]
    assert neglected["dominant"] == "engine"
    assert comparison["recommended"]["constant_rad_s2"]["q"] >= neglected["q_smallest_constant_rad_s2"]


@pytest.mark.parametrize(
    ("variant", "says"),
    [("nonsense", "no such variant"), ("mass=heavy", "is no value"), ("mas=1.1", "mas"),
     ("mass=1000", "mass"), ("mass=[1", "'[1' is no value"), ("mass=", "'' is no value"), ("=1", ""),
     ("declared, declared", "twice"),
     ("coefficients.Cm_alpa=0.9", "unknown aerodynamic term")],
)  # fmt: skip
def test_a_wrong_variant_is_bad_input_of_one_line(tmp_path, variant, says):
    (tmp_path / "short.yaml").write_text(SHORT)
    done = beaver(tmp_path, "mismatch", "short.yaml", "--variant", variant)
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""


@pytest.mark.parametrize("name", VARIANTS)
def test_every_named_variant_is_a_valid_scenario_that_differs_in_its_design_model_alone(name):
    base = scenario(faults=[loss()])
    found = variant_of(base, name)
    assert found.model_dump(exclude={"name", "design_model", "expect"}) == base.model_dump(
        exclude={"name", "design_model", "expect"}
    )
    assert (found.design_model == base.design_model) == (name == "declared")


def test_what_the_slipstream_does_matters_more_at_low_speed(monkeypatch, tmp_path):
    monkeypatch.setattr(over_envelope, "AIRSPEEDS_MPS", (40.0, 50.0))
    monkeypatch.setattr(over_envelope, "ALTITUDES_M", (500.0,))
    case = scenario(duration_s=2, design_model={"engine_terms": False})
    found = run_into(over_envelope.map_study(case), tmp_path)["map"]
    slow, fast = (entry for entry in found if entry["axis"] == "q")
    assert fast["dominant"] == "engine"
    assert slow["worst_ratio"] > fast["worst_ratio"] > 1.0
