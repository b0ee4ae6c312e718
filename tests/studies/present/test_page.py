"""What a study leaves in its folder, and pages that are written in part."""

import re

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.present.figures import heat_map, label_edges, panels
from beaver_ftc.studies.present.page import (
    Bullets,
    Heading,
    Pictures,
    Table,
    as_html,
    as_text,
    replace_between,
    write_files,
)


def drawn():
    figure, axes = panels(1, 2, 4.0, 2.0, "two")
    heat_map(axes[0, 0], [[0.0, 1.0]], {(0, 1): ("one", "white")}, ["a", "b"], ["row"])
    label_edges(axes, "across", ["down"], ["left", "right"])
    return figure


def test_each_content_is_written_in_its_way_and_a_file_may_be_made_of_another(tmp_path):
    files = {
        "text.txt": "é", "bytes.bin": b"\x00", "none": None,
        "figures": {"one.png": drawn()},
        "later.txt": lambda folder: str(len((folder / "bytes.bin").read_bytes())),
    }  # fmt: skip
    write_files(tmp_path / "out", files)
    there = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert there == [f"out/{n}" for n in ("bytes.bin", "figures/one.png", "later.txt", "text.txt")]
    assert (tmp_path / "out/text.txt").read_text(encoding="utf-8") == "é"
    assert (tmp_path / "out/later.txt").read_text() == "1"
    assert b"beaver-ftc" in (tmp_path / "out/figures/one.png").read_bytes()[:2048]


def test_the_text_of_a_page_has_no_pictures():
    parts = ["said", Pictures([("one", "one")]), Heading("numbers"), Table(("a", "b"), [("1", "22")]), "note"]
    assert as_text(parts) == "said\n\nnumbers\n\na  b\n1  22\nnote"


def test_what_stands_outside_the_marks_of_a_page_stays(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<begin>\nold\n<end>\nafter\n")
    replace_between(page, "<begin>", "<end>", "new\n")
    assert page.read_text() == "before\n<begin>\nnew\n<end>\nafter\n"
    for begin, end in (("<a>", "<b>"), ("<end>", "<begin>")):
        with pytest.raises(BadInput, match=f"has no place for the tables, allowed: a page with {begin} and"):
            replace_between(page, begin, end, "new")


def test_whatever_a_page_shows_is_text_and_never_markup(tmp_path):
    picture = tmp_path / "one.png"
    picture.write_bytes(b"a picture")

    def text(n):
        return f'<i>{n}</i> & "more"'

    parts = [
        text(1), Heading(text(2)), Table((text(3), "verdict"), [(text(4), text(5))], {text(5): True}),
        Bullets(text(6), [text(7)]), Pictures([(text(8), "one")]),
    ]  # fmt: skip
    made = as_html(text(0), [*parts, "fly `it` again"], {"one": picture})
    assert "<i>" not in made
    assert "<p>fly it again</p>" in made
    assert re.findall("&lt;i&gt;(.)&lt;/i&gt; &amp; &quot;more&quot;", made.partition("</title>")[2]) == [
        str(n) for n in range(9)
    ]
