"""The survey in words: each sentence of a small survey made by hand."""

import pytest

from beaver_ftc.studies.power.shown import as_text, comparison
from beaver_ftc.studies.power.survey import WITHIN_S

AT = {"sensors": "perfect", "turbulence": "none"}


def alarms(low, value, high, hours=0.5):
    return {"per_h": value, "per_h_low": low, "per_h_high": high, "hours": hours}


def total(scheme, flights=4, median_s=0.25, **changes):
    rates = {f"{within_s:g}": 0.5 + 0.1 * i for i, within_s in enumerate(WITHIN_S)}
    within = {soon: {"value": rate, "low": rate - 0.2, "high": rate + 0.1} for soon, rate in rates.items()}
    found = {"flights": flights, "within": within, "median_delay_s": median_s}
    return {**AT, "scheme": scheme, "surface": "rudder", **found, **changes}


@pytest.fixture
def document():
    level = {**AT, "before_faults": alarms(1.0, 3.0, None), "own_level": None}
    ours = total("statistical", own_level={**total("x"), "flights": 0})
    return {
        "grid": {
            "conditions": [("perfect", "none")], "surfaces": ["rudder"], "magnitudes": [0.05, 0.3],
            "excitations_deg_s": [2, 8],
        },
        "levels": [
            {**level, "scheme": "statistical", "calibration": alarms(1.0, 7.0, 20.0)},
            {**level, "scheme": "other", "calibration": alarms(2.0, 8.0, 21.0, hours=0.4)},
        ],
        "totals": [ours, total("other", median_s=None)],
        "limits": [{**AT, "surface": "rudder", "within": {"0.5": 0.25, "1": 0.99}}],
        "false_alarms_per_h": 3.6,
        "comparison": [],
        "failures": ["other: broke"],
    }  # fmt: skip


def test_every_line_says_what_the_survey_found(document):
    text = as_text(document)
    lines = [line.split() for line in text.splitlines()]
    assert text.splitlines()[0].strip() == "perfect sensors, still air"
    (ours,) = [line for line in lines if line[:1] == ["statistical"]]
    assert ours[1:7] == ["7", "(1", "to", "20)", "3", "(1)"]
    assert ours[-3:] == ["/".join(str(50 + 10 * i) for i in range(len(WITHIN_S))), "0.25", "s"]
    (other,) = [line for line in lines if line[:1] == ["other"]]
    assert other[-1] == "never"
    assert any(line[:3] == ["as", "it", "ships"] and line[-1] == "-" for line in lines)
    assert any(line[:2] == ["informed", "test"] and line[-1] == "25/99" for line in lines)
    assert "losses of 5, 30 % detected" in text
    assert "references of 2, 8 deg/s" in text
    assert "at most 3.6 per hour, on the same 0.40 h" in text
    assert "every reading that the statistical scheme uses" in text
    assert text.endswith("could not be judged: other: broke")


@pytest.mark.parametrize(("p", "chance"), [(0.0002, ""), (0.3, ", so this may be chance")])
def test_below_a_table_it_is_said_who_is_better(document, p, chance):
    """Of each surface, with intervals; the built-in detectors alone are no rivals."""
    soon = total("both")["within"] | {"5": {"value": 0.4, "low": 0.3, "high": 0.5}}
    duel = {**AT, "ours": "both", "against": "other", "surface": "rudder", "within_s": 5.0, "verdict": "x"}
    duel |= {"seeds_ours": 1, "seeds_theirs": 13, "p": p}
    document["totals"] += [{**total("both"), "within": soon}]
    document["comparison"] = [duel, {**duel, "within_s": 1.0, "seeds_theirs": 0}]
    lines = as_text(document).splitlines()
    (said,) = [line for line in lines if line.startswith("rudder, found within 5 s: ")]
    best = total("other")["within"]["5"]
    share = f"other {100 * best['value']:.0f} % ({100 * best['low']:.0f} % to {100 * best['high']:.0f} %)"
    assert said.endswith(
        f": {share} is better than both 40 % (30 % to 50 %); wins: 13 against 1, p = {p:.2g}{chance}."
    )
    assert lines.index(said) < next(i for i, line in enumerate(lines) if line.startswith("per surface: "))


def test_where_one_is_better_than_another_is_said_by_condition():
    duel = {**AT, "ours": "statistical", "against": "other", "surface": "rudder", "verdict": "better"}
    duel["within_s"] = 5.0
    duels = [
        duel,
        {**duel, "surface": "elevator"},
        {**duel, "against": "third", "verdict": "worse", "turbulence": "light"},
        {**duel, "verdict": "even", "turbulence": "light"},
    ]
    worse, better, counts = comparison({"comparison": duels})
    assert (
        worse == "statistical is worse than third within 5 s: rudder with perfect sensors, light turbulence"
    )
    assert (
        better
        == "statistical is better than other within 5 s: rudder, elevator with perfect sensors, still air"
    )
    assert "4 comparisons: better in 2, worse in 1, no difference" in counts
