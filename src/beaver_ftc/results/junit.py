"""Runs as JUnit XML, which CI systems show: a test suite a scenario, a test case an expectation."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.problems import one_line

Document = dict[str, Any]
_LONGEST = 10_000  # characters of one line


def write_junit(runs: Sequence[Document], path: Path) -> None:
    """Write the runs: metrics documents, or {scenario, error} of one that could not be flown."""
    root = ElementTree.Element("testsuites", name="beaver-ftc")
    for run in runs:
        _add_suite(root, run)
    ElementTree.indent(root)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        ElementTree.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise SimulationFailed(f"cannot write {path}: {error.strerror}") from error


def _add_suite(root: ElementTree.Element, run: Document) -> None:
    name = run["scenario"]
    cases = [_case(name, expectation) for expectation in run.get("expectations", [])] or [_flight(name, run)]
    failures = sum(case.find("failure") is not None for case in cases)
    errors = sum(case.find("error") is not None for case in cases)
    counts = {"name": name, "tests": str(len(cases)), "failures": str(failures), "errors": str(errors)}
    ElementTree.SubElement(root, "testsuite", counts).extend(cases)


def _case(name: str, expectation: Document) -> ElementTree.Element:
    case = ElementTree.Element("testcase", classname=name, name=expectation["name"])
    if not expectation["passed"]:
        says = f"expected {expectation['expected']}, actual {expectation['actual']}"
        ElementTree.SubElement(case, "failure", message=_text(says), type="ExpectationMissed")
    return case


def _flight(name: str, run: Document) -> ElementTree.Element:
    """The case of a scenario that expects nothing, or could not be flown."""
    case = ElementTree.Element("testcase", classname=name, name="completes")
    if "error" in run:
        ElementTree.SubElement(case, "error", message=_text(run["error"]), type="NotFlown")
    return case


def _text(said: str) -> str:
    """Text that XML can hold: it has no control characters, nor halves of letters, not even escaped."""
    return "\n".join(one_line(line, _LONGEST) for line in said.splitlines())
