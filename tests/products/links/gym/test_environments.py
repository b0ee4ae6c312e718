"""The environment's name is known once both packages are imported, in either order."""

import subprocess
import sys

import pytest

pytest.importorskip("gymnasium")

NAME = "beaver_ftc/Beaver-v0"


def test_the_name_is_registered_whichever_is_imported_first():
    script = f"import gymnasium, beaver_ftc; print(gymnasium.spec('{NAME}').vector_entry_point)"
    shown = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=False
    )
    assert (shown.stdout, shown.stderr) == ("beaver_ftc_links.gym:BeaverVectorEnv\n", "")
