"""The registry of detectors and laws, and the package's public names, one function at a time."""

import sys

import pytest

from beaver_ftc import plugins
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.plugins import DETECTORS, LAWS, VARIABLE, Registered, refusal, register, registered

MODULE = '''
class MyOwnDetector:
    """Sees all.

    More of it."""
    def reset(self, context): pass
    def step(self, measured, command): pass

class Undescribed(MyOwnDetector):
    __doc__ = None

class Silent:
    def reset(self, context): pass
    def step(self, measured, command): pass

class MyLaw:
    """Commands nothing."""
    def reset(self, context): pass
    def step(self, measured, reference, verdict): pass

class Odd(MyLaw):
    def step(self, a, b, c, d): pass

class NoReset:
    reset = None
    def step(self, measured, command): pass

class Nothing: pass

class Refuses(MyLaw):
    def __init__(self): raise ArithmeticError("no\\n numbers")

class Explains(MyLaw):
    def __init__(self):
        from beaver_ftc.documents.errors import SimulationFailed
        raise SimulationFailed("said already")

def function(): pass
function.reset = function.step = lambda self, measured, command: None
'''


@pytest.fixture(autouse=True)
def own(tmp_path, monkeypatch):
    """A module in the working folder; nothing is registered, and what a test registers goes with it."""
    (tmp_path / "own_plugins.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(sys, "path", list(sys.path))
    plugins._read_all.cache_clear()
    yield
    sys.modules.pop("own_plugins", None)


def test_a_class_is_registered_for_this_run(tmp_path):
    entry = register("own_plugins:MyOwnDetector")
    assert entry == Registered(DETECTORS, "my-own-detector", "own_plugins:MyOwnDetector", "--plugin")
    assert sys.path.count(str(tmp_path)) == 1
    assert sys.path[-1] == str(tmp_path)
    law = register("mine=own_plugins:MyLaw")
    assert (law.group, law.name) == (LAWS, "mine")
    assert register("mine=own_plugins:MyLaw") == law
    text = "my-own-detector=own_plugins:MyOwnDetector mine=own_plugins:MyLaw"
    assert plugins.os.environ[VARIABLE] == text
    assert list(registered(DETECTORS))[-1] == "my-own-detector"
    assert list(registered(LAWS))[-1] == "mine"
    assert "mine" not in registered(DETECTORS)
    assert (entry.description(), law.description()) == ("Sees all.", "Commands nothing.")
    assert register("own_plugins:Undescribed").description() == "Sees all."  # what it inherits
    assert register("own_plugins:Silent").description() == ""
    for name in ("my-own-detector", "MyOwnDetector"):
        assert refusal(DETECTORS, name) is None
        assert type(plugins.made(DETECTORS, name)).__name__ == "MyOwnDetector"
    assert "unknown law 'MyOwnDetector'" in refusal(LAWS, "MyOwnDetector")
    with pytest.raises(BadInput, match=r"--plugin mine=own_plugins:Refuses: there is a mine already"):
        register("mine=own_plugins:Refuses")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("own_plugins", "--plugin: 'own_plugins' is no class, allowed: MODULE:CLASS or NAME=MODULE:CLASS"),
        ("own_plugins:Odd", "--plugin own_plugins:Odd: step(self, a, b, c, d) is neither, allowed: "),
        ("own_plugins:NoReset", "own_plugins:NoReset lacks reset, allowed: a class with reset and step"),
        ("own_plugins:Nothing", "own_plugins:Nothing lacks reset and step, allowed: a class with"),
        ("own_plugins:function", "own_plugins:function is not a class, allowed: a class with reset and"),
        ("own_plugins:Absent", "cannot load own_plugins:Absent: AttributeError: module 'own_plugins' has"),
    ],
)
def test_what_is_no_plug_in(given, says):
    with pytest.raises(BadInput) as refused:
        register(given)
    assert says in str(refused.value)
    assert plugins.os.environ[VARIABLE] == ""


def test_what_cannot_be_made():
    register("own_plugins:Refuses")
    register("own_plugins:Explains")
    with pytest.raises(BadInput, match=r"^plug-in refuses: cannot be made: ArithmeticError: no numbers$"):
        plugins.made(LAWS, "refuses")
    with pytest.raises(SimulationFailed, match=r"^said already$"):
        plugins.made(LAWS, "explains")
    for name in ("adaptive", "adaptve"):
        with pytest.raises(BadInput, match=f"^plug-in {name}: not registered"):
            plugins.made(LAWS, name)


