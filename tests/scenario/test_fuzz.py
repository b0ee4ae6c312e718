"""Whatever the bytes, loading gives a scenario or a ScenarioError whose every line is one mistake."""

import re
from collections import Counter
from collections.abc import Callable
from copy import deepcopy

from hypothesis import example, given, settings
from hypothesis import strategies as st

from beaver_ftc.documents.document import Document
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import validate
from beaver_ftc.scenario.builtin import builtin_path
from beaver_ftc.scenario.schema import Scenario, load_text
from samples import samples

from .drawn import scenarios

LINE = re.compile(r"^[^\n]+:\d+: [^\n]+$")
SEED = builtin_path("elevator-partial-loss").read_text()


def complaint(read: Callable[[], Scenario]) -> str:
    """What is said of the input, "" if nothing; anything but a ScenarioError fails the test."""
    try:
        assert isinstance(read(), Scenario)
    except ScenarioError as error:
        return str(error) or "a ScenarioError that says nothing"
    return ""


def unclear(read: Callable[[], Scenario]) -> list[str]:
    """Lines of the complaint that name no place or come twice; its beginning, if there is no end to it."""
    says = complaint(read)
    lines = says.split("\n") if says else []
    repeated = [line for line, count in Counter(lines).items() if count > 1]
    endless = [says[:100]] if len(says) >= 2_000_000 else []
    return [line for line in lines if not LINE.match(line)] + repeated + endless


YAML_WORDS = st.sampled_from(
    [
        *(
            "name",
            "faults",
            "type",
            "bias",
            "reference",
            "q",
            "sine",
            "csv",
            "file",
            "actuators",
            "expect",
            "sensors",
        ),
        *(
            ": ",
            ":",
            "- ",
            "\n",
            "\n  ",
            "\n    ",
            ", ",
            "{",
            "}",
            "[",
            "]",
            "&a ",
            "*a",
            "!!str ",
            "'",
            '"',
            "#",
            "|",
            ">",
        ),
        *(
            "? ",
            "<<",
            "---",
            "...",
            "%YAML 1.1",
            "\t",
            "0",
            "1e3",
            ".nan",
            "-1",
            "true",
            "~",
            "12:30",
            "é",
            "\u2028",
            "\x85",
        ),
    ]
)


@settings(max_examples=samples(500), deadline=None)
@given(st.lists(YAML_WORDS, max_size=40).map("".join))
@example("a: &a [*a]")
@example("{? {a: 1} : 2}")
@example("- " * 2000)
@example("? " * 2000)
@example("name: x\nfaults: [[], {}, {type: []}, {type: {}}, {type: null}, {type: bias, at_s: {}}]")
@example("name: x\nactuators: []")
@example("name: x\nactuators: {elevator: []}")
@example("name: x\nsensors: [ideal]")
@example("name: x\nuncertainty: {coefficients: []}")
@example("name: x\nexpect: []")
@example("name: x\nreference: {q: [{csv: {file: [], column: {}}}, {csv: []}, {csv: {time_s: []}}]}")
@example("name: x\nreference: {q: [{csv: {file: a, time_s: [], values_deg_s: []}}]}")
def test_random_yaml(text):
    assert not unclear(lambda: load_text(text, source="s.yaml"))


@settings(max_examples=samples(300), deadline=None)
@given(st.data())
def test_a_good_file_with_a_piece_cut_out_doubled_or_replaced(data):
    start = data.draw(st.integers(0, len(SEED)))
    stop = data.draw(st.integers(start, min(len(SEED), start + 60)))
    new = data.draw(
        st.sampled_from(["", SEED[start:stop] * 2, "\n", ": ", "1", "[", "}", "x", "&a", "*a", " ", "-"])
    )
    text = SEED[:start] + new + SEED[stop:]
    assert not unclear(lambda: load_text(text, source="s.yaml"))


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=10),
    st.just([]),
    st.just({}),
    st.just({"type": "bias"}),
    st.just([{"sine": None}]),
)


@settings(max_examples=samples(300), deadline=None)
@given(st.deferred(lambda: st.sampled_from(scenarios())), st.data())
def test_a_good_scenario_with_values_replaced(scenario, data):
    scenario = deepcopy(scenario)
    for _ in range(data.draw(st.integers(1, 3))):
        _replace_one(scenario, data)
    assert not unclear(lambda: validate(Scenario, Document(scenario), "s.yaml"))


def _replace_one(node, data) -> None:
    """Walk down at random and put anything in the place of something."""
    keys = list(node) if isinstance(node, dict) else list(range(len(node)))
    if not keys:
        return
    key = data.draw(st.sampled_from(keys))
    if isinstance(node[key], dict | list) and node[key] and data.draw(st.booleans()):
        _replace_one(node[key], data)
    else:
        node[key] = deepcopy(data.draw(VALUES))
