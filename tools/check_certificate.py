"""The checker of certificates that goes along with the package, from a checkout without an installation:

python tools/check_certificate.py FOLDER
"""

import runpy
from pathlib import Path

CHECKER = Path(__file__).parents[1] / "src/beaver_ftc_assurance/certificates/check_certificate.py"

if __name__ == "__main__":
    runpy.run_path(str(CHECKER), run_name="__main__")
