"""The published scheme in flight: its threshold by another road, its options, and what it must not do."""

import pytest

from beaver_ftc.scenario.schema import load_text

SCHEME = {"scheme": "zhang2005", "thresholds": "published"}


def mistake(fdi):
    with pytest.raises(Exception, match=r".*") as caught:
        load_text(f"name: x\nfdi: {fdi}\n", source="s.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("fdi", "says"),
    [
        ("options: {gain: 3}", "options.gain: zhang2005 has no such option"),
        ("options: {leave_out: 1.5}", "options.leave_out: 1.5, allowed: whole numbers from 0 to 3"),
        ("options: {network_gain: -1}", "options.network_gain: -1, allowed: numbers from 0 to 10000"),
        ("fault_class: all", "fault_class: zhang2005 is the paper's alone, allowed: published"),
        ("statistical: {}", "statistical: zhang2005 is the paper's alone, allowed: null"),
        ("thresholds: interval", "thresholds: zhang2005 is the paper's alone, allowed: published"),
        ("sharpen: all", "sharpen: zhang2005 is the paper's alone, allowed: none"),
    ],
)
def test_what_it_has_not_is_refused_in_a_line(fdi, says):
    line = mistake(f"{{scheme: zhang2005, {fdi}}}")
    assert line.startswith("s.yaml:2: fdi." + says)
    assert "\n" not in line
