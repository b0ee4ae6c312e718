"""How many draws a test makes: all of them at night, an eighth by day.

By day a defect that one draw in six shows is still found by some of the tests that draw; what only a rare
draw shows is found the night after. `make nightly` sets the variable.
"""

import os

VARIABLE = "BEAVER_FTC_NIGHT"
AT_NIGHT = os.environ.get(VARIABLE, "0") != "0"
PART, FEWEST = 8, 3


def samples(whole: int) -> int:
    """Of so many draws, those to make now."""
    return whole if AT_NIGHT else min(whole, max(whole // PART, FEWEST))
