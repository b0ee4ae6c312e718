"""Counts lines in every Python process that a test starts, while measure.py measures what tests execute.

PYTHONPATH makes Python import this module first; the environment has the name of the test.
"""

import atexit
import os
from pathlib import Path

if "MUTANTS_TEST" in os.environ:
    import coverage

    _watch = coverage.Coverage(
        data_file=os.environ["MUTANTS_LINES"], data_suffix=True, context=os.environ["MUTANTS_TEST"],
        source=[str(Path(__file__).parents[2] / "src")], config_file=False, messages=False,
    )  # fmt: skip
    _watch.start()
    atexit.register(_watch.save)
