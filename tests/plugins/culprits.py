"""Plug-ins that behave, and plug-ins that do not; flown by name from tests."""

import numpy as np

from beaver_ftc.diagnosis import Verdict


class Silent:
    """Sees nothing."""

    def reset(self, context):
        self.context = context

    def step(self, measured, command):
        return Verdict()


class Teller(Silent):
    """Says what it is told to say from a given time on."""

    says = Verdict(True, "q", "elevator", "loss_of_effectiveness", -0.4)
    from_s = 3.0

    def step(self, measured, command):
        return self.says if measured.t_s >= self.from_s - 1e-9 else Verdict()


class Vandal(Silent):
    """Writes into everything it is handed."""

    def step(self, measured, command):
        for array in (measured.x, measured.y, measured.acceleration, measured.contribution, measured.eta_bar):
            array[:] = 1e9
        command[:] = 1e9
        self.context.trim_rad[:] = 1e9
        return Verdict()


class Hold:
    """A law that leaves the surfaces in trim."""

    def reset(self, context):
        self.context = context

    def step(self, measured, reference, verdict):
        return self.context.trim_rad


class NanLaw(Hold):
    """Commands nothing."""

    def step(self, measured, reference, verdict):
        return np.full(4, np.nan)


class ThreeSurfaces(Hold):
    """Forgets the flap."""

    def step(self, measured, reference, verdict):
        return np.zeros(3)


class TextLaw(Hold):
    """Commands text."""

    def step(self, measured, reference, verdict):
        return "up"


class RaisingLaw(Hold):
    """Fails in flight."""

    def step(self, measured, reference, verdict):
        raise IndexError("no such layer")


class Odd:
    """Neither a detector nor a law."""

    def reset(self, context):
        pass

    def step(self):
        pass


class Quits(Silent):
    """Wants to end the program as if all were well."""

    def step(self, measured, command):
        raise SystemExit(0)


class CannotBeMade(Silent):
    """Ends the program before it has begun."""

    def __init__(self):
        raise SystemExit(0)
