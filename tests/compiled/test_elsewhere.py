"""A frame's stages can leave: in PTX, of graphics processors, they want mathematics and no memory.

`python tests/compiled/test_elsewhere.py STAGE` prints a stage in PTX: Numba's own code of it, written by LLVM
without a device.
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
WANTED = "cos exp hypot log10 pow sin sqrt tan NRT_incref NRT_decref"  # the last count who uses an array
NOT_TAKEN = {
    r"^define [^\n]*@(cfunc|_ZN7cpython).*?^}": "",  # what Python calls
    r"^define [^\n]*(void @NRT_\w+\(ptr).*?^}": r"declare \1)",  # counts by this processor's instructions
    r"@llvm\.(cos|exp|log10|pow|sin|tan)\.f64": r"@\1",  # in PTX no instructions
}


def written(stage):
    """A stage of a flight's frame, whose record is one piece of memory, in PTX, with all that it calls."""
    kernel = getattr(frame, stage)
    kernel.compile((numba.typeof(Loop(load({"duration_s": 1.0})).frames).dtype,))
    (code,) = kernel.inspect_llvm().values()
    for form, other in NOT_TAKEN.items():
        code = re.sub(form, other, code, flags=re.MULTILINE | re.DOTALL)
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine()
    module = llvm.parse_assembly(code)
    module.triple, module.data_layout = TRIPLE, str(machine.target_data)
    return machine.emit_assembly(module)


@pytest.mark.parametrize("stage", ["diagnose", "decide", "command"])
def test_a_stage_wants_nothing_but_mathematics(stage):
    alone = {**os.environ, "BEAVER_FTC_COMPILER": "numba"}
    code = subprocess.check_output([sys.executable, __file__, stage], env=alone, text=True)
    assert re.search(rf"^\.visible \.func .*5frame\d{stage}", code, re.MULTILINE)
    assert {*re.findall(r"^\.extern \.func .*?(\w+)$", code, re.MULTILINE)} <= {*WANTED.split()}


if __name__ == "__main__":
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    print(written(sys.argv[1]))
