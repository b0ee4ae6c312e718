"""The compiled frame with parts of it taken out, for timing.

A part is a set of kernels. To take it out, each of its kernels is replaced by a stand-in, which does nothing
or returns a constant. All kernels that call it are then compiled again from the same source. Parts are
switched on one after another: the time of a part is the difference of two frames, with the parts up to it and
with those before it.
"""

import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import beaver_ftc.loop.stepping  # noqa: F401  (its kernels must be there to be copied)
from beaver_ftc import compiled

Kernel = Callable[..., Any]

UNLIMITED_RAD_S = 1e9  # a threshold that no residual reaches; finite, so that results of it are finite too


def nothing(*arguments):
    """Stand-in for a kernel that fills its arguments."""


def flying(value, ground_m, slow_mps):
    """Stand-in for `sensing.flight_status`; 0: the aircraft flies."""
    return 0


def unlimited(e, eta, a, dt, n=0.0):
    """Stand-in for `filters.advance_bound`."""
    return UNLIMITED_RAD_S


def all_residuals(*arguments):
    """Stand-in for the thresholds of isolation (lower, upper)."""
    return -UNLIMITED_RAD_S, UNLIMITED_RAD_S


# Kernels and stand-ins by part, in the order in which parts are switched on. Writing comes before the law,
# and hands over a held command.
PARTS: dict[str, dict[str, Kernel]] = {
    # the truth's properties, and whether they are finite and within limits
    "reading": {"plant.sensing.measure": nothing, "plant.sensing.flight_status": flying},
    # the design model, the detection estimator and its bank of filters
    "fdae": {
        "design.model.response": nothing, "loop.guarantee.effect_of_faults": nothing,
        "diagnosis.model_prediction.evaluate_frame": nothing, "loop.frame.diagnose": nothing,
    },
    # the isolation estimators, and the decision among them
    "fies": {
        "diagnosis.isolation.update_effects": nothing,
        "diagnosis.estimators.advance_estimators": nothing,
        "diagnosis.estimators.start_estimators": nothing,
        "diagnosis.schemes.adaptive_estimators.continue_isolation": nothing,
    },
    # the bound on the uncertainty, and every threshold that follows from it
    "thresholds": {
        "diagnosis.bounds.add_published_bound": nothing,
        "diagnosis.detection.filters.advance_bound": unlimited,
        "diagnosis.detection.intervals.residual_interval": all_residuals,
        "diagnosis.detection.intervals.published_interval": all_residuals,
    },
    # the network of the detection estimator, which learns after the alarm
    "network": {
        "diagnosis.detection.fdae.train_network": nothing,
        "diagnosis.detection.fdae.evaluate_network": nothing,
    },
    # the mode of the flight
    "supervisor": {"loop.frame.decide": nothing},
    # the command, into the aircraft's properties
    "writing": {"plant.channels.write_nodes": nothing},
    # reference model, feedback linearisation, accommodation, allocation, anti-windup
    "law": {"loop.frame.command": nothing, "control.laws.reference.follow": nothing},
    # every column of the log, and the sums of the metrics
    "logging": {"loop.log_row.record_row": nothing, "loop.accounts.account": nothing},
}  # fmt: skip


def frame_with(switched_on: int) -> Kernel:
    """`stepping.fly_on` with the first `switched_on` parts of PARTS, and without all others. Each frame with
    a part taken out is compiled once, into a cache of its own, whose name has a digest of this file."""
    if switched_on == len(PARTS):
        return import_module("beaver_ftc.loop.stepping").fly_on
    stand_ins: dict[str, Kernel] = {}
    for kernels in [*PARTS.values()][switched_on:]:
        stand_ins |= kernels
    source = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:8]
    return frame_without(stand_ins, f"parts-{switched_on}-{source}")


def frame_without(stand_ins: Mapping[str, Kernel], name: str) -> Kernel:
    """A private `stepping.fly_on`. stand_ins: by name of a kernel, its stand-in. name: of the cache. Raises
    ValueError if a kernel does not exist."""
    used: set[str] = set()
    folder = compiled.cache_folder()

    def kernel(function, **options):
        """The decorator in place of `compiled.kernel`: compile a function, or its stand-in, into the own
        cache."""
        full_name = f"{function.__module__}.{function.__name__}".removeprefix("beaver_ftc.")
        used.add(full_name)
        made_of = stand_ins.get(full_name, function)
        return compiled.compile_into(folder / name if folder else None, made_of, **options)

    with _fresh_kernel_modules(kernel):
        fly_on = import_module("beaver_ftc.loop.stepping").fly_on
    if unknown := set(stand_ins) - used:
        raise ValueError(f"no such kernel: {', '.join(sorted(unknown))}")
    return fly_on


@contextmanager
def _fresh_kernel_modules(kernel: Callable[..., Kernel]) -> Iterator[None]:
    """During the block, an import of a module of kernels makes a new module, whose kernels `kernel`
    decorates. At the end, the old modules return.
    """
    usual = compiled.kernel
    # a module of kernels has imported the decorator; `compiled`, which defines it, stays
    modules = {
        name: module
        for name, module in sys.modules.items()
        if name.startswith("beaver_ftc.")
        and module is not compiled
        and getattr(module, "kernel", None) is usual
    }
    # packages are listed before a module is removed, because some packages have kernels themselves
    packages = {name: sys.modules[name.rpartition(".")[0]] for name in modules}
    for name, package in packages.items():
        del sys.modules[name]
        vars(package).pop(name.rpartition(".")[2], None)
    compiled.kernel = kernel
    try:
        yield
    finally:
        compiled.kernel = usual
        for name, module in modules.items():
            sys.modules[name] = module
            setattr(packages[name], name.rpartition(".")[2], module)
