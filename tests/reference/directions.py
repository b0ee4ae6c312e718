"""The parity directions of an aircraft. Page: statistical.md (parity directions).

Rows: roll (0), pitch (1), yaw (2), side force (3), normal force (4). Columns: surfaces, then the vanes of
sideslip and of angle of attack.
"""

from typing import NamedTuple

from reference.declaration import Declaration

RAW, VANED, VANELESS, INERTIAL = range(4)
SIDE_FORCE, ONSETS, TONES = 3, 10, 16
LATERAL = (0, 2)


class Direction(NamedTuple):
    """Table 2. column: to which it is orthogonal, None for a row by itself. rows: that have a part in it at
    the start. plane: rows of its plane. losses: surfaces for whose loss it tests. reads: what of the flow."""

    column: int | None
    rows: tuple[int, ...]
    plane: tuple[int, int]
    losses: list[int]
    reads: int

    @property
    def of_force(self) -> bool:
        """Whether it contains a force."""
        return self.rows[-1] >= SIDE_FORCE

    @property
    def alarm_axis(self) -> int:
        """The axis that its alarm names."""
        return self.plane[0] if self.reads == INERTIAL else self.rows[0]

    @property
    def tests(self) -> int:
        """One-sided tests by which it may raise the alarm: only where no group of axes tests."""
        if self.of_force and self.reads == VANED:
            return ONSETS * (2 + len(self.losses)) + TONES
        return TONES if self.column is None and self.reads != INERTIAL else 0


def separated(declaration: Declaration, i: int) -> list[int]:
    """Surfaces that force i (0 side, 1 normal) distinguishes: those of roll and yaw, or those of pitch."""
    aircraft = declaration.aircraft
    moved = {t.surface for t in aircraft.forces if t.axis == i + 1}
    found = [s for s, axis in enumerate(aircraft.main_axis) if (axis == 1) == (i == 1) and s in moved]
    return found if len(found) > 1 else []


def uses_forces(declaration: Declaration) -> bool:
    """Whether accelerometers separate surfaces."""
    return declaration.compares_across and any(separated(declaration, i) for i in range(2))


def directions_of(declaration: Declaration) -> list[Direction]:
    """Table 2, in its order; none with `pairs`, several JSBSim steps in a frame, or the worst case alone."""
    if not declaration.compares_across:
        return []
    axes = declaration.aircraft.main_axis.tolist()
    pitch, lateral = ([s for s, axis in enumerate(axes) if (axis == 1) == of_pitch] for of_pitch in (1, 0))

    def others(surfaces: list[int], s: int) -> list[int]:
        return [other for other in surfaces if other != s]

    follows = declaration["bounds.turbulence"] != "none" and all(separated(declaration, i) for i in (0, 1))
    vaned = VANED if follows else RAW
    found = [Direction(None, (1,), (1, 4), pitch, vaned)]
    found += [Direction(None, (0,), LATERAL, lateral, RAW), Direction(None, (2,), LATERAL, lateral, vaned)]
    for s in lateral:
        found.append(Direction(s, (0,), LATERAL, others(lateral, s), RAW if axes[s] else vaned))
    for i, rate, tested in ((1, 1, pitch), (0, 2, lateral)):
        plane = rate, SIDE_FORCE + i
        for s in separated(declaration, i):
            of_it = axes[s], plane[1]
            found.append(Direction(s, of_it, of_it, others(tested, s), VANED))
        if separated(declaration, i):
            found += [Direction(len(axes) + i, plane, plane, tested, VANELESS)]
            found += [Direction(None, plane[1:], plane, tested, INERTIAL)]
    return found
