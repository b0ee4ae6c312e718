"""Files that strangers name, folders that code is run from, and keys of scenarios: each at its bounds."""

import hashlib
import os
from pathlib import Path

import pytest

from beaver_ftc.documents import document, files
from beaver_ftc.documents.document import MAX_NODES, MalformedDocumentError, parse, scalar
from beaver_ftc.documents.files import UnreadableError, put_folder, read_bytes, read_text
from beaver_ftc.documents.validation import UnusableKeyError, parse_key, plain, with_values


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


def test_a_text_of_the_largest_size_is_read_without_its_mark(tmp_path):
    (tmp_path / "f").write_bytes(b"\xef\xbb\xbfabc")
    assert read_text(tmp_path / "f", 6) == "abc"
    assert read_bytes(tmp_path / "f", 6) == b"\xef\xbb\xbfabc"


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


def test_a_file_that_grows_while_it_is_read_is_too_large(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_check_kind_and_size", lambda status, most: None)  # as it was when looked at
    (tmp_path / "f").write_text("ab")
    assert read_bytes(tmp_path / "f", 2) == b"ab"
    with pytest.raises(UnreadableError, match=r"^is too large, allowed: at most 1e-06 MB$"):
        read_bytes(tmp_path / "f", 1)


@pytest.mark.parametrize(
    ("mode", "sticky_base", "is_ours"),
    [
        (0o700, False, True),
        (0o755, False, True),
        (0o720, False, False),
        (0o702, False, False),
        (0o1777, True, True),
    ],
)
def test_a_folder_that_others_can_write_is_refused_and_said_once(
    tmp_path, monkeypatch, capsys, mode, sticky_base, is_ours
):
    monkeypatch.delenv(files._REFUSED, raising=False)
    folder = tmp_path / "code"
    folder.mkdir()
    folder.chmod(mode)
    for _ in range(2):
        assert files._is_ours(folder, base=sticky_base) is is_ours
    lines = capsys.readouterr().err.splitlines()
    assert lines == ([] if is_ours else [
        f"beaver-ftc: no compiled code is run from {folder}: its mode is 0{mode:o}, allowed: a folder of "
        "your own that neither group nor others can write (chmod go-w)"
    ])  # fmt: skip
    assert (str(folder) in os.environ.get(files._REFUSED, "")) is not is_ours


def test_links_are_followed_to_a_base_alone(tmp_path, monkeypatch):
    monkeypatch.delenv(files._REFUSED, raising=False)
    (tmp_path / "true").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(tmp_path / "true")
    assert files._is_ours(tmp_path / "link", base=True)
    assert not files._is_ours(tmp_path / "link")
    (tmp_path / "file").write_text("")
    assert not files._is_ours(tmp_path / "file" / "below")
    assert files._is_ours(tmp_path / "made" / "anew")
    assert (tmp_path / "made" / "anew").stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="where there are users")
@pytest.mark.parametrize("base", [True, False])
def test_a_folder_of_another_user_is_refused_by_that_users_number(tmp_path, monkeypatch, capsys, base):
    monkeypatch.delenv(files._REFUSED, raising=False)
    other = os.getuid() + 1
    monkeypatch.setattr(files, "_user", lambda: other)
    monkeypatch.setattr(files, "_ROOT", other)
    tmp_path.chmod(0o755)
    assert not files._is_ours(tmp_path, base=base)
    assert f"from {tmp_path}: it belongs to user {os.getuid()}, allowed: " in capsys.readouterr().err


