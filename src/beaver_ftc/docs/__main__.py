"""Write the generated documentation into `docs/` of a source tree: `python -m beaver_ftc.docs`."""

import sys

from beaver_ftc.docs.generate import write_docs
from beaver_ftc.errors import BeaverFtcError

try:
    for written in write_docs():
        print(written)
except BeaverFtcError as error:
    sys.exit(str(error))
