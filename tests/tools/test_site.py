"""The web site is built of docs/ as it stands, and its reference has every public name."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import beaver_ftc as bf

ROOT = Path(__file__).parents[2]
pytest.importorskip("mkdocstrings")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    environment = {**os.environ, "BEAVER_FTC_RUN_NOTEBOOKS": "false", "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", folder]
    built = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return folder


def test_every_public_name_is_in_the_reference_with_its_source(site):
    page = (site / "python-names.html").read_text(encoding="utf-8")
    found = set(re.findall(r'id="beaver_ftc\.(?:aircraft\.)?(\w+)"', page))
    assert set(bf.__all__) - {"__version__", "aircraft"} <= found
    assert "load" in found
    assert page.count("Source code in") > 40


def test_every_page_and_notebook_is_there(site):
    pages = {path.stem for path in (ROOT / "docs").glob("*.md")} - {"README"} | {"index"}
    assert pages <= {path.stem for path in site.glob("*.html")}
    notebooks = {path.stem for path in (ROOT / "docs" / "notebooks").glob("*.ipynb")}
    assert {path.stem for path in (site / "notebooks").rglob("*.html")} == notebooks
