"""What each command answers, in words, as a document, on pages and in figures, is what was kept of it."""

import json
import re

import pytest
from matplotlib.figure import Figure

from commands import beaver
from drawn_figures import shown
from given import documents
from kept import page

GIVEN = documents("answers")[0]
KEPT = (".acmi", ".html", ".json", ".md", ".xml", ".yaml")
# What hangs on the day, the machine and the code, and what pages have to look well.
APART = re.compile(
    r'\d{4}-\d\d-\d\d \d\d:\d\d UTC|(?<=")[0-9a-f]{16,}(?=")|(beaver-ftc|jsbsim|numpy|numba|python) \d[.\d]+'
    r"|(?<=Plan )[0-9a-f]{64}|(?<=flight code )[0-9a-f]{16}|<(style|script)\b.*?</\2>"
    r"|(?<=(?:eri|rit)(?:ved|ten) in )[\d.]+|(?<= time=\")[\d.]+|^[\w ]+: \d+%(, \d+ \w+ left)?$",
    re.DOTALL | re.MULTILINE,
)


@pytest.fixture
def figures(monkeypatch):
    """What the figures of each file name show that are saved. One process does everything, in no time."""
    found, save = {}, Figure.savefig

    def saved(figure, to, **options):
        found.setdefault(getattr(to, "name", f"{len(found)}"), []).append(shown(figure))
        save(figure, to, **options | {"dpi": 10})

    monkeypatch.setattr(Figure, "savefig", saved)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0})
    monkeypatch.setattr("secrets.randbits", lambda bits: 2**bits - 7)
    monkeypatch.setattr("beaver_ftc.studies.compare.trial.thread_time", lambda: 0.0)
    for place, value in GIVEN["quick"].items():
        monkeypatch.setattr(place, value)
    return found


@pytest.mark.parametrize("name", GIVEN["answers"])
def test_an_answer_says_and_shows_what_is_kept(name, figures, changed, tmp_path):
    for file, text in GIVEN["files"].items():
        (tmp_path / file).write_text(text)
    said = [beaver(*line.split(), cwd=tmp_path) for line in GIVEN["answers"][name]]
    files = sorted(file for file in tmp_path.rglob("*.*") if file.name not in GIVEN["files"])
    written = {str(file.relative_to(tmp_path)): file for file in files}
    assert not changed(
        {
            "said": [[one.returncode, *_read(one.stdout), *_read(one.stderr)] for one in said],
            "written": {of: _read(file.read_text()) for of, file in written.items() if file.suffix in KEPT},
            "files": [*written],
            "figures": figures,
        },
        relative=1e-3,
    )


def _read(text):
    """The lines of a text, or its document."""
    text = APART.sub("", text)
    return [json.loads(text, object_hook=_unversioned)] if text.startswith("{") else page(text)


def _unversioned(section):
    return {key: value for key, value in section.items() if key not in ("versions", "took_s")}
