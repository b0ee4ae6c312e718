"""What a mistake is called: what is wrong, and what is allowed as the schema has it."""

import pickle
from typing import Annotated, Any, Literal

import pytest
from pydantic import Discriminator, Field, Tag

from beaver_ftc.documents import validation
from beaver_ftc.documents.document import (
    MAX_PROBLEMS,
    Document,
    Flag,
    Number,
    Problem,
    Section,
    Whole,
    entry,
    number,
    order_conflicts,
)
from beaver_ftc.documents.errors import nearest, suggestion
from beaver_ftc.documents.files import AbsentFileError
from beaver_ftc.documents.validation import ScenarioError, key_path, one_line, parse_document, validate


class Ant(Section):
    """One kind of animal."""

    type: Literal["ant"]
    legs: Whole = 6
    sting: Flag = False


class Bee(Section):
    """Another, whose legs are fewer."""

    type: Literal["bee", "bumblebee"]
    legs: Number = Field(4, ge=0)


class Gauge(Section):
    """What is told from animals by its sensor."""

    sensor: str
    type: Literal["dial"]


class Digit(Section):
    """Another of these."""

    sensor: str
    type: Literal["digit"]
    width: Number = 1.0


def _kind(given: Any) -> str:
    return "(sensor)" if isinstance(given, dict) and "sensor" in given else "(surface)"


class Zoo(Section):
    """Every shape that a key of ours may have."""

    closed: Number = number(1.0, "m", "height", ge=0, le=2.5)
    open: Number = number(1.0, "m", "height", gt=0, lt=2.5)
    half: Number = number(1.0, "m", "height", ge=-1.5, lt=3)
    other_half: Number = number(1.0, "m", "height", gt=0, le=3e7)
    least: Number = Field(1.0, ge=2)
    over: Number = Field(1.0, gt=2)
    most: Whole = Field(1, le=2)
    large: Whole = Field(1, ge=0, le=2**63 - 1)
    plain: Number | None = None
    flag: Flag = True
    word: str = Field("x", min_length=1, max_length=3)
    name: str = Field("x", pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=60)
    file: str = Field("x.xml", pattern=r"^[A-Za-z0-9_-][A-Za-z0-9_.-]*\.xml$")
    nothing_else: str = Field("x", pattern=r"^x$")
    pair: tuple[Number, Number] = (0.0, 1.0)
    few: tuple[Number, ...] = Field((1.0, 2.0), min_length=2, max_length=4)
    some: tuple[Number, ...] = Field((1.0,), max_length=4)
    many: tuple[Number, ...] = ()
    names: dict[str, Annotated[Number, Field(ge=0, le=1)]] = Field({}, max_length=2)
    by_pattern: dict[Annotated[str, Field(pattern="^a")], Annotated[Number, Field(le=9)]] = entry(
        dict, "limits"
    )
    either: Annotated[float, Field(ge=0, le=0.9)] | dict[str, Annotated[float, Field(le=0.8)]] = 0.0
    choice: Literal["first", "second", 3] = "first"
    only: Literal["this"] = "this"
    animal: Annotated[Ant | Bee, Field(discriminator="type")] | None = None
    broken: tuple[
        Annotated[
            Annotated[Annotated[Ant | Bee, Field(discriminator="type")], Tag("(surface)")]
            | Annotated[Annotated[Gauge | Digit, Field(discriminator="type")], Tag("(sensor)")],
            Discriminator(_kind),
        ],
        ...,
    ] = ()
    inner: Ant | None = None
    required: Number = entry(..., "what must be said")


