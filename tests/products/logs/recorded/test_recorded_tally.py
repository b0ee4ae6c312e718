"""What the benchmark on recorded flights counts and prints, of scores that differ in everything."""

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.recorded import benchmark


def score(failure=None, detected=False, delay_s=None, false_alarms=0, healthy_s=900.0, right_group=None):
    return {
        "failure": failure, "detected": detected, "delay_s": delay_s, "false_alarms": false_alarms,
        "healthy_s": healthy_s, "right_group": right_group,
    }  # fmt: skip


SCORES = [
    score("left_aileron", True, 4.0, right_group=True),
    score("rudder+right_aileron", True, 5.0, right_group=False),
    score("right_aileron", True, 9.0),
    score("rudder", True, 2.0, false_alarms=1),
    score("rudder"),
    score("elevator"),
    score(ENGINE, True, 1.0),
    score(ENGINE),
    score(false_alarms=2),
    score(),
    score(),
]


def test_flights_are_found_missed_or_falsely_alarmed():
    found = benchmark.summarize_failures(SCORES)
    assert (found["surface_failures"], found["found"]) == (6, 4)
    assert found["precision"] == pytest.approx(4 / 6)  # two flights with a false alarm
    assert found["recall"] == pytest.approx(4 / 6)
    assert found["accuracy"] == pytest.approx((4 + 2) / (6 + 3))
    assert (found["healthy_flights"], found["healthy_flights_with_an_alarm"]) == (3, 1)
    assert found["healthy_hours"] == pytest.approx(11 * 0.25)
    alarms = found["false_alarms_per_hour"]
    assert alarms["value"] == pytest.approx(3 / 2.75)
    assert alarms["low"] < 3 / 2.75 < alarms["high"]
    assert found["wrong_group"] == 1
    assert found["engine_failures_with_an_alarm"] == 1


def test_delays_are_by_what_failed_first_in_the_name():
    """An aileron beside a rudder counts as an aileron; five seconds are soon."""
    delays = benchmark.summarize_failures(SCORES)["delay_s"]
    assert delays["aileron"] == {"failures": 3, "found": 3, "within_5_s": 2, "mean": pytest.approx(6.0)}
    assert delays["rudder"] == {"failures": 2, "found": 1, "within_5_s": 1, "mean": 2.0}
    assert delays["elevator"] == {"failures": 1, "found": 0, "within_5_s": 0, "mean": None}


def test_where_there_is_nothing_to_count_shares_are_none_of_one():
    found = benchmark.summarize_failures([score(ENGINE, healthy_s=0.0)])
    assert [found[key] for key in ("precision", "recall", "accuracy")] == [0.0, 0.0, 0.0]
    once = benchmark.summarize_failures([score("rudder", True, 1.0)])
    assert [once[key] for key in ("precision", "recall", "accuracy")] == [1.0, 1.0, 1.0]
    assert benchmark.summarize_failures([score()])["accuracy"] == 1.0


def test_figures_by_labels_are_weighted_by_rows():
    names = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
    one = {"rows": 1} | {name: 0.1 * k for k, name in enumerate(names)}
    other = {"rows": 3} | {name: 0.5 + 0.1 * k for k, name in enumerate(names)}
    found = benchmark.summarize_labels([one, other])
    assert found == {"rows": 4} | {name: pytest.approx(0.375 + 0.1 * k) for k, name in enumerate(names)}


def test_a_flight_without_a_row_of_all_labels_does_not_count():
    names = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
    known = {"rows": 3} | {name: 0.5 + 0.1 * k for k, name in enumerate(names)}
    nothing = {"rows": 0} | dict.fromkeys(names)
    found = benchmark.summarize_labels([nothing, known])
    assert found == {"rows": 3} | {name: pytest.approx(0.5 + 0.1 * k) for k, name in enumerate(names)}
    assert benchmark.summarize_labels([nothing]) == nothing


EVENTS = {
    "set": "gliders", "left_out": "a flight at a time", "scored_by": "events",
    "rows": [{"method": "ours", **benchmark.summarize_failures(SCORES)}],
    "published": [
        {"method": "theirs", "precision": 0.5, "delay_s": {"aileron": {"mean": 3.0}, "rudder": {}}},
    ],
}  # fmt: skip
LABELS = {
    "set": "motors", "left_out": "a day at a time", "scored_by": "labels", "published": [],
    "rows": [
        {"method": "ours", "classes": 0.91, "healthy_or_faulty": 0.9996, "side": None, "mean_error": 0.05},
    ],
}  # fmt: skip
DOCUMENT = {"sets": [EVENTS, LABELS]}


def test_a_data_set_is_a_table_by_events_or_by_labels():
    (gliders, (head, (ours, theirs))), (motors, (labels, rows)) = benchmark.score_tables(DOCUMENT)
    assert (gliders, motors) == ("gliders: left out, a flight at a time", "motors: left out, a day at a time")
    assert len(head) == len(ours) == len(theirs) == 11
    alarms = EVENTS["rows"][0]["false_alarms_per_hour"]
    assert ours == [
        "ours", "0.667", "0.667", "0.667", "6.0 (3 of 3)", "2.0 (1 of 2)", "not found", "3 of 5",
        f"1.1 ({alarms['low']:.1f} to {alarms['high']:.1f})", "1 of 3", "1",
    ]  # fmt: skip
    assert theirs == ["theirs", "0.500", "", "", "3.0", "", "", "", "", "", ""]
    assert labels[1:3] == ["classes", "healthy or faulty"]
    assert rows == [["ours", "0.910", "1.000", "", "0.050", ""]]


def test_tables_for_a_terminal_stand_in_columns_and_those_of_a_page_in_bars():
    text, page = benchmark.as_text({"sets": [LABELS]}).splitlines(), benchmark.as_markdown({"sets": [LABELS]})
    assert text[0] == "motors: left out, a day at a time"
    assert text[1].index("healthy or faulty") == text[2].index("1.000")
    assert text[2] == text[2].rstrip()
    lines = page.splitlines()
    assert lines[:2] == ["### motors: left out, a day at a time", ""]
    assert lines[2].startswith("| method | classes | healthy or faulty |")
    assert lines[3] == "| " + " | ".join(["---"] * 6) + " |"
    assert lines[4] == "| ours | 0.910 | 1.000 |  | 0.050 |  |"


def test_tables_go_between_their_marks_of_a_page(tmp_path):
    page = tmp_path / "page.md"
    begin, end = benchmark.table_markers(DOCUMENT)
    page.write_text(f"before\n{begin}\nold\n{end}\nafter\n", encoding="utf-8")
    benchmark.update_page(DOCUMENT, page)
    assert page.read_text() == f"before\n{begin}\n{benchmark.as_markdown(DOCUMENT)}{end}\nafter\n"
    for text in (f"only {begin}", f"only {end}", ""):
        page.write_text(text)
        with pytest.raises(BadInput, match="has no place for the tables"):
            benchmark.update_page(DOCUMENT, page)
        assert page.read_text() == text
    assert benchmark.table_markers({"other_days": []}) == (
        "<!-- other days: begin -->",
        "<!-- other days: end -->",
    )
