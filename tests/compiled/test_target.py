"""What is borrowed from inside Numba is there, is called as it was, and is not needed.

A version that fails here is not `target.KNOWN`: with it Numba makes the machine code by its own means.
"""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from beaver_ftc import compiled
from beaver_ftc.compiled import target


@pytest.mark.parametrize("version", ["0.67.2", "0.680.0", "1.0.0"])
def test_of_another_version_nothing_is_borrowed(monkeypatch, version):
    monkeypatch.setattr(numba, "__version__", version)
    assert not target.borrows.__wrapped__()


KERNELS = """
import sys
from pathlib import Path
import numpy as np
from beaver_ftc import compiled
from beaver_ftc.compiled import target

compiled.cache_folder = lambda: Path(__file__).parent / "cache"

@compiled.apart
def halve(record):
    record.value[:] = 0.5 * record.value

@compiled.kernel
def step(records, log):
    halve(records[0])
    row = compiled.row_of(log, 1)
    row[:] = records[0].value / 0.0
    return records[0].value.sum() / records.size

if __name__ == "__main__":
    records = np.zeros(1, [("before", "f8", (int(sys.argv[1]),)), ("value", "f8", (2,))])
    records["value"] = 3.0, -5.0
    log = np.zeros((2, 2))
    call = compiled.direct(step, records, log)
    print(call(records, log), *log[1], type(step).__name__, sum(step.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("compiler", ["", "numba"])
def test_kernels_come_to_the_same_either_way_and_are_kept(tmp_path, compiler):
    """Records of two shapes: the process that loads both must not take the code of one for the other's."""
    (tmp_path / "few_kernels.py").write_text(KERNELS)
    environment = {**os.environ, target.VARIABLE: compiler}

    def run(size):
        command = [sys.executable, tmp_path / "few_kernels.py", str(size)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split(), done.stderr

    first, said = run(1)
    assert first == ["-1.0", "inf", "-inf", "Kernel", "0"]
    borrows = compiler == "" and compiled.borrows()
    assert ("code is compiled in a minute" in said) != borrows
    assert run(4)[0][:4] == first[:4]
    again, said = run(1)
    assert again[:4] == first[:4]
    assert said == ""
    kept = {path.name.partition("-")[0] for path in (tmp_path / "cache").glob("*-*")}
    assert kept == ({"step", "halve"} if borrows else {"step"})


def test_code_for_size_is_shorter_gives_the_same_and_is_kept_apart(tmp_path):
    def add_up(x, weights):
        for i in range(x.size):
            x[i] += weights[i] * x[i]
        return x[0]

    quick, short = (compiled.compile_into(tmp_path, add_up, for_size) for for_size in (False, True))
    given = np.arange(1.0, 10.0), np.linspace(0.5, 1.0, 9)
    x = given[0].copy()
    assert short(x, given[1]) == add_up(given[0], given[1])
    np.testing.assert_array_equal(x, given[0])
    quick(x, given[1])
    lines = [next(iter(each.overloads.values())).library.get_asm_str().count("\n") for each in (quick, short)]
    assert lines[1] < 0.9 * lines[0]  # by the processor
    assert len(list(tmp_path.glob("add_up-*"))) == 2
