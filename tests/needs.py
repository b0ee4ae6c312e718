"""Marks of tests that want more than the core: without a package that offers it they are skipped."""

import pytest

from beaver_ftc import commands, plugins


def service(name: str) -> pytest.MarkDecorator:
    """The test wants what another package offers the core by this name."""
    there = name in plugins.entries(plugins.SERVICES)
    return pytest.mark.skipif(not there, reason=f"no installed package offers {name!r}")


def command(name: str) -> pytest.MarkDecorator:
    """The test runs a command of another package."""
    return pytest.mark.skipif(name not in commands.registered(), reason=f"there is no command {name!r}")
