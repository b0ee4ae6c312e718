"""The measured pages' tables, of made documents: what a cell says, and which rival is said to be better."""

from tools.docs.tables import benchmark

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


def test_cells_of_the_benchmark_hold_one_number_and_rivals_that_are_better_are_named():
    text = benchmark._tables({"sets": SETS})
    assert "| slow | never | 0.12 |" in text
    assert "| slow | 0 | 5.99 | 4 | 12.6 |" in text  # 0 and 2 in half an hour
    assert "| lqr (passive) | 1.25 | 1.30 |" in text
    assert "| fault-tolerant, no scheme (passive) | 1.75 | 1.76 |" in text
    assert "| oracle |" not in text
    assert "|  | published (4) | air-light (4) |" in text
    better = "These rivals have a better number than"
    assert f"{better} `adaptive-estimators`, significant or not: `slow` in `air-light`." in text
    assert (
        "These rivals have a better number than `fault-tolerant`, significant or not: `lqr` in `published`."
        in text
    )
    assert "No rival has a better number than `adaptive-estimators` here." in text
    assert "| 4 | 51 to 100 | 30 to 95 | 15 to 85 |" in text
