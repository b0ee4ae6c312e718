"""Write the generated documentation into `docs/` of a source tree: `python -m tools.docs`."""

import sys

from beaver_ftc.documents.errors import BeaverFtcError
from tools.docs.generate import write_docs

try:
    for written in write_docs():
        print(written)
except BeaverFtcError as error:
    sys.exit(str(error))
