"""What can go wrong, and the exit status each kind ends with."""


class BeaverFtcError(Exception):
    """A failure with a message fit for the user: one line, no traceback."""

    exit_code = 3


class BadInput(BeaverFtcError):
    """The user's input cannot be used: wrong file, key, value, unit, or a flight that cannot be trimmed."""

    exit_code = 2


class SimulationFailed(BeaverFtcError):
    """The simulation could not be completed: a non-finite value, a folder that cannot be written."""

    exit_code = 3