WRONG = [
    *(f"{key}: {value}" for key in ("closed", "open", "half", "other_half") for value in (-2, 9e9)),
    "least: 1", "over: 2", "most: 3", "large: -1", "large: 9223372036854775808", "plain: x",
    "flag: 1", "flag: 'yes'", "word: ''", "word: abcd", "word: 3", "name: 9", f"name: {'n' * 61}",
    "file: x.txt", "nothing_else: y", "pair: [1]", "pair: [1, 2, 3]", "pair: {a: 1}", "pair: 3",
    "few: [1]",
    "few: [1, 2, 3, 4, x]", "few: [1, 2, 3, 4, 5]", "some: [1, 2, 3, 4, 5]", "some: {a: 1}",
    "many: [x, 1, y]", "many: [[1]]", "many: 2", "names: {a: 1, b: 2}", "names: {a: 1, b: 1, c: 1}",
    "names: 3", "names: {a: {b: 1}}",
    "by_pattern: {ab: 10}", "either: 3", "either: {a: 3, b: 0.1}", "either: {a: x}",
    "either: [1]", "either: x",
    "choice: frist", "choice: 4", "choice: false",
    "choice: null", "only: that", "only:", "animal: {type: bea}", "animal: {tpye: bee}", "animal: {typ: bee}",
    "animal: {legs: 3}", "animal: 3", "animal: {type: 3}", "animal: {type: bee, legs: -1}", "animal: {1: 2}",
    "animal: {type: ant, legs: 2.5, wings: 2}", "animal: {type: bee, leg: 3, wings: 2, sting: true}",
    "broken: [{type: ant, sting: 1}, {type: bumblebee, sting: 1}]", "broken: [{sensor: p, type: dail}]",
    "broken: [{sensor: p, type: digit, width: w}, {sensor: p}, {sensor: p, type: dial, width: 1}]",
    "broken: [{type: digit}, {type: dial, sensor: 3}, 7]", "broken: {type: ant}",
    "inner: {type: ant, legs: 1, legs: 2}", "inner: {}", "inner: 7", "inner: {type: ant, sting: maybe}",
    "requird: 3", "required: 1\nrequired: 2", f"'{'k' * 60}': 1", "'': 1", "'a b\\n': 1", "plain: .inf",
    f"plain: {'9' * 15}x", f"most: {10**15}", f"most: {10**15 - 1}", f"plain: {'t' * 60}",
    "plain: [1]", "plain: yes",
    "closd: 1\nopne: 2\nclosed: 9", "inner: {type: ent, leg: x, stin: 3}", "inner: {tpe: ant, legs: x}",
]  # fmt: skip


def test_what_each_mistake_is_called(changed):
    found = {}
    for text in WRONG:
        with pytest.raises(ScenarioError) as caught:
            validate(Zoo, parse_document(f"required: 5\n{text}", "f"), "f")
        found[text] = [line[:200] for line in caught.value.lines]
    assert not changed(found)


def test_a_key_that_is_missing_is_at_the_line_of_what_is_around_it():
    with pytest.raises(ScenarioError) as caught:
        validate(Zoo, parse_document("\n\nplain: 3\n", "f"), "f")
    assert caught.value.lines == ("f:3: required: required key is missing, allowed: a number",)
    assert caught.value.problems == (Problem(3, ("required",), "required key is missing, allowed: a number"),)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.lines, again.source, again.exit_code) == (caught.value.lines, "f", 2)


@pytest.mark.parametrize(("source", "begins"), [("", "a.b: x"), ("f\n.yaml", "f\\n.yaml:3: a.b: x")])
def test_a_line_begins_with_its_file_if_there_is_one(source, begins):
    assert str(ScenarioError(source, [Problem(3, ("a", "b"), "x")])) == begins


@pytest.mark.parametrize("number", [MAX_PROBLEMS, MAX_PROBLEMS + 1])
def test_after_a_hundred_mistakes_there_is_a_word_that_there_are_more(number):
    problems = [Problem(line, ("a", line), "x") for line in (*range(number, 0, -1), 5)]  # one of them twice
    found = ScenarioError("f", problems).problems
    assert found[:MAX_PROBLEMS] == tuple(Problem(i, ("a", i), "x") for i in range(1, MAX_PROBLEMS + 1))
    says = "has more than 100 mistakes, allowed: none"
    assert found[MAX_PROBLEMS:] == ((Problem(101, (), says),) if number > MAX_PROBLEMS else ())


@pytest.mark.parametrize(
    ("text", "longest", "shown"),
    [
        ("abc", 3, "abc"),
        ("abcd", 3, "abc..."),
        ("a\tb\x1b", 9, "a\\tb\\x1b"),
        ("ü\n", 2, "ü\\n"),
        ("", 0, ""),
    ],
)
def test_text_for_a_line(text, longest, shown):
    assert one_line(text, longest) == shown


@pytest.mark.parametrize(
    ("location", "path"),
    [
        (("faults", 0, "at_s"), "faults[0].at_s"), ((), "(file)"), ((0, 1), "[0][1]"),
        (("", "a"), "(empty).a"),
        (("k" * 49,), "k" * 48 + "..."), (("k" * 48,), "k" * 48),
    ],
)  # fmt: skip
def test_places_in_words(location, path):
    assert key_path(location) == path


def test_words_are_bounded():
    (line,) = ScenarioError("f", [Problem(1, (), "y" * 2001)]).lines
    assert line == f"f:1: (file): {'y' * 2000}..."
    (line,) = ScenarioError("f" * 4097, [Problem(1, (), "y")]).lines
    assert line == f"{'f' * 4096}...:1: (file): y"


