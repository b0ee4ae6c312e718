"""Groups of surfaces that move together: their commands are proportional to one another.

Healthy surfaces of a group move together, so no fit can distinguish their effects: a group has one response.
Shapes: n samples, G groups, S surfaces, C commands.
"""

import numpy as np

from beaver_ftc_logs.model import Model
from beaver_ftc_logs.recording import Floats, Mask
from beaver_ftc_logs.samples import Samples, mixer_matrix
from beaver_ftc_logs.vehicle import Vehicle

_PARALLEL_TOLERANCE = 1e-9  # rounding of the squared cosine of two rows of the mixer

# Each group is a list of positions in `Vehicle.surfaces`.
Groups = list[list[int]]


def group_surfaces(vehicle: Vehicle) -> Groups:
    """The surfaces in groups whose commands are proportional. m and f, the rows of the mixer of a surface and
    of the first surface of a group, are proportional if, but for rounding,

        (m.f)^2 = |m|^2 |f|^2
    """
    M = mixer_matrix(vehicle)
    groups: Groups = []
    for i, m in enumerate(M):
        for group in groups:
            first = M[group[0]]
            if (m @ first) ** 2 >= (1.0 - _PARALLEL_TOLERANCE) * (m @ m) * (first @ first):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def group_commands(samples: Samples, groups: Groups, labelled: bool) -> Floats:
    """The command of each group, (n, G): the sum of those of its surfaces. labelled: whether the command of
    each surface is first multiplied by its labelled effectiveness, 1 where there is no label."""
    commands = samples.commands
    if labelled:
        commands = commands * np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    return np.column_stack([commands[:, group].sum(axis=1) for group in groups])


def group_indices(model: Model) -> Groups:
    """The model's groups as positions of their surfaces."""
    names = list(model.vehicle.surfaces)
    return [[names.index(name) for name in group] for group in model.groups]


def expand_groups(values: Floats | Mask, model: Model) -> Floats:
    """Columns of groups (n, G) as columns of surfaces (n, S): the column of the surface's group, 1 if it has
    none."""
    index = np.full(len(model.vehicle.surfaces), -1)
    for g, group in enumerate(group_indices(model)):
        index[group] = g
    return np.take(np.column_stack([values, np.ones(len(values))]), index, axis=1)