@pytest.mark.parametrize(
    ("group", "name", "says"),
    [
        (DETECTORS, "none", None), (DETECTORS, "augmented-ekf", None), (LAWS, "lqr", None),
        (DETECTORS, "lqr", "unknown scheme 'lqr'"), (LAWS, "none", "unknown law 'none'"),
        (LAWS, "lqg", "unknown law 'lqg', did you mean lqr?"),
        (LAWS, "a:B", "'a:B' is a class; a scenario names what is registered, allowed: nominal, adaptive, "),
        (LAWS, "x" * 101, f"unknown law '{'x' * 100}', allowed"),
        (LAWS, "x:" + "y" * 101, f"'x:{'y' * 98}' is a class;"),
    ],
)  # fmt: skip
def test_what_is_said_of_a_name(group, name, says):
    found = refusal(group, name)
    assert found is None if says is None else found.startswith(says)


# As plugins.yaml has them: with options and limits of tuning, without, and with a class.
ROWS = {
    "mine": {
        "says": "Mine.",
        "options": {
            "gain": {"default": 2.0, "low": 0.5, "high": 3.0},
            "order": {"default": 1, "whole": True, "high": 4},
        },
        "tunable": {"gain": [0.5, 3], "fdi.share": [0.1, 0.9, "odds"]},
    },
    "bare": {"says": "Bare."},
    "theirs": {"says": "Theirs.", "class": "own_plugins:MyLaw"},
}


@pytest.fixture
def rows(monkeypatch):
    monkeypatch.setattr(plugins, "_ours", lambda group: ROWS if group == LAWS else {})


@pytest.mark.parametrize(
    ("name", "given", "wrong"),
    [
        ("mine", {"gain": 0.5, "order": 4}, []), ("mine", {"gain": 3.0, "order": 0}, []),
        ("mine", {"order": 2.5, "gain": 0.499, "gian": 1.0},
         [("order", "2.5, allowed: whole numbers from 0 to 4"),
          ("gain", "0.499, allowed: numbers from 0.5 to 3"),
          ("gian", "mine has no such option, did you mean gain? allowed: gain, order")]),
        ("mine", {"gain": 3.001, "order": 5},
         [("gain", "3.001, allowed: numbers from 0.5 to 3"),
          ("order", "5, allowed: whole numbers from 0 to 4")]),
        ("mine", {"order": -1}, [("order", "-1, allowed: whole numbers from 0 to 4")]),
        ("bare", {"gain": 1.0}, [("gain", "bare has no options, allowed: {}")]),
        ("theirs", {"gain": 1.0}, []),  # which it has to say itself
        ("of another package", {"gain": 1.0}, []),
    ],
)  # fmt: skip
def test_options_of_what_the_compiled_frame_does_are_within_their_limits(rows, name, given, wrong):
    found = plugins.wrong_options(LAWS, name, given)
    assert found == [(("options", key), says) for key, says in wrong]


def test_between_which_limits_a_parameter_is_tuned(rows, monkeypatch):
    assert plugins.tunable(LAWS, "mine") == {
        "gain": plugins.Range(0.5, 3.0, "log"), "fdi.share": plugins.Range(0.1, 0.9, "odds"),
    }  # fmt: skip
    assert plugins.tunable(LAWS, "bare") == {}
    entry = register("own_plugins:MyLaw")
    law = plugins.plugin_class(LAWS, entry.name)
    assert plugins.tunable(LAWS, entry.name) == {}
    monkeypatch.setattr(law, "tunable", {"pole": (2, 5)}, raising=False)
    assert plugins.tunable(LAWS, entry.name) == {"pole": plugins.Range(2.0, 5.0, "log")}
    monkeypatch.setattr(law, "tunable", [("pole", 2, 5)])
    with pytest.raises(BadInput) as refused:
        plugins.tunable(LAWS, entry.name)
    assert str(refused.value) == "plug-in my-law: tunable is a list, allowed: option: (low, high)"
