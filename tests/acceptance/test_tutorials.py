"""Each tutorial from an empty folder: its files written, its commands and its Python run, in their order."""

import re
import shutil

import pytest

from .documents import ROOT, steps
from .exceptions import instead

TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.md"))
EXAMPLE = re.compile(r"\]\(\.\./\.\./(examples/[\w./-]+\.\w+)\)")
BY_HAND = re.compile(r"beaver-ftc validate mistaken\.yaml")  # shows what a mistake looks like


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_from_an_empty_folder(page, installation, tmp_path):
    text = page.read_text(encoding="utf-8")
    for linked in EXAMPLE.findall(text):  # files that the reader is asked to fetch
        shutil.copy(ROOT / linked, tmp_path)
    for step in steps(text):
        if step.kind == "file":
            (tmp_path / step.name).write_text(step.text)
            continue
        given = ("python", "-c", step.text) if step.kind == "python" else ("bash", "-c", instead(step.text))
        if given[-1] is None:
            continue
        done = installation.run(*given, cwd=tmp_path, MPLBACKEND="agg")
        assert "Traceback" not in done.stderr + done.stdout, done.stderr
        assert done.returncode == 0 or _is_expected(step.text, done), (
            f"{step.text}\n{done.stdout}\n{done.stderr}"
        )


def _is_expected(line, done):
    """Whether an exit status other than 0 is what the page says: a missed expectation, or bad input shown."""
    if done.returncode == 2:
        return bool(BY_HAND.match(line))
    return done.returncode == 1 and re.search("MISSED|FAILED", done.stdout)
