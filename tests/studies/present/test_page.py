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
    as_markdown,
    replace_between,
    write_files,
)
from beaver_ftc.studies.present.tables import as_csv


def drawn():
    figure, axes = panels(1, 2, 4.0, 2.0, "two")
    heat_map(axes[0, 0], [[0.0, 1.0]], {(0, 1): ("one", "white")}, ["a", "b"], ["row"])
    label_edges(axes, "across", ["down"], ["left", "right"])
    return figure


def test_each_content_is_written_in_its_way_and_a_file_may_be_made_of_another(tmp_path):
    files = {
        "text.txt": "é", "bytes.bin": b"\x00", "none": None,
        "figures": {"one.png": drawn(), "one.svg": drawn()},
        "later.txt": lambda folder: str(len((folder / "bytes.bin").read_bytes())),
    }  # fmt: skip
    write_files(tmp_path / "out", files)
    there = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file())
    assert there == [
        f"out/{n}" for n in ("bytes.bin", "figures/one.png", "figures/one.svg", "later.txt", "text.txt")
    ]
    assert (tmp_path / "out/text.txt").read_text(encoding="utf-8") == "é"
    assert (tmp_path / "out/later.txt").read_text() == "1"
    assert b"beaver-ftc" in (tmp_path / "out/figures/one.png").read_bytes()[:2048]


def test_a_figure_is_the_same_to_the_byte_each_time(tmp_path):
    for folder in ("a", "b"):
        write_files(tmp_path / folder, {"one.png": drawn(), "one.svg": drawn()})
    for name in ("one.png", "one.svg"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_panels_bear_their_labels_at_the_edges_alone():
    figure, axes = panels(2, 2, 4.0, 4.0)
    label_edges(axes, "x", ["top", "bottom"], ["left", "right"])
    assert [[a.get_xlabel() for a in row] for row in axes] == [["", ""], ["x", "x"]]
    assert [[a.get_ylabel() for a in row] for row in axes] == [["top", ""], ["bottom", ""]]
    assert [[a.get_title() for a in row] for row in axes] == [["left", "right"], ["", ""]]
    assert figure.get_size_inches().tolist() == [4.0, 4.0]
    assert (figure.dpi, panels(1, 1, 3.0, 2.0, dpi=85)[0].dpi, panels(1, 1, 3.0, 2.0, "of it")[0].dpi) == (
        110,
        85,
        110,
    )


def test_what_stands_outside_the_marks_of_a_page_stays(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<begin>\nold\n<end>\nafter\n")
    replace_between(page, "<begin>", "<end>", "new\n")
    assert page.read_text() == "before\n<begin>\nnew\n<end>\nafter\n"
    with pytest.raises(BadInput, match=r"has no place for the tables, allowed: a page with <a> and <b>"):
        replace_between(page, "<a>", "<b>", "new")


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


def test_each_part_has_its_markdown():
    parts = [
        "A sentence.", Heading("Heading"), Table(("a", "b"), [("1", "2|3")]),
        Bullets("Lead:", ["one", "two"]), Pictures([("First", "one"), ("Second", "two")]),
    ]  # fmt: skip
    assert as_markdown(parts, "figures").split("\n\n") == [
        "A sentence.", "## Heading", "| a | b |\n| --- | --- |\n| 1 | 2\\|3 |", "Lead:", "- one\n- two",
        "![First](figures/one.png)", "![Second](figures/two.png)\n",
    ]  # fmt: skip


def test_csv_has_a_header_and_nothing_for_none():
    assert as_csv([{"a": 1, "b": None}, {"a": "x,y", "b": 2.5}]) == 'a,b\n1,\n"x,y",2.5\n'
