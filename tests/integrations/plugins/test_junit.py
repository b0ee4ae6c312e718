"""`run --junit`: what CI systems read."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from beaver_ftc.results.junit import write_junit

BEAVER = Path(sys.executable).with_name("beaver-ftc")


def _attributes(element, *names):
    return tuple(element.get(name) for name in names)


def test_expectations_become_cases_and_failures_say_both_values(tmp_path):
    runs = [
        {
            "scenario": "a",
            "expectations": [
                {"name": "no_departure", "passed": True, "expected": True, "actual": True},
                {"name": "isolated_as", "passed": False, "expected": "rudder", "actual": None},
            ],
        },
        {"scenario": "b", "expectations": []},
        {"scenario": "c", "error": 'c: not finite at 3 s: "q" & <r>'},
    ]
    write_junit(runs, tmp_path / "deep" / "j.xml")
    suites = list(ElementTree.parse(tmp_path / "deep" / "j.xml").getroot())
    assert [_attributes(s, "name", "tests", "failures", "errors") for s in suites] == [
        ("a", "2", "1", "0"),
        ("b", "1", "0", "0"),
        ("c", "1", "0", "1"),
    ]
    failure = suites[0][1].find("failure")
    assert failure.get("message") == "expected rudder, actual None"
    assert suites[2][0].find("error").get("message") == runs[2]["error"]


def test_the_command_line_writes_it_whatever_the_verdict(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "name: s\nduration_s: 1\nexpect: {no_departure: false, no_false_alarm: true}\n"
    )
    (tmp_path / "bad.yaml").write_text("name: bad\nduration_s: x\n")
    done = subprocess.run(
        [BEAVER, "run", "s.yaml", "--no-report", "--junit", "j.xml"], cwd=tmp_path, check=False
    )
    assert done.returncode == 1
    (suite,) = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert _attributes(suite, "tests", "failures") == ("2", "1")
    done = subprocess.run([BEAVER, "run", "bad.yaml", "--junit", "j.xml"], cwd=tmp_path, check=False)
    assert done.returncode == 2
    (suite,) = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert "bad.yaml:2: duration_s" in suite[0].find("error").get("message")


def test_what_xml_cannot_hold_is_escaped(tmp_path):
    said = "plug-in x: \x00 \x1b[31mred \ufffe \udcff\nsecond line"
    missed = {"name": "isolated_as", "passed": False, "expected": "a\x07b", "actual": None}
    write_junit(
        [{"scenario": "a", "error": said}, {"scenario": "b", "expectations": [missed]}], tmp_path / "j"
    )
    message = ElementTree.parse(tmp_path / "j").find(".//error").get("message")
    assert message == r"plug-in x: \x00 \x1b[31mred \ufffe \udcff" + "\nsecond line"
    assert (
        ElementTree.parse(tmp_path / "j").find(".//failure").get("message") == r"expected a\x07b, actual None"
    )
