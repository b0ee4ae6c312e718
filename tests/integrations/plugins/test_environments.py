"""The environment's name is known once both packages are imported, in either order."""

import subprocess
import sys

import pytest

pytest.importorskip("gymnasium")

NAME = "beaver_ftc/Beaver-v0"


@pytest.mark.parametrize("imports", ["beaver_ftc, gymnasium", "gymnasium, beaver_ftc"])
def test_the_name_is_registered_in_either_order_of_imports(imports):
    script = (
        f"import {imports}\n"
        f"spec = gymnasium.spec('{NAME}')\n"
        "print(spec.entry_point, spec.vector_entry_point)\n"
    )
    shown = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False
    )
    assert shown.stderr == ""
    ours = "beaver_ftc.integrations.gym:Beaver"
    assert shown.stdout.split() == [f"{ours}Env", f"{ours}VectorEnv"]


def test_without_gymnasium_nothing_is_imported_for_it():
    script = "import sys, beaver_ftc; print([m for m in sys.modules if m.startswith('gymnasium')])"
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