NAMES = ("aileron", "elevator", "rudder", "Flap", "flap-tab", "flap")


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("elevater", "elevator"), ("FLAP", "Flap"), ("fla", "Flap"), ("rud", "rudder"), ("ru", None),
        ("tail", None),
        ("el", None), ("ailron" + "x" * 100, None), ("flap-ta", "flap-tab"), ("", None), ("ail", "aileron"),
    ],
)  # fmt: skip
def test_what_was_meant(given, meant):
    assert nearest(given, NAMES) == meant
    hint = f", did you mean {meant}?" if meant else ","
    assert suggestion(given, NAMES) == f"{hint} allowed: {', '.join(NAMES)}"


@pytest.mark.parametrize(
    ("given", "cutoff", "meant"), [("abxy", 0.5, "abcd"), ("abxy", 0.6, None), ("axyz", 0.5, None)]
)
def test_how_near_is_near(given, cutoff, meant):
    assert nearest(given, ["abcd"], cutoff) == meant


def test_of_two_that_are_as_near_the_first_is_meant_and_none_of_none():
    assert nearest("cat", ["bat", "hat"]) == "bat"
    assert nearest("cat", []) is None
    assert nearest("a" * 100 + "zzzz", ["a" * 100]) == "a" * 100  # no more than a hundred letters are read


def test_contradictions_beside_mistakes_are_told_once():
    def conflicts(data):
        yield ("closed",), "against half"
        yield ("open",), "against least"

    document = parse_document("required: 1\nopen: 1\nclosed: 9\n", "f")
    with pytest.raises(ScenarioError) as caught:
        validate(Zoo, document, "f", None, conflicts)
    assert caught.value.lines == (
        "f:2: open: against least",
        "f:3: closed: 9 is out of range, allowed: a number from 0 to 2.5 (height, m)",
    )
    assert validate(Zoo, Document({"required": 1}), "f", None, conflicts).required == 1


@pytest.mark.parametrize(("end", "says"), [
    (None, []), (2.5, []), (2.0, [(("end_s",), "2 is not after start, allowed: later than 2 s")]),
    (1.5, [(("end_s",), "1.5 is not after start, allowed: later than 2 s")]),
])  # fmt: skip
def test_an_end_comes_after_its_start(end, says):
    assert order_conflicts(2.0, end, "start") == says


@pytest.mark.parametrize(("text", "says"), [
    ("", "f:1: (file): is empty, allowed: a mapping with the keys of `beaver-ftc schema`"),
    ("\n\n- 1\n", "f:3: (file): is not a mapping, allowed: a mapping with the keys of `beaver-ftc schema`"),
    ("a: [", "f:2: (file): is not YAML: while parsing a flow node: did not find expected node content, "
             "allowed: one YAML mapping indented with spaces"),
])  # fmt: skip
def test_a_text_without_a_mapping(text, says):
    with pytest.raises(ScenarioError) as caught:
        parse_document(text, "f")
    assert caught.value.lines == (says,)


def test_files_of_models(tmp_path):
    file = tmp_path / "zoo.yaml"
    file.write_text("required: 3")
    assert validation.read_file(Zoo, file, 11).required == 3
    with pytest.raises(ScenarioError, match=r"zoo.yaml: is too large"):
        validation.read_file(Zoo, file, 10)
    file.write_text("required: 3\n\n\nrequired: 4\nplain: x")
    with pytest.raises(ScenarioError) as caught:
        validation.read_file(Zoo, file, 99)
    assert [problem.line for problem in caught.value.problems] == [4, 5]
    assert validation.text_of(file, 99) == file.read_text()
    with pytest.raises(ScenarioError, match="no such file, allowed"):
        validation.text_of(tmp_path / "none", 99)
    with pytest.raises(ScenarioError, match=": there is none"):
        validation.text_of(tmp_path / "none", 99, lambda: "there is none")
    with pytest.raises(ScenarioError, match="is a folder"):
        validation.text_of(tmp_path, 99, lambda: "there is none")


class Matrix(Section):
    """Rows of numbers."""

    rows: list[list[Annotated[float, Field(le=9)]]]
    names: dict[str, Annotated[list[Annotated[float, Field(le=7)]], Field(min_length=1)]]


