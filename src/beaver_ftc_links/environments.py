"""The name of the environment in the registry of Gymnasium.

Gymnasium 1 no longer reads entry points of packages: a name is registered when its package is imported. But
the import of the core must be quick and must not need Gymnasium. So `register` is an entry point that the
core calls as soon as both the core and the registry of Gymnasium are imported.
"""

from types import ModuleType

ID = "beaver_ftc/Beaver-v0"


def register(registration: ModuleType) -> None:
    """Register the environment's name; registration: `gymnasium.envs.registration`."""
    registration.register(
        id=ID,
        entry_point="beaver_ftc_links.gym:BeaverEnv",
        vector_entry_point="beaver_ftc_links.gym:BeaverVectorEnv",
    )
