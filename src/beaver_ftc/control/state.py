"""The control stage: the records of its parts, how they are filled from the declaration, and what a change of
law keeps of them.

The compiled laws are a table: the kernels that each row of plugins.yaml names. A new law is its own file and
a row; nothing else names it.
"""

from importlib import import_module

import numpy as np

from beaver_ftc.compiled import one_of, record, sized
from beaver_ftc.control import (
    MODULES,
    CompiledLaw,
    accommodation,
    allocation,
    engines,
    file_of,
    power,
    row_of,
)
from beaver_ftc.control.accommodation import surfaces_dtype
from beaver_ftc.control.allocation import allocation_dtype, axes_dtype, layout_dtype
from beaver_ftc.control.engines import ENGINES
from beaver_ftc.control.laws.reference import REFERENCE, configure_reference
from beaver_ftc.control.power import POWER
from beaver_ftc.control.probe import PROBE, configure_probe
from beaver_ftc.scenario.declared import Declared

FILES: dict[str, CompiledLaw] = {file_of(module): import_module(module).LAW for module in MODULES}

# Kernels that call that of the law by its place: accommodate(place, ...), command(place, ...). A law without
# `accommodate` has the common one.
accommodate = one_of(
    {place: law.accommodate for place, law in enumerate(FILES.values()) if law.accommodate},
    accommodation.accommodate,
)
_COMMANDS = [law.command for law in FILES.values()]
command = one_of(dict(enumerate(_COMMANDS[1:], 1)), _COMMANDS[0])


# law: place of its file in FILES. uses_verdict, reallocates, informed: what plugins.yaml says of the law.
CONFIG = record(law=int, uses_verdict=int, reallocates=int, informed=int)

# Records (stage, part) that a law takes over from the law before it. KEPT: the state of the reference, the
# positions of surfaces and engine, the probe. KNOWN: what the law before assumed of the surfaces, unless it
# was informed of the truth and the new law is not. All other records restart.
KEPT = ("reference", "output"), ("allocation", "output"), ("probe", "memory"), ("power", "output")
KNOWN = ("surfaces", "output"), ("power", "memory")


@sized
def control_dtype(n: int) -> np.dtype:
    """The records of the control stage for n surfaces, one a part; each part's file alone writes its own."""
    return record(
        config=CONFIG, reference=REFERENCE, layout=layout_dtype(n), surfaces=surfaces_dtype(n),
        axes=axes_dtype(n), allocation=allocation_dtype(n), probe=PROBE, power=POWER, engines=ENGINES,
        **{file: law.records(n) for file, law in FILES.items()},
    )  # fmt: skip


def configure(control: np.void, declared: Declared, travel: np.ndarray) -> None:
    """Fill the records that all laws share; travel (2, n) rad: the stops. `configure_law` fills that of the
    law. The order matters: allocation reads the length of a frame from the reference, and power the layout of
    allocation."""
    config = declared.control
    dt = 1.0 / declared.rate_hz
    row = row_of(declared.control.law)
    control["config"] = row.place, row.uses_verdict, row.reallocates, row.informed
    configure_reference(control["reference"], config, dt)
    accommodation.configure(control["surfaces"], config, row.informed, dt)
    allocation.configure(control, declared, travel)
    configure_probe(control["probe"], declared.fdi.probing, dt)
    power.configure_power(control["power"], control["layout"], declared)
    engines.configure_engines(control["engines"], declared)


def configure_law(control: np.void, prediction: np.void, declared: Declared, y: np.ndarray) -> None:
    """Fill the record of the law in charge, which may derive its gains at the trim; y: the measured signals
    there."""
    row = row_of(declared.control.law)
    if (law := FILES[row.file]).configure is not None:
        law.configure(control[row.file], control, prediction, declared, y)


def loses_truth(new: np.void, before: np.void) -> bool:
    """Whether the law in `before` was informed of the truth and the one in `new` is not."""
    return bool(before["config"]["informed"] and not new["config"]["informed"])


def take_over(new: np.void, before: np.void, learnt: np.ndarray) -> None:
    """Let a law, configured in `new`, take over from the one in `before` without a bump: the records in KEPT
    and KNOWN go on, and its integrators begin with the present demand.

    If the law loses the truth (`loses_truth`), the effects of the truth must not go on: KNOWN restarts,
    and so do the hand-over of pitch, the governing of the reference, and the integrators.

    learnt (3,) rad/s2: part that the network of the diagnosis explains. source: the records with which the
    integrators may begin; unexplained (3,) rad/s2: acceleration that the law in them attributes to no model.
    """
    restarts = loses_truth(new, before)
    for stage, part in KEPT if restarts else (*KEPT, *KNOWN):
        new[stage][part] = before[stage][part]
    if restarts:
        for name in ("hand_over", "lost_share", "transfer_share"):
            new["allocation"]["output"][name] = 0.0
        reference = new["reference"]["output"]
        for kind in ("rate", "acceleration"):
            reference[f"governed_{kind}"] = reference[f"model_{kind}"]
        source = new
        unexplained = np.zeros(3)
    else:
        law = in_charge(before)
        source = before
        unexplained = law.unexplained(before) if law.unexplained else before["surfaces"]["output"]["unknown"]
    if (begin := in_charge(new).begin) is not None:
        begin(new, source, unexplained, learnt)


def in_charge(control: np.void) -> CompiledLaw:
    """The law in charge in these records."""
    return list(FILES.values())[int(control["config"]["law"])]
