"""What a mistake is called: what is wrong, and what is allowed as the schema has it."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import Discriminator, Field, Tag

from beaver_ftc.documents.document import (
    MAX_PROBLEMS,
    Flag,
    Number,
    Problem,
    Section,
    Whole,
    entry,
    number,
)
from beaver_ftc.documents.errors import nearest, suggestion
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import parse_document, validate
from given import given

GIVEN = given(__file__)


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


WRONG = GIVEN["wrong"]  # fmt: skip


def test_what_each_mistake_is_called(changed):
    found = {}
    for text in WRONG:
        with pytest.raises(ScenarioError) as caught:
            validate(Zoo, parse_document(f"required: 5\n{text}", "f"), "f")
        found[text] = [line[:200] for line in caught.value.lines]
    assert not changed(found)


@pytest.mark.parametrize("number", [MAX_PROBLEMS, MAX_PROBLEMS + 1])
def test_after_a_hundred_mistakes_there_is_a_word_that_there_are_more(number):
    problems = [Problem(line, ("a", line), "x") for line in (*range(number, 0, -1), 5)]  # one of them twice
    found = ScenarioError("f", problems).problems
    assert found[:MAX_PROBLEMS] == tuple(Problem(i, ("a", i), "x") for i in range(1, MAX_PROBLEMS + 1))
    says = "has more than 100 mistakes, allowed: none"
    assert found[MAX_PROBLEMS:] == ((Problem(101, (), says),) if number > MAX_PROBLEMS else ())


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