def test_where_code_is_kept(tmp_path, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setattr(files.tempfile, "gettempdir", lambda: str(tmp_path))
    last = tmp_path / f"beaver-ftc-{os.getuid()}"
    assert list(files._candidates()) == [
        tmp_path / "NUMBA_CACHE_DIR",
        tmp_path / "XDG_CACHE_HOME" / "beaver-ftc",
        last,
    ]
    assert files.cache_base() == tmp_path / "NUMBA_CACHE_DIR"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert next(files._candidates()) == tmp_path / "home" / ".cache" / "beaver-ftc"


def test_the_latest_versions_of_code_are_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    versions = [f"{i:016x}" for i in range(7)]
    for i, version in enumerate(versions):
        (tmp_path / version).mkdir()
        os.utime(tmp_path / version, (i, i))
    (tmp_path / "other").mkdir()
    assert files.cache_of_version(versions[0]) == tmp_path / versions[0]  # it is there: nothing goes
    assert len(list(tmp_path.iterdir())) == 8
    assert files.cache_of_version("f" * 16) == tmp_path / ("f" * 16)
    assert sorted(path.name for path in tmp_path.iterdir()) == [*versions[2:], "f" * 16, "other"]


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


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("a[2]", "the base has no a[2], allowed: [0] to [1]"),
        ("a.b", "the base has no a.b, allowed: [0] to [1]"),
        ("a[2].b", "the base has no a[2], allowed: [0] to [1]"),
        ("e[0]", "the base has no e[0], allowed: no index, the list is empty"),
        ("a[1].b", "a[1] is a single value, allowed: to vary it as a whole"),
        ("a[0].b.c", "a[0].b is a single value, allowed: to vary it as a whole"),
        ("f[0]", "f has no such part, allowed: a key of the base"),
        ("f[0].g", "f[0] is not there, allowed: a key of the base"),
    ],
)
def test_a_place_that_there_is_not(key, says):
    with pytest.raises(UnusableKeyError) as caught:
        with_values(DATA, {parse_key(key): 9})
    assert str(caught.value) == says


@pytest.mark.parametrize("key", ["a[1234567]", "a.", ".a", "a[0]b", 3, "a]"])
def test_what_is_no_key(key):
    with pytest.raises(UnusableKeyError, match="is no dotted key"):
        parse_key(key)


def test_plain_values():
    import numpy as np

    given = {"a": np.arange(2), "b": (np.float64(1.5), [np.bool_(True)]), "c": Path("x"), "d": None}
    assert plain(given) == {"a": [0, 1], "b": [1.5, [True]], "c": "x", "d": None}
    assert type(plain(given)["a"][0]) is int


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1" * 400, int("1" * 400)),
        ("1" * 401, "1" * 401),
        ("-0", 0),
        ("00", "00"),
        ("+1_0", 10),
        ("0.5e-1", 0.05),
        ("1e", "1e"),
        (".inf", float("inf")),
        ("+.INF", float("inf")),
        ("-.Inf", float("-inf")),
        ("On", True),
        ("NO", False),
    ],
)
def test_scalars_at_their_bounds(text, value):
    assert scalar(text) == value
    assert type(scalar(text)) is type(value)


def test_as_many_values_as_there_may_be(monkeypatch):
    monkeypatch.setattr(document, "MAX_NODES", 6)
    assert parse("[1, 2, 3, 4, 5]").data == [1, 2, 3, 4, 5]
    assert parse("a: &a [1]\nb: 3").data == {"a": [1], "b": 3}
    for text in ("[1, 2, 3, 4, 5, 6]", "{a: 1, b: 2, c: 3}", "a: &a [1]\nb: *a"):
        with pytest.raises(MalformedDocumentError, match="too many values, allowed: at most 6"):
            parse(text)
    assert MAX_NODES == 400_000


@pytest.mark.parametrize(
    ("text", "line", "location", "says"),
    [
        (
            "a: 1\nb: [x, *y]",
            2,
            ("b", 1),
            "alias *y has no complete anchor before it, allowed: the value itself",
        ),
        ("a:\n  b: !t 1", 2, ("a", "b"), "tag !t is not read, allowed: plain values"),
        ("a:\n  <<: 1", 2, ("a",), "merge keys are not read, allowed: the keys themselves"),
        ("a:\n  ? [1]\n  : 2", 2, ("a",), "a key is not plain text, allowed: key: value"),
        ("a: 1\n---\nb: 1", 2, (), "a second document starts here, allowed: one a file"),
    ],
)
def test_where_what_stops_the_reading_is(text, line, location, says):
    with pytest.raises(MalformedDocumentError) as caught:
        parse(text)
    problem = caught.value.problem
    assert (problem.line, problem.location, problem.says) == (line, location, says)


