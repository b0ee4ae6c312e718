"""The measured pages' tables, of made documents: what a cell says, and which rival's number is marked."""

from tools.docs.pages import ROOT
from tools.docs.tables import benchmark, robustness

from beaver_ftc.diagnosis.rivals import load_tuned_values, tuned_values
from beaver_ftc.plugins import DETECTORS
from beaver_ftc.studies.compare.trial import LAW, SCHEME, STATISTICAL, Entry

FOUND = {"detection_rate": 0.9, "isolation_rate": 0.5, "delay_median_s": 0.123, "delay_median_high_s": None}
ALARMS = {"false_alarms": 1, "healthy_h": 0.5}
TRACKED = {
    "ratio_median": 1.25,
    "ratio_90": None,
    "ratio_median_low": 1.1,
    "ratio_median_high": 1.5,
    "faults": 4,
}


def line(scheme, law, **other):
    return FOUND | ALARMS | TRACKED | {"scheme": scheme, "law": law} | other


def of_set(*lines):
    return {"flights": 4, "lines": list(lines)}


SETS = {
    "published": of_set(
        line("adaptive-estimators", "fault-tolerant"),
        line("slow", "fault-tolerant", delay_median_s=None, false_alarms=0),
        line("none", "fault-tolerant", ratio_median=1.75),
        line("adaptive-estimators", "lqr", ratio_90=9.0),
        line("adaptive-estimators", "oracle", ratio_median=0.1),
    ),
    "air-light": of_set(
        line("adaptive-estimators", "fault-tolerant", delay_median_s=None),
        line("slow", "fault-tolerant", false_alarms=2),
        line("none", "fault-tolerant", ratio_median=1.76),
        line("adaptive-estimators", "lqr", ratio_median=1.3),
        line("adaptive-estimators", "oracle"),
    ),
}


def test_cells_of_the_benchmark_hold_one_number_and_better_ones_of_rivals_are_bold(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = benchmark._tables({"sets": SETS})
    assert "| slow | never | **0.12** |" in text
    assert "| slow | 0 | 5.99 | 4 | 12.6 |" in text  # 0 and 2 in half an hour
    assert "| lqr (passive) | 1.25 | 1.30 |" in text
    assert "| lqr (passive) | **9.00** | lost |" in text
    assert "| fault-tolerant, no scheme (passive) | 1.75 | 1.76 |" in text
    assert "| oracle |" not in text
    assert "|  | published (4) | air-light (4) |" in text
    intervals = (tmp_path / "images/tables/benchmark-shares.csv").read_text()
    assert intervals.splitlines()[1] == "4,51 to 100,51 to 100,30 to 95,15 to 85,15 to 85"


def test_the_tables_have_the_statistical_detector_and_every_passive_law():
    entries = benchmark.everybody()
    passive = {name for name in benchmark.PASSIVE_LAWS if name != benchmark.ALONE}
    assert passive == {"nominal", "lqr", "indi"}
    assert {Entry(STATISTICAL, LAW), Entry("none", LAW), *(Entry(SCHEME, law) for law in passive)} <= {
        *entries
    }


def test_the_page_names_the_rate_of_false_alarms_that_the_search_chose():
    chosen = tuned_values(load_tuned_values(), "errors", DETECTORS, STATISTICAL)
    page = (ROOT / "docs/results/benchmark.md").read_text(encoding="utf-8")
    named = f"{chosen['fdi.statistical.false_alarms_per_h']:.0f} false alarms per hour"
    assert page.count(named) == 2  # in the answer, and where false alarms are explained


def test_the_probe_of_the_power_has_the_alarm_level_of_every_scheme(monkeypatch):
    """It moves with the parameters of most schemes; shares of few flights do not."""
    levels = [{"turbulence": "light", "scheme": name, "level": 0.12345678} for name in ("slow", "quick")]
    monkeypatch.setattr(robustness, "run_power", lambda *_: {"levels": levels})
    monkeypatch.setattr(robustness, "_power_of", lambda document: "tables")
    lines = robustness.robustness_power_probe().splitlines()
    assert lines == ["tables", "light, slow: 0.123457", "light, quick: 0.123457"]