def test_many_numbers_of_a_matrix_that_are_wrong_alike_share_a_line():
    """From three on; those of another list or of another line have their own."""
    text = "rows: [[99, 1, 98], [97]]\nnames: {a: [8, 9], b: [],\n  c: [11]}\n"
    with pytest.raises(ScenarioError) as caught:
        validate(Matrix, parse_document(text, "f"), "f")
    assert caught.value.lines == (
        "f:1: rows[0][0]: 99 is out of range, allowed: a number of at most 9 (and 2 more of this list)",
        "f:2: names.a[0]: 8 is out of range, allowed: a number of at most 7",
        "f:2: names.a[1]: 9 is out of range, allowed: a number of at most 7",
        "f:2: names.b: this is empty, allowed: a list that is not empty",
        "f:3: names.c[0]: 11 is out of range, allowed: a number of at most 7",
    )
    assert len(caught.value.problems) == 7


class Shares(Section):
    """Values of one kind under names: each has a unit, none a description of its own."""

    of: dict[str, Annotated[float, Field(le=1, json_schema_extra={"unit": "share of 1"})]]


def test_a_value_with_a_unit_and_no_description():
    with pytest.raises(ScenarioError) as error:
        validate(Shares, Document({"of": {"all": None}}), "s.yaml")
    assert str(error.value) == "s.yaml:1: of.all: has no value, allowed: a number of at most 1"


@pytest.mark.parametrize(
    ("given", "meant"), [("fil", "filtered_elevator"), ("FIL", "filtered_elevator"), ("fi", None)]
)
def test_three_letters_are_a_beginning_and_two_are_none(given, meant):
    assert nearest(given, ["rudder", "filtered_elevator"]) == meant


MISTAKES = """
closd: 2.0
names: {}
animal: {type: bea, legz: 3, sting: 1}
choice: thrid
"""


def _repairs(text):
    with pytest.raises(ScenarioError) as caught:
        validate(Zoo, parse_document(text, "zoo.yaml"), "zoo.yaml")
    return [(one.line, one.location, one.unknown_key, one.meant) for one in caught.value.problems]


def test_nothing_follows_from_the_words_of_a_mistake(monkeypatch):
    """What a mistyped key or type hides is found, however a message is put."""
    before = _repairs(MISTAKES)
    assert (4, ("animal", "legz"), True, "legs") in before
    assert (4, ("animal", "type"), False, "bee") in before
    said = validation._Said

    def reworded(text, *rest, **named):
        return said(f"({text.upper().replace(' ', '_')})", *rest, **named)

    monkeypatch.setattr(validation, "_Said", reworded)
    assert _repairs(MISTAKES) == before


def test_of_a_file_that_is_not_there_no_words_are_read(tmp_path, monkeypatch):
    def absent(*_):
        raise AbsentFileError("gone")

    monkeypatch.setattr(validation, "read_text", absent)
    with pytest.raises(ScenarioError, match="in its place"):
        validation.text_of(tmp_path / "x", 10, if_absent=lambda: "in its place")


def test_what_stands_beside_a_reference_is_said_instead_of_what_it_refers_to():
    own = {"description": "a front leg", "maximum": 2}
    leg = {"type": "number", "description": "a leg", "maximum": 9, "unit": "m"}
    root = {"$defs": {"Leg": dict(leg), "Front": {"$ref": "#/$defs/Leg", **own}}}
    merged = {"type": "number", "description": "a front leg", "maximum": 2, "unit": "m"}
    assert validation._branches({"$ref": "#/$defs/Leg"}, root, None) == [leg]
    assert validation._branches({"$ref": "#/$defs/Leg", **own}, root, None) == [merged]
    assert validation._branches({"$ref": "#/$defs/Front", "maximum": 1}, root, None) == [
        merged | {"maximum": 1}
    ]
    assert root["$defs"]["Leg"] == leg


class Herd(Section):
    """At least two ants."""

    ants: tuple[Ant, ...] = Field(min_length=2, max_length=5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ants: [{type: ant, legs: x}, {type: ant, legs: y}]", ["ants[0].legs", "ants[1].legs"]),
        ("ants: [{type: ant}, {type: ant, legs: y}]", ["ants[1].legs"]),
        ("ants: [{type: ant, legs: x}]", ["ants[0].legs", "ants"]),
        ("ants: []", ["ants"]),
    ],
)
def test_a_list_is_too_short_only_if_its_items_are_too_few(text, said):
    document = parse_document(text, "f")
    with pytest.raises(ScenarioError) as caught:
        validate(Herd, document, "f")
    places = [line.split(": ")[1] for line in str(caught.value).splitlines()]
    assert sorted(places) == sorted(said)
