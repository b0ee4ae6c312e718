"""The measured pages' tables, of made documents: what a cell says, and which rival is said to be better."""

from tools.docs.tables import benchmark

FOUND = {"detection_rate": 0.9, "isolation_rate": 0.5, "delay_median_s": 0.123}
ALARMS = {"false_alarms": 1, "healthy_h": 0.5}
TRACKED = {"ratio_median": 1.25, "ratio_90": None, "faults": 4}


def line(scheme, law, **other):
    return FOUND | ALARMS | TRACKED | {"scheme": scheme, "law": law} | other


def of_set(*lines):
    return {"flights": 4, "lines": list(lines)}


SETS = {
    "published": of_set(
        line("adaptive-estimators", "fault-tolerant"),
        line("slow", "fault-tolerant", delay_median_s=None, false_alarms=0),
        line("adaptive-estimators", "steady", ratio_90=9.0),
        line("adaptive-estimators", "oracle", ratio_median=0.1),
    ),
    "air-light": of_set(
        line("adaptive-estimators", "fault-tolerant", delay_median_s=None),
        line("slow", "fault-tolerant", false_alarms=2),
        line("adaptive-estimators", "steady", ratio_median=1.3),
        line("adaptive-estimators", "oracle"),
    ),
}


def test_a_rival_is_better_where_its_number_is_and_the_oracle_is_none():
    assert benchmark._better(SETS) == [
        "`slow` is sooner in the median in `air-light`.",
        "`slow` raises fewer false alarms in `published`.",
        "`steady` has the smaller 90 % tracking error in `published`.",
    ]


def test_cells_of_the_benchmark():
    text = benchmark._tables({"sets": SETS})
    assert "| slow | 90/50, never | 90/50, 0.12 | 0 | 4 |" in text  # 2 in half an hour
    assert "| steady | 1.25/9.00 | 1.30/lost |" in text
    assert "| oracle |" not in text
