"""Commands in a process of their own that has little memory."""

import json
import os
import subprocess
import sys

_CODE = """
import json, resource, sys
resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000, 3_000_000_000))
from beaver_ftc.cli.main import main
statuses = []
for command in json.loads(sys.argv[1]):
    sys.argv = ["beaver-ftc", *command]
    try:
        main()
    except SystemExit as ended:
        statuses.append(ended.code)
print("STATUSES", json.dumps(statuses))
"""


def run(commands):
    """Exit statuses of command lines that share 3 GB, and what all of them say on standard error."""
    done = subprocess.run(
        [sys.executable, "-c", _CODE, json.dumps([list(map(str, command)) for command in commands])],
        check=False,
        capture_output=True,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},  # a thread has memory too
    )
    return json.loads(done.stdout.rpartition("STATUSES")[2] or "null"), done.stderr
