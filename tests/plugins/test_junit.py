"""`run --junit`: what CI systems read."""

import time
from xml.etree import ElementTree

from beaver_ftc.results.junit import write_junit
from beaver_ftc.results.model import Expectation, Judged
from commands import beaver


def _attributes(element, *names):
    return tuple(element.get(name) for name in names)


def test_expectations_become_cases_and_failures_say_both_values(tmp_path):
    runs = [
        Judged(
            "a",
            expectations=(
                Expectation("no_departure", True, True, True),
                Expectation("isolated_as", False, "rudder", None),
                Expectation("isolated_as", False, ("rudder",), (), reason="too early"),
            ),
        ),
        Judged("b"),
        Judged("c", error='c: not finite at 3 s: "q" & <r>'),
    ]
    write_junit(runs, tmp_path / "deep" / "j.xml")
    suites = list(ElementTree.parse(tmp_path / "deep" / "j.xml").getroot())
    assert [_attributes(s, "name", "tests", "failures", "errors") for s in suites] == [
        ("a", "3", "2", "0"),
        ("b", "1", "0", "0"),
        ("c", "1", "0", "1"),
    ]
    failure = suites[0][1].find("failure")
    assert failure.get("message") == "expected rudder, actual None"
    assert suites[0][2].find("failure").get("message") == "expected ['rudder'], actual []: too early"
    assert suites[2][0].find("error").get("message") == runs[2].error


def test_the_command_line_writes_it_whatever_the_verdict(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "name: s\nduration_s: 1\nexpect: {no_departure: false, no_false_alarm: true}\n"
    )
    (tmp_path / "bad.yaml").write_text("name: bad\nduration_s: x\n")
    done = beaver("run", "s.yaml", "--no-report", "--junit", "j.xml", cwd=tmp_path)
    assert done.returncode == 1
    (suite,) = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert _attributes(suite, "tests", "failures") == ("2", "1")
    done = beaver("run", "bad.yaml", "--junit", "j.xml", cwd=tmp_path)
    assert done.returncode == 2
    (suite,) = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert "bad.yaml:2: duration_s" in suite[0].find("error").get("message")


def _flown(folder, *arguments):
    began = time.perf_counter()
    done = beaver(*arguments, "--no-report", "--junit", "j.xml", cwd=folder)
    return done, time.perf_counter() - began, ElementTree.parse(folder / "j.xml").getroot()


def test_a_sweep_is_a_suite_and_each_of_its_bounds_a_case(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "name: s\nbase: fault-free\nset: {duration_s: 1}\nruns: 2\n"
        "expect: {departure_rate: {at_least: 1, at_most: 1}, pass_rate: {at_least: 1}}\n"
    )
    done, took_s, root = _flown(tmp_path, "sweep", "s.yaml")
    assert done.returncode == 1
    (suite,) = root
    assert _attributes(suite, "name", "tests", "failures", "errors") == ("s", "3", "1", "0")
    assert [case.get("name") for case in suite] == [
        "departure_rate.at_least", "departure_rate.at_most", "pass_rate.at_least"
    ]  # fmt: skip
    assert suite[0].find("failure").get("message") == "expected ≥ 1, actual 0 of 2 flights"
    assert 0 < float(suite.get("time")) < took_s
