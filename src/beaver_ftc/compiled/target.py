"""Our kernels' own target of Numba's compiler, so that a first flight compiles in seconds, not in minutes.

Numba knows its targets by registries [numba.core.target_extension]: a class of target, the dispatcher of
its functions, and the contexts in which they are typed and translated. Ours inherit from those of Numba's
CPU target. Nothing of Numba is replaced: a function that somebody else compiles never comes here.

Machine code. Numba optimises a function again at each level of calls. Here a kernel that another one calls
is only translated; the outermost one is optimised once, with all that it calls (`Library`). Kernels allocate
nothing, so nobody counts the users of an array; of the steps to machine code, those are taken that change
something in a kernel (`_Pipeline`).

Kernels that only some flights call are compiled each by itself (by_address.py). Records have types that are
the same for all sizes (sized_types.py). All that is borrowed from inside Numba is in these three files and
asking.py, which are used with the versions in `beaver_ftc.compiled.KNOWN` alone. With another, kernels are
compiled by Numba's own means.
"""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core import sigutils, typed_passes, types, typing, untyped_passes
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, CompilerBase
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.datamodel import models
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.core.runtime import rtsys
from numba.core.target_extension import (
    CPU,
    dispatcher_registry,
    jit_registry,
    target_override,
    target_registry,
)
from numba.core.types import unliteral
from numba.core.utils import threadsafe_cached_property
from numba.extending import register_model

from beaver_ftc.compiled.ahead import compile_expected
from beaver_ftc.compiled.cache import CodeCache, announced, held, locked
from beaver_ftc.compiled.digest import what_follows
from beaver_ftc.compiled.records import short_digest
from beaver_ftc.compiled.sized_types import type_of

# mypy: disable-error-code="attr-defined,misc,override"


compiling: list["Kernel"] = []  # kernels being compiled, each called by the one before; under Numba's lock


class Inner:
    """Stands for the machine code of a function that is compiled as a part of others only."""


class Library(JITCodeLibrary):
    """The code of one function. That of an inner one is only translated, for others to link in."""

    only_translated = False

    def _optimize_functions(self, ll_module: Any) -> None:
        """Leave each function as it is until all are linked; Numba optimises each by itself before."""
        ll_module.data_layout = self._codegen._data_layout

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
        if compiling and compiling[0].for_size:
            for function in _defined(self._final_module):
                function.add_function_attribute("optsize")
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)
        self._final_module.verify()
        with held():
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


NAME = "beaver_ftc"  # of the target
STEPS = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.GenericRewrites,
    untyped_passes.ReconstructSSA,
    typed_passes.NopythonTypeInference,
    typed_passes.PreLowerStripPhis,
    typed_passes.IRLegalization,
    typed_passes.AnnotateTypes,
    typed_passes.NativeLowering,
    typed_passes.NoPythonBackend,
)


class Target(CPU):
    """Numba's token of the target: what is meant for any target or for CPUs is meant for it too."""


