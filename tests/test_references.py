"""Every short key in code, aircraft and documents has its entry in REFERENCES.md, and each is used."""

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
# A10 and A11 are assumptions, as A1 to A9.
KEY = re.compile(r"(?<=[\[ ])(?!A\d\d\b)([A-Z][A-Za-z]*\d{2,4}|FDC|JAWA|MIL-F-8785C|MPU-9250)(?=[\],])")
BRACKET = re.compile(r"\[[A-Z][\w, .-]*\]|\[[A-Z][\w-]*,")  # one key or several, perhaps with a place in it
PLACES = (
    "README.md", "CONTRIBUTING.md", "src/**/*.py", "src/**/*.yaml", "src/**/*.json", "aircraft/**/*.xml",
    "aircraft/**/*.yaml", "docs/**/*.md", "scenarios/**/*.yaml", "examples/**/*.py", "benchmarks/*.py",
)  # fmt: skip
ENTRIES = re.findall(r"^- \[([^\]]+)\] ", (ROOT / "REFERENCES.md").read_text(encoding="utf-8"), re.M)


def keys_in(path):
    brackets = BRACKET.findall(path.read_text(encoding="utf-8"))
    return [key for bracket in brackets for key in KEY.findall(bracket)]


@cache
def used():
    files = (path for place in PLACES for path in ROOT.glob(place) if path.name != "REFERENCES.md")
    return {key: path for path in files for key in keys_in(path)}


def test_every_key_is_known():
    assert {"TM88", "Zhang2005", "FDC", "MIL-F-8785C"} <= used().keys()
    assert {key: str(path) for key, path in used().items() if key not in ENTRIES} == {}


def test_every_entry_is_used_and_stands_once():
    assert sorted(ENTRIES) == sorted(set(ENTRIES) & used().keys())
