"""A user who compiles functions of his own has Numba as it is: nothing of it is replaced."""

import json
import subprocess
import sys
from functools import cache

import numba
import numpy as np

from beaver_ftc.compiled import compile_into

PROGRAM = '''
import itertools, json, re, sys
import numba
import numpy as np
from numba.core.bytecode import FunctionIdentity

RECORD = np.dtype([("level", "f8"), ("fired", "i8", (3,))])
SOURCE = """
@numba.njit
def inner(record, x):
    return record.level / (1.0 + abs(x)) + record.fired.sum()

@numba.njit
def outer(records, values):
    total = 0.0
    for record in records:
        values[1:] = values[:-1] * 2.0
        total += inner(record, values[0] - len(values))
    return np.sqrt(total), str(values.size)
"""


def strangers(first):
    """The functions compiled anew: dispatchers and what they return. first: the number in their names."""
    FunctionIdentity._unique_ids = itertools.count(first)
    space = {"numba": numba, "np": np, "__name__": "strangers"}
    exec(SOURCE, space)
    records, values = np.ones(2, RECORD), np.arange(4.0)
    returned = space["outer"](records, values), values.tolist()
    return (space["inner"], space["outer"]), returned


def texts(functions):
    """Their LLVM and machine code, line by line, without those numbers and without addresses."""
    code = [text for f in functions for of in (f.inspect_llvm(), f.inspect_asm()) for text in of.values()]
    return [re.sub(r"v[123]0[0-9]{3}|0x[0-9a-f]{8,}|[0-9]{12,}", "", text).splitlines() for text in code]


def parts(module):
    """Every function, class, and part of a class of a module, by name."""
    for name, value in list(vars(module).items()):
        if isinstance(value, type) and value.__module__ == module.__name__:
            yield from ((f"{module.__name__}.{name}.{part}", of) for part, of in list(vars(value).items()))
        if callable(value):
            yield f"{module.__name__}.{name}", value


def of_numba():
    modules = [module for name, module in list(sys.modules.items()) if name.partition(".")[0] == "numba"]
    return {name: value for module in modules for name, value in parts(module) if callable(value)
            or isinstance(value, (property, classmethod, staticmethod))}


strangers(30_001)  # what Numba compiles once a process
first, returned = strangers(10_001)
before, code = of_numba(), texts(first)
OURS
second, again = strangers(20_001)
after = of_numba()
replaced = sorted(name for name in before if after.get(name) is not before[name])
REPLACING
then = of_numba()
json.dump({
    "seen": sorted(name for name in after if then.get(name) is not after[name]),
    "count": len(before), "replaced": replaced, "same code": texts(second) == code,
    "same result": again == returned, "by": [type(f).__module__ for f in (*first, *second)],
    "called": called, "lines": sum(map(len, code)),
}, sys.stdout)
'''

OURS = """
from beaver_ftc.compiled import kernel, apart, direct, record, sized

@sized
def of(n):
    return record(level=float, state=(2, n))

@kernel
def halve(x):
    x *= 0.5

@kernel
def advance(records, log):
    halve(log[0])
    records[0].state[:] = 1.0
    return records[0].state.sum() + log[0, 1]

records, log = np.zeros(1, of(3)), np.ones((2, 3))
advance(records, log)

@numba.njit
def caller(x):
    halve(x)
    return x.sum()

called = caller(np.ones(4))
"""


@cache
def outcome():
    program = PROGRAM.replace("OURS", OURS).replace("REPLACING", REPLACING)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_a_strangers_function_is_compiled_by_numbas_own_means():
    found = outcome()
    assert found["replaced"] == []
    assert found["same code"]
    assert found["same result"]
    assert set(found["by"]) == {"numba.core.registry"}
    assert found["count"] > 3000
    assert found["lines"] > 1000


def test_a_strangers_function_may_call_a_kernel():
    assert outcome()["called"] == 2.0


REPLACING = """
from numba.core.codegen import CPUCodeLibrary
usual = CPUCodeLibrary.finalize
CPUCodeLibrary.finalize = lambda library: usual(library)
"""


def test_both_find_their_own_implementation_of_a_function_of_numpy_in_any_order():
    """Numba notes one for all targets, that of whoever asked last; each type of number is compiled anew."""

    def total(values):
        return values.sum()

    compilers = [lambda function: compile_into(None, function), numba.njit]
    for n, kind in enumerate(("i1", "i2", "u1", "u2", "u4", "f4")):
        assert compilers[n % 2](total)(np.full(3, 2, kind)) == 6
