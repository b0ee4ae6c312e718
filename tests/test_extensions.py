"""What packages beside the core add to it: found as the standard library finds it, called when wanted."""

import sys
from importlib.metadata import entry_points
from importlib.util import find_spec

import pytest

from beaver_ftc import commands, plugins
from beaver_ftc.documents.errors import BadInput

OURS = (commands.GROUP, commands.GROUPS, plugins.SERVICES, plugins.WHEN_IMPORTED)
METADATA = """[console_scripts]
other = other:main

[beaver_ftc.services]
count = counting:count
gone = not_there:nothing
derive = counting:count

[beaver_ftc.when_imported]
waited_for = counting:note
"""
MODULE = (
    "seen = []\ndef count(*given):\n    return len(given)\ndef note(module):\n    seen.append(module.VALUE)\n"
)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Another package, the last on the path."""
    (tmp_path / "counting-1.dist-info").mkdir()
    (tmp_path / "counting-1.dist-info" / "entry_points.txt").write_text(METADATA)
    (tmp_path / "counting.py").write_text(MODULE)
    (tmp_path / "waited_for.py").write_text("VALUE = 7\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "gymnasium.envs.registration", raising=False)  # named in it for good
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    plugins._all_entries.cache_clear()
    yield tmp_path
    plugins._all_entries.cache_clear()
    for name in ("counting", "waited_for"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("group", OURS)
def test_it_finds_what_the_standard_library_finds(group):
    found = plugins.entries(group)
    listed = {point.name: point.value for point in entry_points(group=group)}
    assert found == {name: target for name, target in listed.items() if find_spec(target.partition(".")[0])}
    assert list(found) == sorted(found)
    for target in found.values():
        assert plugins.loaded(target)


def test_a_service_of_another_package_is_called_by_its_name(package):
    assert plugins.required("count", "--count")(1, 2, 3) == 3
    assert plugins.offered("count")() == 0


def test_of_two_of_a_name_the_first_on_the_path_is_taken(package):
    (package / "later" / "other-1.dist-info").mkdir(parents=True)
    (package / "later" / "other-1.dist-info" / "entry_points.txt").write_text(
        "[beaver_ftc.services]\ncount = counting:note\n"
    )
    sys.path.append(str(package / "later"))
    plugins._all_entries.cache_clear()
    assert plugins.entries(plugins.SERVICES)["count"] == "counting:count"


def test_what_nobody_offers_or_whose_package_is_gone_is_refused_in_a_line(package):
    assert plugins.offered("gone") is None
    with pytest.raises(BadInput) as caught:
        plugins.required("gone", "--gone")
    assert str(caught.value) == (
        "--gone: no installed package offers 'gone', allowed: with all of `pip install beaver-ftc`"
    )


def test_a_function_is_called_once_its_module_is_imported(package):
    plugins.watch_imports()
    assert "counting" not in sys.modules
    import waited_for  # noqa: F401

    assert sys.modules["counting"].seen == [7]


def test_of_a_module_that_is_there_already_it_is_called_at_once(package):
    import waited_for  # noqa: F401

    plugins.watch_imports()
    assert sys.modules["counting"].seen == [7]
