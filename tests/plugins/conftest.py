"""Makes culprits.py importable, as a module of an installed package would be."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
