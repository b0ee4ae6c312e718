"""Runs as JUnit XML, which CI systems show: a test suite a scenario or sweep, a test case an expectation.

All cases of a suite are answered by the same flights: each has an equal part of the time these took, so that
the cases add up to the suite and the suites to what the command took.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.validation import one_line
from beaver_ftc.results.model import Judged

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
    asked = list(_cases(run))
    kinds = Counter(kind for _, kind, _, why in asked if why is not None)
    counts = {"tests": len(asked), "failures": kinds["failure"], "errors": kinds["error"]}
    name_of_run = _xml_safe_text(run.name)  # that of a file, if it could not be read
    about = {"name": name_of_run} | {name: str(count) for name, count in counts.items()}
    suite = ElementTree.SubElement(root, "testsuite", about, time=_seconds_text(run.took_s))
    each_s = _seconds_text(run.took_s / len(asked))
    for name, kind, what, why in asked:
        case = ElementTree.SubElement(suite, "testcase", classname=name_of_run, name=name, time=each_s)
        if why is not None:
            ElementTree.SubElement(case, kind, message=_xml_safe_text(why), type=what)


def _cases(run: Judged) -> Iterator[tuple[str, str, str, str | None]]:
    """(name, element, type, why) of each expectation; of a scenario that expects nothing, or could not be
    flown, whether it completes. why: None where all is well."""
    for one in run.expectations:
        reason = f": {one.reason}" if one.reason else ""
        missed = None if one.passed else f"{one.expected_and_actual_text}{reason}"
        yield one.name, "failure", "ExpectationMissed", missed
    if not run.expectations:
        yield "completes", "error", "NotFlown", run.error


def _seconds_text(took_s: float) -> str:
    return f"{took_s:.6f}"


def _xml_safe_text(said: str) -> str:
    """Text that XML can hold: it has no control characters, nor halves of letters, not even escaped."""
    return "\n".join(one_line(line, _MAX_LINE_CHARACTERS) for line in said.splitlines())
