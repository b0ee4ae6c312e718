"""Every short key in the code, the aircraft and the documents has its entry in docs/references.md."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
KEY = re.compile(r"\[([A-Z][A-Za-z]+\d{2,4}|FDC)\]")
PLACES = ("src/**/*.py", "aircraft/**/*.xml", "docs/*.md", "scenarios/**/*.yaml")


def used():
    files = (path for place in PLACES for path in ROOT.glob(place) if path.name != "references.md")
    return {key: path for path in files for key in KEY.findall(path.read_text(encoding="utf-8"))}


def known():
    return set(KEY.findall((ROOT / "docs" / "references.md").read_text(encoding="utf-8")))


def test_every_key_is_known():
    assert {"TM88", "Zhang2005", "FDC"} <= used().keys()
    assert {key: str(path) for key, path in used().items() if key not in known()} == {}