class _Context(CPUContext):
    """How functions are translated: as by Numba, under names of ours."""

    def init(self) -> None:
        super().init()
        self._internal_codegen = Codegen(NAME)

    def load_additional_registries(self) -> None:
        """Numba's own implementations, imported once: Numba calls this for whatever it does not find."""
        for registry in self._registries:
            self.install_registry(registry)
        if not self._registries:
            rtsys.initialize(cpu_target.target_context)  # what all targets share, as if ours were not there
            super().load_additional_registries()

    def mangler(self, name: str, types: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
        """The name of a compiled function: after what its types contain.

        Numba names a record's type after how many types there were before in this process. Code that two
        processes have kept would then have the same names for records of two aircraft, and a third process
        that loads both would run the one for the other.
        """
        return super().mangler(name, (short_digest(tuple(types)),), abi_tags=abi_tags, uid=uid)

    def get_executable(self, library: Any, fndesc: Any, env: Any) -> Any:
        """What Python calls; of an inner function what stands for it."""
        library._ensure_finalized()
        return Inner() if len(compiling) > 1 else super().get_executable(library, fndesc, env)


class _Function(types.Function):
    """The type of an operator or of a function of NumPy; it keeps its signature for each set of arguments.

    Numba's own tries all definitions for each call in a kernel, once to type the call and again to translate
    it. It is also shared by all targets, and names the implementation of the target that asked last.
    """

    def __init__(self, template: Any) -> None:
        super().__init__(template)
        self._signatures: dict[Any, Any] = {}

    def augment(self, other: Any) -> Any:
        """The function with the definitions of both; None if they are different functions."""
        return type(self)(self.templates + other.templates) if other.typing_key == self.typing_key else None

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """The signature for arguments of these types."""
        if kws:
            return super().get_call_type(context, args, kws)
        key = tuple(args)
        if key not in self._signatures:
            self._signatures[key] = super().get_call_type(context, args, kws)
        return self._signatures[key]


register_model(_Function)(models.OpaqueModel)


class _TypingContext(typing.Context):
    """How functions are typed: as by Numba, each operator and function of NumPy once for the same types."""

    _loaded = False

    def load_additional_registries(self) -> None:
        """Numba's own declarations, once: it calls this again for each function that it compiles."""
        if not self._loaded:
            super().load_additional_registries()
            self._loaded = True

    def insert_global(self, value: Any, kind: Any) -> None:
        """Give a function, or another value, its type in kernels."""
        ours = _Function(kind.templates) if type(kind) is types.Function else kind
        super().insert_global(value, ours)


class _TargetOfKernels(CPUTarget):
    @threadsafe_cached_property
    def _toplevel_target_context(self) -> _Context:
        return _Context(self.typing_context, self._target_name)

    @threadsafe_cached_property
    def _toplevel_typing_context(self) -> _TypingContext:
        return _TypingContext()


target_registry[NAME] = Target
_target = _TargetOfKernels(NAME)


class Dispatcher(CPUDispatcher):
    """A function compiled for our target: ours, or one of those by which Numba implements NumPy."""

    targetdescr = _target

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled; what only stands for machine code cannot be called from Python."""
        if isinstance(cres.entry_point, Inner):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)


class _Pipeline(CompilerBase):
    """Numba's steps from byte code to machine code, without those for closures, objects, literals, array
    expressions and parallel loops."""

    def define_pipelines(self) -> list[PassManager]:
        """One list of steps, without another to fall back to."""
        steps = PassManager(NAME)
        for step in STEPS:
            steps.add_pass(step, step.__name__)
        steps.finalize()
        return [steps]


class Kernel(Dispatcher):
    """A kernel: kept by itself if Python calls it, and a part of the kernels that call it.

    for_size: whether its code, with all that is a part of it, is optimised for size. allocates: whether it
    makes or returns arrays; it then takes all of Numba's steps.
    """

    def __init__(
        self, folder: Path | None, function: Callable[..., Any], for_size: bool, allocates: bool
    ) -> None:
        options = {"nopython": True, "error_model": "numpy", "_nrt": allocates}
        pipeline = Compiler if allocates else _Pipeline
        super().__init__(function, targetoptions=options, pipeline_class=pipeline)
        self.folder, self._cached = folder, CodeCache(folder, function, for_size) if folder else None
        self.for_size = for_size
        self._inner: set[tuple[Any, ...]] = set()  # arguments for which it is only a part of others so far
        self._results: dict[tuple[Any, ...], Any] = {}  # kept as long as the process: see `result`

    def compile(self, sig: Any) -> Any:
        """Machine code for arguments of these types; inside another kernel only what stands for it."""
        args, _ = sigutils.normalize_signature(sig)
        args = tuple(map(unliteral, args))  # a number in the text makes no other function of it
        with global_compiler_lock:
            if not compiling and (args in self._inner or not self.is_kept(args)):
                # Outside the counter: one of these may call this kernel, and would be refused as a recursion.
                compile_expected()
            with self._compiling_counter:
                there = self.overloads.get(args)
                if there is not None and (compiling or args not in self._inner):
                    return there.entry_point
                if compiling:
                    return self._compiled_as_part(args)
                found = self._loaded(args)
                if found is None:
                    with self._alone(args):  # another process may have come first
                        found = self._loaded(args) or self._compile_and_keep(args)
                return found

    def typeof_pyval(self, val: Any) -> Any:
        """The type of an argument; in place of Numba's for records that have a size."""
        return type_of(val) or super().typeof_pyval(val)

    def stored(self, args: Any) -> Any:
        """The code an earlier process has kept, or None; found without making ready to compile."""
        rtsys.initialize(cpu_target.target_context)
        return self._cached and self._cached.load(tuple(args), self.targetctx)

    def result(self, args: Any) -> Any:
        """The code with what is known of it."""
        found = self._results.get(args) or self.stored(args)
        if found is None:
            self.compile(args)
            found = self.overloads[args]
        self._results[args] = found
        return found

    def _loaded(self, args: tuple[Any, ...]) -> Any:
        self.targetctx.refresh()
        found = self.stored(args)
        if found is None:
            return None
        self._cache_hits[args] += 1
        self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        return self._offered(args, found)

    def is_kept(self, args: tuple[Any, ...]) -> bool:
        """Whether nothing needs to be compiled for arguments of these types."""
        cached = self._cached
        return args in self.overloads or bool(cached and cached.has(args, self.targetctx.codegen()))

    @property
    def size(self) -> int:
        """How much its code follows from, in characters."""
        function: Any = self.py_func
        return len(what_follows(function))

    def compile_unless_taken(self, args: tuple[Any, ...]) -> None:
        """Compile and keep the code, unless it is kept or another process compiles it now."""
        with global_compiler_lock, self._compiling_counter, self._alone(args, wait=False) as mine:
            if mine and not self.is_kept(args):
                self._compile_and_keep(args)

    def _alone(self, args: tuple[Any, ...], wait: bool = True) -> Any:
        """Keep other processes from compiling the same meanwhile: see `locked`."""
        place = self._cached.place(args, self.targetctx.codegen()) if self._cached else 0
        return locked(self.folder, place, wait)

    def _compile_and_keep(self, args: tuple[Any, ...]) -> Any:
        with announced(self.size):
            self.targetctx.refresh()
            result = self._translated(args, is_part=False)
            if self._cached:
                self._cached.save(args, result)
        return self._offered(args, result)

    def _compiled_as_part(self, args: tuple[Any, ...]) -> Any:
        result = self._translated(args, is_part=True)
        self._inner.add(args)
        self.overloads[args] = result
        return result.entry_point

    def _translated(self, args: tuple[Any, ...], is_part: bool) -> Any:
        """Translated code; without the wrappers by which C, and if it is a part Python, would call it."""
        compiling.append(self)
        wrappers = {"no_cfunc_wrapper": True, "no_cpython_wrapper": is_part}
        self._compiler.targetoptions = self.targetoptions | wrappers
        try:
            with target_override(NAME):
                return self._compiler.compile(args, None)
        finally:
            compiling.pop()

    def _offered(self, args: tuple[Any, ...], result: Any) -> Any:
        """The code, where Python and functions that Numba compiles by its own means find it."""
        cpu_target.target_context.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self._inner.discard(args)
        self.add_overload(result)
        return result.entry_point


def _jit(**options: Any) -> Callable[..., Dispatcher]:
    """The decorator of what Numba itself has compiled for our target."""
    return functools.partial(Dispatcher, targetoptions=options)


dispatcher_registry[Target] = Kernel
jit_registry[Target] = _jit
