"""How the machine code of our kernels comes about, borrowed from inside the versions of Numba that are known.

Numba optimises a function again at each level of calls. Here a kernel that another one calls is only
translated; the outermost one is optimised once, with all that it calls.

A trial of library.py with a version of Numba that is not known, in a process of its own.

What is borrowed from inside another version may end a process instead of raising.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen

from beaver_ftc.compiled import cache
from beaver_ftc.documents.files import digest_of_files
from beaver_ftc.documents.files import passes as passes_in_a_child

# mypy: disable-error-code="attr-defined,misc"


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
        with cache.held():
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


VARIABLE = "BEAVER_FTC_COMPILER"
CODE = (
    "from beaver_ftc.compiled import compile_into; from beaver_ftc.compiled.library import is_right; "
    "raise SystemExit(0 if is_right(compile_into) else 3)"
)


def passes() -> bool:
    """Whether kernels compiled so are right, as found now or by an earlier process."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    versions = numba.__version__, llvmlite.__version__, sys.implementation.cache_tag, digest_of_files(*files)
    return passes_in_a_child("numba", str(versions), CODE, {VARIABLE: "trial"})


def is_right(compile_into: Callable[[None, Callable[..., Any]], Callable[..., Any]]) -> bool:
    """Whether kernels that call one another can be compiled, and return the same as their plain form.

    compile_into: as in `beaver_ftc.compiled`, which imports this module by way of target.py.
    """
    try:
        return _returns_the_same(compile_into)
    except Exception:  # whatever a part does that is not as we have found it
        return False


def _returns_the_same(compile_into) -> bool:
    import numpy as np

    def scale(x, by):
        x[:] = x / by

    def weigh(record, x):
        scaled(x, record.level)
        return np.sqrt(x[0] * x[1]) + record.state.sum()

    def total(records, x):
        found = 0.0
        for record in records:
            for i in range(2):
                found += weighed(record, x[i]) + max(x[i, 0], found)
        return found

    def refuse(x):
        scaled(x[:2], x[1])
        if x[0] > 0.0:
            raise ValueError("greater than zero")
        return x[0]

    compiled = [compile_into(None, function) for function in (scale, weigh, total, refuse)]
    scaled, weighed, totalled, refused = compiled
    records = np.ones(2, [("level", "f8"), ("state", "f8", (2, 3))])
    records["level"] = 2.0, 0.0
    x = np.arange(1.0, 5.0).reshape(2, 2)
    again = x.copy()
    first = totalled(records, x), weighed(records[0], x[0]), refused(np.array([-1.0, 2.0]))
    scaled, weighed = scale, weigh
    with np.errstate(all="ignore"):
        second = total(records.view(np.recarray), again), weigh(records.view(np.recarray)[0], again[0]), -0.5
    try:
        refused(np.array([1.0, 1.0]))
    except ValueError as error:
        return str(error) == "greater than zero" and np.array_equal(
            [*first, *x[0]], [*second, *again[0]], True
        )
    return False
