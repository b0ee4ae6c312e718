"""The former place of the pytest plug-in: installations from before the move name it here."""

from beaver_ftc.pytest_plugin import *  # noqa: F403