def test_an_alias_is_as_deep_as_what_it_stands_for():
    whole = "[" * 20 + "]" * 20
    for around, is_read in ((11, True), (12, False)):
        text = f"a: &a {whole}\nb: {'[' * around}*a{']' * around}"
        if is_read:
            assert parse(text).data["a"] is not None
        else:
            with pytest.raises(MalformedDocumentError, match="nested too deeply, allowed: 32 levels"):
                parse(text)


def test_duplicates_are_told_with_their_first_line_and_read_past():
    found = parse("a:\n  b: 1\n  c: 2\n  b: {d: [1]}\n  b: 3\ne: 4\n")
    assert found.data == {"a": {"b": 1, "c": 2}, "e": 4}
    assert [(each.line, each.location, each.says) for each in found.problems] == [
        (line, ("a", "b"), "duplicate key, first on line 2, allowed: each key once") for line in (4, 5)
    ]
    many = parse("a: 1\n" * 102)
    assert len(many.problems) == 100


def test_files_of_the_package_are_named_by_their_names_and_contents(tmp_path):
    """And by their order; a byte that moves from one file to the next is another name."""
    made = {}
    for folder, contents in enumerate([("ab", "c"), ("a", "bc"), ("ab", "c")]):
        (tmp_path / str(folder)).mkdir()
        made[folder] = [tmp_path / str(folder) / name for name in ("one.py", "two.py")]
        for file, content in zip(made[folder], contents, strict=True):
            file.write_text(content)
    names = [files.digest_of_files(*made[folder]) for folder in made]
    assert names[0] == names[2] != names[1]
    assert names[0] == hashlib.sha256(b"one.py 2 abtwo.py 1 c").hexdigest()[:16]
    assert files.digest_of_files(*reversed(made[0])) != names[0]


def test_code_that_another_user_can_write_is_not_read(tmp_path):
    file = tmp_path / "code"
    file.write_bytes(b"code")
    for mode, why in ((0o600, ""), (0o644, ""), (0o620, "its mode is 0620"), (0o602, "its mode is 0602")):
        file.chmod(mode)
        assert files.read_own(file) == (b"" if why else b"code", why)
    (tmp_path / "link").symlink_to(file)
    with pytest.raises(OSError, match="link"):
        files.read_own(tmp_path / "link")


def test_data_lie_in_the_package_where_it_is_installed(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "PACKAGE", tmp_path / "root" / "src" / "beaver_ftc")
    monkeypatch.setattr(files, "_INSTALLED", tmp_path / "data")
    assert files.data_root() == tmp_path / "root"
    (tmp_path / "data").mkdir()
    assert files.data_root() == tmp_path / "data"


@pytest.mark.parametrize(
    ("user", "group", "mode", "says"),
    [
        (0, 1, 0o700, ""), (1, 0, 0o700, "it belongs to user {}"), (0, 0, 0o770, "its mode is 0770"),
        (0, 1, 0o702, "its mode is 0702"), (0, 0, 0o755, ""), (1, 1, 0o722, "it belongs to user {}"),
    ],
)  # fmt: skip
def test_the_owner_decides_who_else_can_write_and_not_the_group(user, group, mode, says):
    """0: that of this process, 1: another."""
    own = os.getuid()
    status = os.stat_result((mode, 0, 0, 1, own + 17 * user, os.getgid() + 5 * group, 0, 0, 0, 0))
    assert files._other_writer(status) == says.format(own + 17)


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


def test_the_folder_of_a_quicker_process_stays(tmp_path, monkeypatch):
    """It appears after what was there is removed."""
    target = tmp_path / "pa28"
    monkeypatch.setattr("shutil.rmtree", lambda folder, **_: put_by_another(target, folder))
    assert put(tmp_path / "a", target, "<engine/>", "mine")[1] == "another's"


def put_by_another(target, folder):
    if folder == target:
        (target / "engines").mkdir(parents=True)
        (target / "engines" / "one.xml").write_text("<engine/>")
        (target / "page.md").write_text("another's")


def test_a_folder_that_cannot_be_put_is_said(tmp_path, monkeypatch):
    (tmp_path / "pa28").write_text("a file")
    with pytest.raises(OSError, match="Not a directory"):
        put(tmp_path / "a", tmp_path / "pa28", "<engine/>", "")
    assert [one.name for one in tmp_path.iterdir()] == ["pa28"]
