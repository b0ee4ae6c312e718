"""The environments by the module that held them before: accepted, with a notice."""

import sys
from importlib import import_module

import gymnasium
import pytest

from beaver_ftc_links.gym import BeaverEnv

FORMER = "beaver_ftc.integrations.gym"


@pytest.fixture
def former(monkeypatch):
    """The former module, imported anew."""
    monkeypatch.delitem(sys.modules, FORMER, raising=False)
    with pytest.warns(DeprecationWarning, match=r"has moved to beaver_ftc_links\.gym"):
        return import_module(FORMER)


def test_the_line_documented_before_makes_the_environment(former):
    environment = gymnasium.make(f"{FORMER}:beaver_ftc/Beaver-v0")
    try:
        assert isinstance(environment.unwrapped, BeaverEnv)
    finally:
        environment.close()
