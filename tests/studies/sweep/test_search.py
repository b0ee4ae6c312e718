import numpy as np
import pytest
from pyarrow.parquet import read_table

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.sweep.campaign import Options, assignment_of, named_for, run_sweep
from beaver_ftc.studies.sweep.search import Evolution, score

from .conftest import SHORT, sweep_of


def evolve(function, keys, generations, seed=1):
    evolution = Evolution(seed, keys)
    for _ in range(generations):
        trials = evolution.trials()
        evolution.select(trials, np.array([function(point) for point in trials]))
    return evolution


def test_it_finds_the_top_of_a_hill_in_four_dimensions():
    """The other road: the hill's top is where it was put."""
    top = np.array([0.2, 0.9, 0.5, 0.71])
    evolution = evolve(lambda x: -np.sum((x - top) ** 2), 4, 60)
    best = evolution._points[evolution._scores.argmax()]
    np.testing.assert_allclose(best, top, atol=2e-3)


BASE = {"frames": 1, "status": "flown", "flown_s": 20.0, "fault.at_s": 5.0, "false_alarm": False}


@pytest.mark.parametrize(
    ("objective", "row", "expected"),
    [
        ("delay", {"detection.delay_s": 0.3}, 0.3),
        ("delay", {"detection.delay_s": None}, 15.0),
        ("delay", {"detection.delay_s": None, "fault.at_s": None}, -np.inf),
        ("delay", {"detection.delay_s": None, "false_alarm": True}, -np.inf),
        ("delay", {"frames": None}, -np.inf),
        ("false_alarm", {"worst_residual_ratio": 0.8}, 0.8),
        ("tracking", {f"tracking.post_fault_rms_deg_s.{axis}": "pqr".index(axis) for axis in "pqr"}, 2.0),
        ("tracking", {"status": "departed"}, 1e6 - 20.0),
    ],
)  # fmt: skip
def test_a_flights_score(objective, row, expected):
    assert score(objective, BASE | row) == expected


SEARCH = SHORT.replace("runs: 48", "runs: 56")


def test_a_search_that_is_stopped_goes_on_to_the_same_end(tmp_path, small_batches):
    sweep = sweep_of(SEARCH)
    whole = run_sweep(sweep, Options(out=tmp_path / "whole", workers=2, search="delay", report=False))
    seen = []
    stopping = Options(out=tmp_path / "halves", workers=1, search="delay", report=False)
    with pytest.raises(Exception, match="stopped, 16 of 56"):
        run_sweep(sweep, stopping, lambda tally: seen.append(tally["done"]), stopped=lambda: bool(seen))
    resumed = run_sweep(
        sweep, Options(out=tmp_path / "halves", workers=2, search="delay", resume=True, report=False)
    )
    files = [tmp_path / name / "short-search-delay" / "results.parquet" for name in ("whole", "halves")]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert resumed["search"] == whole["search"]
    assert whole["search"]["history"] == sorted(whole["search"]["history"])
    worst = assignment_of(named_for(sweep, "delay"), stopping, whole["search"]["run"])
    assert worst.values == whole["search"]["values"]


def test_nothing_to_vary_is_nothing_to_search(tmp_path):
    sweep = sweep_of("base: fault-free\nruns: 4")
    with pytest.raises(BadInput, match="nothing varies"):
        run_sweep(sweep, Options(out=tmp_path, search="delay"))


@pytest.mark.parametrize("flights", [5, 20])
def test_a_search_that_ends_within_a_generation_says_its_worst_flight(tmp_path, flights):
    """Fewer flights than a generation has members, or a few more: the last ones count as all others do."""
    sweep = sweep_of(SHORT.replace("runs: 48", f"runs: {flights}"))
    done = run_sweep(sweep, Options(out=tmp_path, workers=1, search="delay", report=False))["search"]
    rows = read_table(tmp_path / "short-search-delay" / "results.parquet").to_pylist()
    scores = [score("delay", row) for row in rows]
    assert len(scores) == flights
    assert done["score"] == pytest.approx(max(scores))
    assert done["run"] == int(np.argmax(scores))
    assert done["history"] == pytest.approx([max(scores[:16]), max(scores)][-(1 + (flights > 16)) :])
