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


def test_columns_are_as_wide_as_their_widest_cell():
    assert tables.aligned([["a", "bb", "c"], ["long", "b", ""]]) == "a     bb  c\nlong  b"


def test_a_table_in_markdown_and_html():
    assert tables.markdown_table(["a", "b|c"], [["1", "2"]]) == "| a | b\\|c |\n| --- | --- |\n| 1 | 2 |"
    table = tables.html_table(["<a>", "b"], [["✓ yes", "✗ no"], ["1", "2"]], "so & so")
    assert "<caption>so &amp; so</caption>" in table
    assert '<th scope="col">&lt;a&gt;</th><th scope="col">b</th>' in table
    assert '<td class="met">✓ yes</td><td class="missed">✗ no</td>' in table
    assert "<tr><td>1</td><td>2</td></tr>" in table
    assert "caption" not in tables.html_table(["a"], [["1"]])


def test_names_stand_to_the_left_unbroken_and_numbers_to_the_right():
    table = tables.plain(
        "of [b]names[/b]", ["name", "value"], [["a long name", "1.5"], [":smile: [red]b[/red]", "22"]]
    )
    text = tables.printed([table], width=60).splitlines()
    assert text[0] == "of [b]names[/b]"
    assert [len(line) for line in text[1:]] == [len(text[1])] * 3
    assert [line[:4] for line in text[1:]] == ["name", "a lo", ":smi"]
    assert text[3].startswith(":smile: [red]b[/red]")
    assert "\x1b" not in "".join(text)
    narrow = tables.plain("", ["name", "value"], [["a long name", "1.5 of a great many"]])
    assert "a long name" in tables.printed([narrow], width=24)
    assert "\x1b" in tables.printed([tables.plain("t", ["n"], [["1"]])], width=20, colour=True)
