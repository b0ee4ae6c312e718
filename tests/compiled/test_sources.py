"""What compiled code is kept under: it follows from all that a kernel is made of, and from nothing else."""

import sys
from importlib import import_module
from types import ModuleType

import pytest

from beaver_ftc import compiled
from beaver_ftc.compiled.digest import digest_of

SOLE = """
from enum import IntEnum
import numpy as np
import sole_folder.inner
from beaver_ftc.compiled import apart, kernel
from sole_intrinsic import loaded
from sole_folder import inner
from sole_folder.here import far

SCALE, TABLE = 2.0, (np.array([1.0, 2.0]), 3)

class Kind(IntEnum):
    LOST = 4

def other(x):
    return x + 1.0

@kernel
def half(x):
    return 0.5 * x

@kernel
def third(x):
    return x / 3.0

part = half

@apart
def rare(record):
    record.value = 1.0

@kernel
def below(x, by=5.0):
    return x * by

@kernel
def above(record, x):
    \"""What is done.\"""
    if x > SCALE:
        rare(record)
    part_of_it = below(x) + TABLE[0][1] + TABLE[1] + Kind.LOST + half(x) + third(x) + part(x)
    return part_of_it + inner.A + sole_folder.inner.B + loaded(x) + far(x) + 6.0
"""
INTRINSIC = """
from numba import types
from numba.extending import intrinsic

@intrinsic
def loaded(typingctx, x):
    return types.float64(x), lambda context, builder, signature, args: args[0]
"""
FAR = "from beaver_ftc.compiled import kernel\n\n@kernel\ndef far(x):\n    return 7.0 * x\n"
FILES = {
    "sole.py": SOLE, "sole_intrinsic.py": INTRINSIC, "sole_folder/inner.py": "A = 7.0\nB = 8.0\n",
    "sole_folder/here.py": FAR, "sole_folder/elsewhere.py": FAR,
}  # fmt: skip


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """digest(file, before, after): that of `above` with so much changed, in modules read anew."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "sole_folder").mkdir()

    def of(file="sole.py", before="", after=""):
        assert before in FILES[file]
        for name, text in FILES.items():
            (tmp_path / name).write_text(text.replace(before, after) if name == file and before else text)
        for name in ("sole", "sole_intrinsic", "sole_folder.inner", "sole_folder.here", "sole_folder"):
            sys.modules.pop(name, None)
        return digest_of(import_module("sole").above.py_func)

    yield of
    for name in [name for name in sys.modules if name.startswith("sole")]:
        del sys.modules[name]


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("sole.py", "SCALE, TABLE = 2.0", "SCALE, TABLE = 2.5"),
        ("sole.py", "[1.0, 2.0]", "[1.0, 4.0]"),
        ("sole.py", "LOST = 4", "LOST = 9"),
        ("sole.py", "by=5.0", "by=5.5"),
        ("sole.py", "x * by", "x / by"),
        ("sole.py", "6.0", "6.5"),
        ("sole.py", "x > SCALE", "x >= SCALE"),
        ("sole.py", "part = half", "part = third"),
        ("sole.py", "rare(", "rarer("),
        ("sole_intrinsic.py", "args[0]", "args[-1]"),
        ("sole_folder/inner.py", "7.0", "7.5"),
        ("sole_folder/inner.py", "8.0", "8.5"),
        ("sole.py", "sole_folder.here", "sole_folder.elsewhere"),  # kept code imports the modules it is from
    ],
)
def test_what_changes_its_code_makes_another_name(digest, file, before, after):
    assert digest() != digest(file, before, after)


PROGRAM = """
import numpy as np
import constants_of_a_plug_in as constants
from constants_of_a_plug_in import FACTOR
TABLE = np.array([1.0, 2.0])
def inner(x):
    return 3.0 * x
inner = compile_into(folder, inner)
def outer(x):
    return inner(x) * FACTOR + constants.ADDED + TABLE[1] + 0.5
outer = compile_into(folder, outer)
"""


def test_a_plug_in_s_kernel_is_compiled_anew_when_what_it_is_made_of_changes(tmp_path, monkeypatch):
    """Outside the package no file is hashed: a number in the text, in an inner kernel, in another module."""

    def outcome(program=PROGRAM, **constants):
        module = ModuleType("constants_of_a_plug_in")
        vars(module).update({"FACTOR": 2.0, "ADDED": 1.0} | constants)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        space = {"__name__": "plug_in", "folder": tmp_path, "compile_into": compiled.compile_into}
        exec(program, space)
        return space["outer"](1.0), "loaded" if space["outer"].stats.cache_hits else "compiled"

    assert outcome() == (9.5, "compiled")
    assert outcome() == (9.5, "loaded")
    assert outcome(PROGRAM.replace("+ 0.5", "+ 0.75")) == (9.75, "compiled")
    assert outcome(PROGRAM.replace("3.0 * x", "4.0 * x")) == (11.5, "compiled")
    assert outcome(PROGRAM.replace("[1.0, 2.0]", "[1.0, 4.0]")) == (11.5, "compiled")
    assert outcome(FACTOR=3.0) == (12.5, "compiled")
    assert outcome(ADDED=2.0) == (10.5, "compiled")
    assert outcome() == (9.5, "loaded")
