"""A Beaver of 17 surfaces: its own in parts, as `tools.split` makes halves of them."""

from tools.split import AILERON_M, FLAP_M, Part

from beaver_ftc.aircraft import load
from tools import split

NAME = "seventeen"


def parts():
    """Six ailerons, five elevators, two rudders, four flaps; all parts of one together are the whole."""
    sides = [("left", -1.0), ("right", 1.0)]
    ailerons = [
        Part(f"aileron_{side}_{k}", sign / 6, sign * (AILERON_M + 0.5 * (k - 1)))
        for side, sign in sides
        for k in range(3)
    ]
    elevators = [Part(f"elevator_{k}", 0.2) for k in range(5)]
    rudders = [Part("rudder_upper", 0.6), Part("rudder_lower", 0.4)]
    flaps = [
        Part(f"flap_{side}_{k}", 0.25, sign * (FLAP_M + k - 0.5)) for side, sign in sides for k in range(2)
    ]
    return {"aileron": ailerons, "elevator": elevators, "rudder": rudders, "flap": flaps}


def files():
    """The files of its folder."""
    names = {surface: [part.name for part in of_it] for surface, of_it in parts().items()}
    first, *others = names["elevator"]
    groups = {
        "pitch": [first, *names["flap"]],
        "elevators": others,
        "roll": names["aileron"],
        "yaw": names["rudder"],
    }
    return split.files(load(), parts(), groups, NAME, "a Beaver of 17 surfaces")


def write(folder):
    """Its folder below this one; returns what a scenario beside it calls it."""
    split.write(folder / NAME, files())
    return f"./{NAME}"
