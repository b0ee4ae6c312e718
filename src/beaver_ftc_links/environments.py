"""The environment's name in Gymnasium's registry, as soon as both packages are imported, in either order.

Gymnasium 1 reads no entry points of packages any more: a name is known once its package is imported. But
importing this package must stay quick and must not need Gymnasium. So if Gymnasium is there already, the name
is registered at once, otherwise when Gymnasium is imported.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

ID = "beaver_ftc/Beaver-v0"
_REGISTRY = "gymnasium.envs.registration"


def register_when_imported() -> None:
    """Register the environment's name, now or right after Gymnasium's registry is imported."""
    if _REGISTRY in sys.modules:
        _register(sys.modules[_REGISTRY])
    else:
        sys.meta_path.insert(0, _Registry())


def _register(registration: ModuleType) -> None:
    registration.register(
        id=ID,
        entry_point="beaver_ftc_links.gym:BeaverEnv",
        vector_entry_point="beaver_ftc_links.gym:BeaverVectorEnv",
    )


class _Registry(MetaPathFinder):
    """Finds Gymnasium's registry by the usual finders, once, and has the name registered in it."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The usual spec of the registry, whose loader registers the name as well; None of anything else."""
        if fullname != _REGISTRY:
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_register(module: ModuleType) -> None:
            execute(module)
            _register(module)

        spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]
        return spec
