"""Runs as JUnit XML, which CI systems show: a test suite for each scenario or sweep, a test case for each
expectation.

The same flights answer all cases of a suite. Each case has an equal part of their time, so that cases add up
to the suite, and suites to the time of the command.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.report import one_line
from beaver_ftc.results.model import Judged

_MAX_LINE_CHARACTERS = 10_000  # of a line of a text


def write_junit(runs: Sequence[Judged], path: Path) -> None:
    """Write the runs, also those that could not be flown."""
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
    """Add the test suite of a run, with its cases."""
    cases = list(_cases(run))
    kinds = Counter(kind for _, kind, _, why in cases if why is not None)
    counts = {"tests": len(cases), "failures": kinds["failure"], "errors": kinds["error"]}
    name_of_run = _xml_safe_text(run.name)  # a file that could not be read has the name of the file
    about = {"name": name_of_run} | {name: str(count) for name, count in counts.items()}
    suite = ElementTree.SubElement(root, "testsuite", about, time=_seconds_text(run.took_s))
    each_s = _seconds_text(run.took_s / len(cases))
    for name, kind, kind_of_failure, why in cases:
        case = ElementTree.SubElement(suite, "testcase", classname=name_of_run, name=name, time=each_s)
        if why is not None:
            ElementTree.SubElement(case, kind, message=_xml_safe_text(why), type=kind_of_failure)


def _cases(run: Judged) -> Iterator[tuple[str, str, str, str | None]]:
    """(name, element, type, why) of each expectation. A scenario that expects nothing, or could not be flown,
    has one case: whether it completes. why: the text of the failure; None if the case passes."""
    for expectation in run.expectations:
        reason = f": {expectation.reason}" if expectation.reason else ""
        why = None if expectation.passed else f"{expectation.expected_and_actual_text}{reason}"
        yield expectation.name, "failure", "ExpectationMissed", why
    if not run.expectations:
        yield "completes", "error", "NotFlown", run.error


def _seconds_text(took_s: float) -> str:
    return f"{took_s:.6f}"


def _xml_safe_text(text: str) -> str:
    """Text that XML can hold. Control characters and lone surrogates, which XML cannot escape, are written as
    escapes of Python; each line is cut after _MAX_LINE_CHARACTERS."""
    return "\n".join(one_line(line, _MAX_LINE_CHARACTERS) for line in text.splitlines())
