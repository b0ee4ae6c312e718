"""What all tests share: the helpers of tests/flying.py, and property tests that repeat themselves."""

import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))

# No deadline: a first call compiles. Derandomised: a red build can be repeated.
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")
