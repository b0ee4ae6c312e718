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


def test_it_is_made_by_its_name_once_the_package_is_imported(tmp_path):
    script = (
        "import beaver_ftc, gymnasium, numpy as np\n"
        "if __name__ == '__main__':\n"
        f"    one = gymnasium.make('{NAME}')\n"
        f"    two = gymnasium.make_vec('{NAME}', num_envs=2)\n"
        "    seen = one.reset(seed=3)[0], *two.reset(seed=np.int64(3))[0]\n"
        "    print(type(two).__name__, [each.shape for each in seen], np.array_equal(seen[0], seen[1]))\n"
        "    one.step(np.zeros(one.action_space.shape)), two.step(np.zeros(two.action_space.shape))\n"
        "    one.close(), two.close()\n"
    )
    (tmp_path / "made.py").write_text(script)
    shown = subprocess.run(
        [sys.executable, "-W", "error", tmp_path / "made.py"], capture_output=True, text=True, check=False
    )
    assert shown.stdout == "BeaverVectorEnv [(16,), (16,), (16,)] True\n", shown.stderr
    assert shown.returncode == 0
