"""The environment's name in Gymnasium's registry.

Gymnasium 1 reads no entry points of packages any more: a name is known once its package is imported. But
importing the core must stay quick and must not need Gymnasium. So `register` is an entry point that the core
calls as soon as both the core and Gymnasium's registry are imported.
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
