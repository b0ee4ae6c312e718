"""Runs as JUnit XML, which CI systems show: a test suite a scenario or sweep, a test case an expectation.

All cases of a suite are answered by the same flights: each has an equal part of the time these took, so that
the cases add up to the suite and the suites to what the command took.
"""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.validation import one_line
from beaver_ftc.results.model import Expectation, Judged

_MAX_LINE_CHARACTERS = 10_000  # characters of one line


def write_junit(runs: Sequence[Judged], path: Path) -> None:
    """Write what has been judged, or could not be flown."""
    took_s = sum(run.took_s for run in runs)
    root = ElementTree.Element("testsuites", name="beaver-ftc", time=_seconds_text(took_s))
    for run in runs:
        _add_suite(root, run)
    ElementTree.indent(root)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise SimulationFailed(f"cannot write {path}: {error.strerror}") from error


def _add_suite(root: ElementTree.Element, run: Judged) -> None:
    name = run.name
    cases = [_expectation_case(name, expectation) for expectation in run.expectations] or [
        _completion_case(run)
    ]
    failures = sum(case.find("failure") is not None for case in cases)
    errors = sum(case.find("error") is not None for case in cases)
    counts = {"name": name, "tests": str(len(cases)), "failures": str(failures), "errors": str(errors)}
    for case in cases:
        case.set("time", _seconds_text(run.took_s / len(cases)))
    ElementTree.SubElement(root, "testsuite", counts, time=_seconds_text(run.took_s)).extend(cases)


def _seconds_text(took_s: float) -> str:
    return f"{took_s:.6f}"


def _expectation_case(name: str, expectation: Expectation) -> ElementTree.Element:
    case = ElementTree.Element("testcase", classname=name, name=expectation.name)
    if not expectation.passed:
        says = expectation.expected_and_actual_text + (
            f": {expectation.reason}" if expectation.reason else ""
        )
        ElementTree.SubElement(case, "failure", message=_xml_safe_text(says), type="ExpectationMissed")
    return case


def _completion_case(run: Judged) -> ElementTree.Element:
    """The case of a scenario that expects nothing, or could not be flown."""
    case = ElementTree.Element("testcase", classname=run.name, name="completes")
    if run.error is not None:
        ElementTree.SubElement(case, "error", message=_xml_safe_text(run.error), type="NotFlown")
    return case


def _xml_safe_text(said: str) -> str:
    """Text that XML can hold: it has no control characters, nor halves of letters, not even escaped."""
    return "\n".join(one_line(line, _MAX_LINE_CHARACTERS) for line in said.splitlines())
