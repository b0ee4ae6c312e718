"""The reproduction's tables and sentences, of claims that differ in everything."""

from beaver_ftc.diagnosis.schemes.published import N_CENTRES
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.reproduce import words

CLAIMS = [
    {
        "where": "Fig. 2", "statement": "The alarm is early.", "flights": ["elevator", "q"],
        "quantity": "delay", "number": 0.2468,
        "unit": "s", "limit": 1.0, "limit_from": "the paper's own", "at_least": False, "none": "never",
        "without": "the alarm", "number_without": None, "verdict": "stronger than the paper", "because": "",
        "reason": "", "lowest": 0.1, "highest": 123.4, "held_in": 2, "borne_out_in": 2, "elsewhere": 2,
        "construction": False,
    },
    {
        "where": "Fig. 5", "statement": "Most of it is given.", "flights": ["rudder"],
        "quantity": "share", "number": 0.25,
        "unit": "of the demand", "limit": 0.5, "limit_from": "most", "at_least": True, "none": "nothing",
        "without": "the flap", "number_without": 0.125, "verdict": "not borne out", "because": "see the text",
        "reason": "", "lowest": None, "highest": 0.9, "held_in": 2, "borne_out_in": 1, "elsewhere": 2,
        "construction": False,
    },
    {
        "where": "IV", "statement": "There are others.", "verdict": "cannot be judged", "reason": "of others",
        "because": "", "construction": False,
    },
]  # fmt: skip
ALSO = {**CLAIMS[1], "number": 0.6, "without": "the flap"}
MISSED = {**CLAIMS[1], "number": 0.3}
PAPER = {
    "case": "rudder", "flown_by": "paper", "detected_s": 0.28, "named": "rudder", "isolated_s": 0.29,
    "before_deg_s": 0.084, "after_deg_s": 0.158, "travel_deg": 210.0, "work_deg2_per_s": 864.0,
    "departed": False,
}  # fmt: skip
DOCUMENT = {
    "counts": {"stronger than the paper": 1, "borne out": 0, "not borne out": 1, "cannot be judged": 1},
    "testable": {"statements": 5, "hold": 2, "elsewhere": 1, "do_not": 2, "unsettled": 1},
    "construction": {"statements": 7, "hold": 6}, "background": 11,
    "adaptation": {"flights": 12, "same": 10},
    "claims": CLAIMS,
    "ablations": [
        {"takes": "the flap", "changes": {"a": 1, "b.c": [], "d": {"p": 0.5}}, "statements": 2, "fail": 1},
    ],
    "sensitivity": [
        {"variant": "at 50 Hz", "missed": [MISSED], "also_without": [ALSO]},
        {"variant": "no engine", "missed": [], "also_without": []},
    ],
    "choices": [{"key": "lambda", "value": {"p": 1.5, "q": [2.0, 3]}, "reason": "not in the paper"}],
    "gains": [
        {"key": "control.options.gain", "default": 60.0, "says": "how fast", "origin": "search",
         "halved": [MISSED], "doubled": []},
    ],
    "beside": {
        "rows": [PAPER, {**PAPER, "flown_by": "ours", "detected_s": None, "named": None, "departed": True}],
        "healthy_flights": 27, "false_alarms": {"paper": 0, "ours": 3},
        "paper_better": [
            {"case": "rudder", "quantity": "isolation after", "unit": "s", "paper": 0.2, "ours": None},
        ],
    },
    "truth_and_design": {
        "terms": [{"moment": "Cm", "truth": ["Cm_0", "Cm_dpt"], "omitted": ["Cm_dpt"]}],
        "designs": [
            {"design": "as printed", "bound": "0.02", "alarm_s": None, "detected_s": 0.1234,
             "share": {"p": 0.5, "q": 11.22, "r": 2.0}, "false_alarm": False, "named": None},
        ],
    },
}  # fmt: skip


def test_the_outcome_in_a_sentence():
    assert words.headline(DOCUMENT) == (
        "The paper has 23 statements. 5 of them can be tested: 2 hold, 2 do not hold, and 1 hold even "
        "without the mechanism that the paper gives as the reason. 1 of the 2 also hold in each of 2 "
        "settings that the paper did not fly. 7 other statements follow from the construction of the code. "
        "6 of these 7 hold in our flights, but they show nothing about the scheme. The last 11 statements "
        "contain nothing that can be measured."
    )
    assert words.summary(DOCUMENT).endswith(
        "the alarm, the named surface and the times stay the same in 10 of 12 flights with a fault."
    )


def test_the_terminal_shows_the_statements_and_what_excepts_them():
    text = words.as_text(DOCUMENT, "out")
    lines = text.splitlines()
    assert lines[0] == "[Zhang2005] flown again"
    head = next(line for line in lines if "Published" in line)
    columns = [head.index(word) for word in ("Published", "Statement", "Our number", "Without", "Verdict")]
    assert columns == sorted(columns)
    assert any("Fig. 5" in line and "not borne out" in line for line in lines)
    assert "see the" in text
    assert "   1 of others" in lines
    at = lines.index(words.summary(DOCUMENT))
    assert lines[at + 1] == "  except at 50 Hz: Fig. 5, most of it is given: 30.0 % of the demand"
    assert "  rudder: isolation after 0.2 s, ours never" in lines
    assert lines[-1] == "page: out/reproduction.html"


def test_the_listed_deviations_have_the_numbers_of_the_code():
    """The sizes of the networks are no options, so that the list alone says them."""
    listed = " ".join(words._SAYS["deviations from the paper"])
    assert f"{N_CENTRES[0]} x {N_CENTRES[1]} x {N_CENTRES[2]} centres" in listed
    assert f"{Scenario(name='x').control.least_effectiveness} by default" in listed
    assert all(word in listed for word in ("spread", "Earth's rotation", "rounding"))
