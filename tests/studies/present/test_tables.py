"""Numbers and tables as people read them."""

import pytest

from beaver_ftc.studies.present import tables


@pytest.mark.parametrize(
    ("value", "digits", "said"),
    [
        (None, 3, "-"), ("open", 3, "open"), ("", 3, "-"), (float("inf"), 3, "never"),
        (float("nan"), 3, "never"),
        (0.0, 3, "0"), (1e-3, 3, "0.001"), (9.99e-4, 3, "<0.001"), (-9.99e-4, 3, ">-0.001"),
        (50.25, 3, "50.2"),
        (999.6, 3, "1000"), (99.96, 3, "100"), (-1234.5, 3, "-1234"), (9.876, 2, "9.9"), (49.8, 2, "50"),
        (0.12345, 2, "0.12"),
    ],
)  # fmt: skip
def test_a_number_has_the_digits_worth_reading_and_no_exponent(value, digits, said):
    assert tables.number(value, digits=digits) == said


def test_units_follow_and_what_is_missing_has_a_word_of_its_own():
    assert tables.number(1.5, "deg/s") == "1.5 deg/s"
    assert tables.number(None, "deg/s", none="never") == "never"
    assert tables.seconds(1.234) == "1.23 s"
    assert tables.seconds(None) == "never"
    assert [tables.finite(x) for x in (1.5, float("inf"), "inf", 3)] == [1.5, None, "inf", 3]


def test_a_file_of_no_rows_is_empty():
    assert tables.as_csv([]) == ""


def test_a_table_is_its_columns_each_with_the_cell_of_a_row():
    columns = (
        ("who", "name"), ("after", "found.delay_s", "s"), ("share", "share", "{:.0%}".format),
        ("both", lambda row: f"{row['name']}: {row['share']:g}"),
    )  # fmt: skip
    rows = [
        {"name": "a", "found": {"delay_s": 0.5}, "share": 0.25},
        {"name": "", "found": {"delay_s": None}, "share": 1.0},
    ]
    assert tables.tabulated(columns, rows) == (
        ["who", "after", "share", "both"],
        [["a", "0.5 s", "25%", "a: 0.25"], ["-", "-", "100%", ": 1"]],
    )
