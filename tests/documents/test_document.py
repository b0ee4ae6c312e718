"""YAML text to plain data: values as people read them, lines, and a hostile text stopped."""

import math

import pytest

from beaver_ftc.documents.document import MAX_DEPTH, MalformedDocumentError, parse, scalar


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("45", 45),
        ("-3", -3),
        ("1_000", 1000),
        ("1e-3", 0.001),  # YAML 1.1 calls this text
        ("1e3", 1000.0),
        ("2.5E+4", 25000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("true", True),
        ("no", False),
        ("Off", False),
        ("~", None),
        ("null", None),
        ("1e999", math.inf),
        ("9" * 401, "9" * 401),
        ("-" + "9" * 399, -int("9" * 399)),
        ("1_.5_0e1", 15.0),
        ("-.inf", -math.inf),
        ("12:30", "12:30"),  # 750 in YAML 1.1
        ("012", "012"),  # 10 in YAML 1.1, 12 in 1.2
        ("0x1F", "0x1F"),
        ("2005-06-27", "2005-06-27"),
        ("45 m/s", "45 m/s"),
        ("e3", "e3"),
        (".", "."),
        ("1_", 1),
        ("nan", "nan"),
    ],
)
def test_plain_scalars(text, value):
    read = scalar(text)
    assert read == value
    assert type(read) is type(value)


def test_lines_of_keys_and_values():
    document = parse("a: 1\nb:\n  - x\n  - {c: 2,\n     d: 3}\n")
    assert document.data == {"a": 1, "b": ["x", {"c": 2, "d": 3}]}
    assert [document.line(at) for at in [("a",), ("b",), ("b", 1), ("b", 1, "c"), ("b", 1, "d")]] == [
        1,
        2,
        4,
        4,
        5,
    ]


def test_every_duplicate_key_is_a_problem_and_the_first_value_stays():
    document = parse("a: 1\nb: {c: 1, c: 2}\na: [3]\n")
    assert document.data == {"a": 1, "b": {"c": 1}}
    assert [(p.line, p.location) for p in document.problems] == [(2, ("b", "c")), (3, ("a",))]
    assert "first on line 1" in document.problems[1].says


def test_an_alias_stands_for_its_anchor():
    assert parse("a: &s {x: 1}\nb: *s\nc: [*s]\n").data == {"a": {"x": 1}, "b": {"x": 1}, "c": [{"x": 1}]}


def bomb(levels: int, width: int) -> str:
    lines = ["l0: &l0 [x]"] + [f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * width)}]" for i in range(1, levels)]
    return "\n".join(lines)


MALFORMED = {
    "alias bomb": (bomb(12, 10), "too many values"),
    "wide alias bomb": ("a: &a [" + "x, " * 2000 + "]\nb: [" + "*a, " * 2000 + "]", "too many values"),
    "alias of itself": ("a: &a [*a]", "no complete anchor"),
    "unknown alias": ("a: *b", "alias"),
    "tag": ("a: !!python/object/apply:os.system ['true']", "is not read"),
    "local tag": ("a: !x 1", "is not read"),
    "merge key": ("a: &a {x: 1}\nb: {<<: *a}", "merge keys"),
    "two documents": ("a: 1\n---\nb: 2", "second document"),
    "two numbers": ("1\n---\n2", "second document"),
    "key that is a list": ("? [a, b]\n: 1", "not plain text"),
    "tab": ("a:\n\t- 1", "tab"),
    "open bracket": ("a: [1, 2", "is not YAML"),
    "control character": ("a: \x01", "is not YAML"),
    "deep by aliases": (
        "\n".join(["a0: &a0 [1]"] + [f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 900)]),
        "too deeply",
    ),
    "deep lists": ("[" * 100_000, "nested too deeply"),
    "deep mappings": ("{a: " * 100_000, "nested too deeply"),
    "deep blocks": ("\n".join(" " * i + "a:" for i in range(500)), "nested too deeply"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_what_is_no_document_is_one_problem(case):
    text, says = MALFORMED[case]
    with pytest.raises(MalformedDocumentError) as caught:
        parse(text)
    assert says in caught.value.problem.says
    assert "allowed:" in caught.value.problem.says


def test_nesting_up_to_the_limit_is_read():
    assert parse("[" * MAX_DEPTH + "]" * MAX_DEPTH).problems == []
    with pytest.raises(MalformedDocumentError):
        parse("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1))


@pytest.mark.parametrize(
    ("text", "line"), [("a: 1\nb: 'x\nc: 2\n", 4), ("a: 1\n b: 2", 2), ("a: 1\nb: \x02", 2)]
)
def test_the_line_of_a_syntax_error(text, line):
    with pytest.raises(MalformedDocumentError) as caught:
        parse(text)
    assert caught.value.problem.line == line


def test_an_alias_is_as_deep_as_what_it_stands_for():
    whole = "[" * 20 + "]" * 20
    for around, is_read in ((11, True), (12, False)):
        text = f"a: &a {whole}\nb: {'[' * around}*a{']' * around}"
        if is_read:
            assert parse(text).data["a"] is not None
        else:
            with pytest.raises(MalformedDocumentError, match="nested too deeply, allowed: 32 levels"):
                parse(text)
