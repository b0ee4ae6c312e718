"""The reproduction's tables and sentences, of claims that differ in everything."""

import pytest

from beaver_ftc.studies.reproduce import reproduction as words

CLAIMS = [
    {
        "where": "Fig. 2", "statement": "The alarm is early.", "quantity": "delay", "number": 0.2468,
        "unit": "s",
        "limit": 1.0, "at_least": False, "passed": True, "remark": "", "lowest": 0.1, "highest": 123.4,
        "held_in": 2,
    },
    {
        "where": "Fig. 5", "statement": "Most of it is given.", "quantity": "share", "number": 0.25,
        "unit": "of the demand", "limit": 0.5, "at_least": True, "passed": False, "remark": "see the text",
        "lowest": None, "highest": 0.9, "held_in": 1,
    },
]  # fmt: skip
DOCUMENT = {
    "claims": CLAIMS,
    "sensitivity": [
        {"variant": "at 50 Hz", "missed": [{**CLAIMS[1], "number": 0.3}]},
        {"variant": "no engine", "missed": []},
    ],
    "choices": [{"key": "lambda", "value": {"p": 1.5, "q": [2.0, 3]}, "reason": "not in the paper"}],
}


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (None, "s", "never"), (0.2468, "s", "0.247 s"), (99.94, "s", "99.9 s"), (999.9, "s", "1000 s"),
        (1234.5, "", "1234"), (-123.4, "m", "-123 m"), (0.123, "of all", "12.3 % of all"),
    ],
)  # fmt: skip
def test_numbers_have_three_digits_and_shares_are_in_percent(value, unit, said):
    assert words.number(value, unit) == said


def test_each_statement_is_a_row_of_the_verdict():
    assert words.verdict_rows(DOCUMENT) == [
        ("Fig. 2", "The alarm is early.", "delay 0.247 s (at most 1)", "borne out", ""),
        (
            "Fig. 5", "Most of it is given.", "share 25.0 % of the demand (at least 50 %)", "NOT BORNE OUT",
            "see the text",
        ),
    ]  # fmt: skip


def test_what_changes_make_of_a_statement():
    assert words.sensitivity_rows(DOCUMENT) == [
        ("Fig. 2", "The alarm is early.", "0.1 s", "123 s", "2 of 2"),
        ("Fig. 5", "Most of it is given.", "never", "90.0 % of the demand", "1 of 2"),
    ]
    assert words.exceptions(DOCUMENT) == ["at 50 Hz: Fig. 5, most of it is given: 30.0 % of the demand"]
    assert words.choice_rows(DOCUMENT) == [("lambda", "p 1.5, q 2; 3", "not in the paper")]


def test_the_outcome_in_a_sentence():
    assert words.summary(DOCUMENT) == (
        "1 of 2 published statements are borne out; 1 of them under every one of 2 changes to what the paper "
        "leaves open."
    )


def test_the_terminal_shows_the_statements_and_what_excepts_them():
    lines = words.as_text(DOCUMENT, "out").splitlines()
    assert lines[0] == "[Zhang2005] flown again"
    head = next(line for line in lines if "Published" in line)
    assert [head.index(word) for word in words.VERDICT_HEAD[:4]] == sorted(
        head.index(word) for word in words.VERDICT_HEAD[:4]
    )
    assert any("Fig. 5" in line and "NOT BORNE OUT" in line for line in lines)
    assert any("see the text" in line for line in lines)
    assert lines[-4:] == [
        words.summary(DOCUMENT), "  except at 50 Hz: Fig. 5, most of it is given: 30.0 % of the demand", "",
        "page: out/reproduction.html",
    ]  # fmt: skip


def test_what_is_not_borne_out_is_red_and_where_it_stands_is_not_broken():
    coloured = words.as_text(DOCUMENT, "out", colour=True)
    assert "\x1b[1;31mNOT BORNE OUT" in coloured
    assert "\x1b[32mborne out" in coloured
    long = {**CLAIMS[0], "where": "Figure 2 and section VII", "statement": "word " * 80}
    assert "Figure 2 and section VII" in words.as_text({**DOCUMENT, "claims": [long]}, "out")
