"""How the machine code of our kernels comes about, borrowed from inside the versions of Numba that are known.

Numba optimises a function again at each level of calls. Here a kernel that another one calls is only
translated; the outermost one is optimised once, with all that it calls.
"""

# mypy: disable-error-code="attr-defined,misc"
from typing import Any

from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

from beaver_ftc.compiled import interrupts

compiling: list[object] = []  # kernels being compiled, each called by the one before; under Numba's lock


class Inner:
    """Stands for the machine code of a function that is compiled as a part of others only."""


class Library(JITCodeLibrary):
    """The code of one function. That of an inner one is only translated, for others to link in."""

    only_translated = False

    def finalize(self) -> None:
        """Optimise the code with all that it calls, unless it is a part of another."""
        self._raise_if_finalized()
        self.only_translated = self._finalized = len(compiling) > 1
        if self.only_translated:
            return
        self._codegen._check_llvm_bugs()
        own = {function.name for function in _defined(self._final_module)}
        for called in _all_called(self):
            self._reload_init.update(called._reload_init)
            self._final_module.link_in(called._get_module_for_linking(), preserve=True)
        for function in _defined(self._final_module):
            if function.name not in own:
                function.linkage = "internal"  # what is called in one place is then put there, however long
        self._optimize_final_module()
        self._final_module.verify()
        with interrupts.held():
            self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        """The module; with every function of one that was only translated, wanted so far or not."""
        if not self.only_translated:
            return super()._get_module_for_linking()
        module = self._final_module.clone()
        for function in _defined(module):
            function.linkage = "weak_odr"
        return module


def _defined(module: Any) -> list[Any]:
    return [function for function in module.functions if not function.is_declaration]


def _all_called(library: Any) -> list[Any]:
    """The libraries that this one calls, directly or through libraries that were only translated.

    A caller precedes what it calls, because LLVM links from a compiled library only the functions that are
    referenced by then.
    """
    found: dict[int, Any] = {}

    def visit(caller: Any) -> None:
        for called in caller._linking_libraries:
            if id(called) not in found:
                if getattr(called, "only_translated", False):
                    visit(called)
                found[id(called)] = called

    visit(library)
    return list(reversed(found.values()))


class Codegen(JITCPUCodegen):
    _library_class = Library
