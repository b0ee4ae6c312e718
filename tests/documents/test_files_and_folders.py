"""Files that strangers name, folders that code is run from, and keys of scenarios: each at its bounds."""

import os

import pytest

from beaver_ftc.documents import files
from beaver_ftc.documents.dotted import parse_key, with_values
from beaver_ftc.documents.files import UnreadableError, put_folder, read_bytes, read_text


@pytest.mark.parametrize(
    ("data", "most", "says", "line"),
    [
        (b"a\nb\0", 9, "is a binary file, allowed: UTF-8 text", 2),
        (b"a\n\n\xff\n", 9, "byte 0xff is not UTF-8, allowed: UTF-8 text", 3),
        (b"abcd", 3, "is too large (4e-06 MB), allowed: at most 3e-06 MB", 0),
    ],
)
def test_what_is_no_text(tmp_path, data, most, says, line):
    (tmp_path / "f").write_bytes(data)
    with pytest.raises(UnreadableError) as caught:
        read_text(tmp_path / "f", most)
    assert (str(caught.value), caught.value.line) == (says, line)


@pytest.mark.parametrize(
    ("file", "says"),
    [
        ("none", "no such file, allowed: the path of a text file"),
        (".", "is a folder, allowed: a text file"),
        ("pipe", "is a pipe or a device, allowed: a regular text file"),
        ("n" * 300, "cannot be read (file name too long), allowed: a readable text file"),
        ("a\0b", "cannot be read (embedded null byte), allowed: a readable text file"),
    ],
)
def test_what_is_no_file(tmp_path, file, says):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UnreadableError) as caught:
        read_bytes(f"{tmp_path}/{file}", 9)
    assert str(caught.value) == says


@pytest.fixture
def base(tmp_path, monkeypatch):
    """The folder that the user has chosen for compiled code."""
    monkeypatch.delenv("BEAVER_FTC_REFUSED", raising=False)
    (tmp_path / "base").mkdir(mode=0o700)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "base"))
    return tmp_path / "base"


@pytest.mark.parametrize(("mode", "is_ours"), [(0o700, True), (0o755, True), (0o720, False), (0o702, False)])
def test_a_folder_that_others_can_write_is_refused_and_said_once(base, capsys, mode, is_ours):
    folder = base / "code"
    folder.mkdir()
    folder.chmod(mode)
    for _ in range(2):
        assert (files.cache_of_version("code") == folder) is is_ours
    lines = capsys.readouterr().err.splitlines()
    assert lines == ([] if is_ours else [
        f"beaver-ftc: no compiled code is run from {folder}: its mode is 0{mode:o}, allowed: a folder of "
        "your own that neither group nor others can write (chmod go-w)"
    ])  # fmt: skip
    assert (str(folder) in os.environ.get("BEAVER_FTC_REFUSED", "")) is not is_ours


def test_links_are_followed_to_a_base_alone(base, tmp_path, monkeypatch):
    assert files.cache_of_version("new") == base / "new"
    assert (base / "new").stat().st_mode & 0o777 == 0o700
    (base / "link").symlink_to(base / "new")
    assert files.cache_of_version("link") != base / "link"
    base.chmod(0o1777)
    assert files.cache_base() == base
    (tmp_path / "link").symlink_to(base)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "link"))
    assert files.cache_base() == tmp_path / "link"
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert files.cache_base() != tmp_path / "file" / "below"


@pytest.mark.parametrize(
    ("file", "place"),
    [
        ("a", "a"),
        ("b/c", "b/c"),
        ("b", "b"),
        ("..", None),
        ("b/../a", None),
        ("/etc/a", None),
        ("up", None),
        ("up/a", None),
        ("a\0b", None),
    ],
)
def test_files_inside_a_folder(tmp_path, file, place):
    folder = tmp_path / "in"
    (folder / "b").mkdir(parents=True)
    (folder / "up").symlink_to(tmp_path)
    assert files.inside(folder, file) == (None if place is None else folder.resolve() / place)
    assert files.inside(folder, str(folder / "a")) is None


DATA = {"a": [{"b": 1}, 2], "c": "ideal", "d": None, "e": [], "f": {"g": {}}}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("a[0].b", {"a": [{"b": 9}, 2]}),
        ("a[1]", {"a": [{"b": 1}, 9]}),
        ("c.x", {"c": {"x": 9}}),
        ("d.x.y", {"d": {"x": {"y": 9}}}),
        ("f.g", {"f": {"g": 9}}),
        ("f.g.h", {"f": {"g": {"h": 9}}}),
        ("new.x", {"new": {"x": 9}}),
        ("a", {"a": 9}),
    ],
)
def test_a_value_is_put_in_its_place(key, value):
    before = str(DATA)
    assert with_values(DATA, {parse_key(key): 9}) == {**DATA, **value}
    assert str(DATA) == before


def test_code_that_another_user_can_write_is_not_read(tmp_path):
    file = tmp_path / "code"
    file.write_bytes(b"code")
    for mode, why in ((0o600, ""), (0o644, ""), (0o620, "its mode is 0620"), (0o602, "its mode is 0602")):
        file.chmod(mode)
        assert files.read_own(file) == (b"" if why else b"code", why)
    (tmp_path / "link").symlink_to(file)
    with pytest.raises(OSError, match="link"):
        files.read_own(tmp_path / "link")


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "{", "", "\x00"])
def test_a_damaged_document_is_a_value_error_however_deep(tmp_path, text):
    (tmp_path / "f").write_text(text)
    with pytest.raises(ValueError, match=r"nested|Expecting"):
        files.read_json(tmp_path / "f")


def put(folder, target, text, page):
    (folder / "engines").mkdir(parents=True)
    (folder / "engines" / "one.xml").write_text(text)
    (folder / "page.md").write_text(page)
    put_folder(folder, target, compare_all_but="page.md")
    return (target / "engines" / "one.xml").stat().st_ino, (target / "page.md").read_text()


def test_a_folder_takes_the_place_of_another_unless_it_is_the_same(tmp_path):
    target = tmp_path / "cache" / "pa28"
    first, page = put(tmp_path / "a", target, "<engine/>", "in 3 s")
    assert put(tmp_path / "b", target, "<engine/>", "in 4 s") == (first, page)  # another process reads it
    assert put(tmp_path / "c", target, "<engine2/>", "in 5 s")[1] == "in 5 s"
    assert (target / "engines" / "one.xml").read_text() == "<engine2/>"
    assert [one.name for one in target.parent.iterdir()] == ["pa28"]
