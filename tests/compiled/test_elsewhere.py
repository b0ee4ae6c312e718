"""The stages of a frame compile for another target: in PTX, the language of graphics processors, they call
only mathematics, and allocate nothing.

`python tests/compiled/test_elsewhere.py STAGE` prints a stage in PTX. Numba compiles it by its own means, and
LLVM writes the result for the other target, without a device.
"""

import os
import re
import subprocess
import sys

import llvmlite.binding as llvm
import numba
import pytest

from beaver_ftc.loop import frame
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load

TRIPLE = "nvptx64-nvidia-cuda"
# Functions that a stage may call; the last two count the users of an array.
ALLOWED = "cos exp hypot log10 pow sin sqrt tan NRT_incref NRT_decref"
# Parts of Numba's code that only this processor has, and what stands in their place.
REPLACED = {
    r"^define [^\n]*@(cfunc|_ZN7cpython).*?^}": "",  # entries for Python
    r"^define [^\n]*(void @NRT_\w+\(ptr).*?^}": r"declare \1)",  # count by instructions of this processor
    r"@llvm\.(cos|exp|log10|pow|sin|tan)\.f64": r"@\1",  # PTX has no such instructions
}


def written(stage):
    """The code of a stage in PTX, with all kernels that it calls; its one argument is a frame's record."""
    kernel = getattr(frame, stage)
    kernel.compile((numba.typeof(Loop(load({"duration_s": 1.0})).frames).dtype,))
    (code,) = kernel.inspect_llvm().values()
    for form, other in REPLACED.items():
        code = re.sub(form, other, code, flags=re.MULTILINE | re.DOTALL)
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine()
    module = llvm.parse_assembly(code)
    module.triple, module.data_layout = TRIPLE, str(machine.target_data)
    return machine.emit_assembly(module)


@pytest.mark.parametrize("stage", ["diagnose", "decide", "command"])
def test_a_stage_calls_nothing_but_mathematics(stage):
    alone = {**os.environ, "BEAVER_FTC_COMPILER": "numba"}
    code = subprocess.check_output([sys.executable, __file__, stage], env=alone, text=True)
    assert re.search(rf"^\.visible \.func .*5frame\d{stage}", code, re.MULTILINE)
    assert {*re.findall(r"^\.extern \.func .*?(\w+)$", code, re.MULTILINE)} <= {*ALLOWED.split()}


if __name__ == "__main__":
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    print(written(sys.argv[1]))
