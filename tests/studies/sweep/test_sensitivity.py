import numpy as np
import pytest

from beaver_ftc.studies.sweep.key_words import in_words
from beaver_ftc.studies.sweep.ranking import rank


@pytest.fixture
def keys():
    generator = np.random.default_rng(2)
    return {
        "driver": generator.random(600),
        "idle": generator.random(600),
        "kind": np.array(generator.choice(["a", "b"], 600), dtype=object),
    }


def test_the_key_that_drives_comes_first_and_idle_ones_explain_nothing(keys):
    found = rank(keys, np.exp(5 * keys["driver"]))
    assert found[0]["key"] == "driver"
    assert found[0]["explained"] > 0.95
    assert found[0]["rank_correlation"] == pytest.approx(1.0)
    assert found[0]["p_value"] == pytest.approx(1 / 200)
    assert all(entry["explained"] < 0.03 and entry["p_value"] > 0.02 for entry in found[1:])


def test_of_twenty_idle_keys_none_passes_by_chance():
    generator = np.random.default_rng(3)
    idle = {f"key {i}": generator.random(100) for i in range(20)}
    smallest = [min(entry["p_value"] for entry in rank(idle, generator.random(100))) for _ in range(10)]
    assert sum(p <= 0.05 for p in smallest) <= 2  # 0.5 are expected; of p-values of each key by itself, 6


def test_an_effect_that_is_not_monotone_is_seen(keys):
    found = rank(keys, (keys["driver"] - 0.5) ** 2)
    assert found[0]["key"] == "driver"
    assert found[0]["explained"] > 0.8
    assert abs(found[0]["rank_correlation"]) < 0.15


def test_names_can_drive_and_missed_faults_rank_last(keys):
    outcome = np.where(keys["kind"] == "b", np.inf, keys["idle"])
    found = rank(keys, outcome)
    assert found[0]["key"] == "kind"
    assert found[0]["rank_correlation"] is None
    assert found[0]["explained"] > 0.6


def test_an_outcome_that_never_changes_has_no_drivers(keys):
    assert rank(keys, np.zeros(600)) == []


def test_a_key_in_a_figure_has_its_unit():
    keys = "faults[0].kappa_per_s", "faults[1].at_s", "fdi.bounds.constant_rad_s2.p", "sensors.alpha"
    assert [*map(in_words, keys)] == [
        "fault 1: kappa (1/s)", "fault 2: at (s)", "fdi: bounds: constant: p (rad/s2)", "sensors: alpha",
    ]  # fmt: skip
