"""JSBSim's XML by small words: values, properties, operations, tables.

JSBSim's tables hold their ends. Where the data go on in a straight line instead, a table gets one breakpoint
more on either side, far out, on the line through its last two.
"""

from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape

import numpy as np

FAR_ALPHA_DEG, FAR_BETA_DEG = 180.0, 90.0  # where these angles end
FAR_HAT = 10.0  # a dimensionless rate no flight has
_DIGITS = ".13g"


def value(number: float) -> str:
    """A number."""
    return f"<value>{float(number)!r}</value>"


def read(name: str) -> str:
    """The value of a property."""
    return f"<property>{name}</property>"


def triple(of: Iterable[float]) -> str:
    """Three numbers, along x, y and z."""
    return "".join(f"<{axis}>{float(number)!r}</{axis}>" for axis, number in zip("xyz", of, strict=True))


def do(operation: str, *arguments: str | float) -> str:
    """An operation on its arguments, numbers among them; on one alone a sum or product has nothing to do."""
    parts = [of if isinstance(of, str) else value(of) for of in arguments]
    if operation in ("sum", "product") and len(parts) == 1:
        return parts[0]
    return f"<{operation}>{''.join(parts)}</{operation}>"


def unless_zero(name: str, otherwise: str) -> str:
    """What is looked up only if a property is not zero."""
    return do("ifthen", do("eq", read(name), 0.0), 0.0, otherwise)


def function(name: str, says: str, body: str) -> str:
    """A function outside of the axes: a property of this name."""
    return f'<function name="{name}"><description>{escape(says)}</description>{body}</function>'


def component(name: str, says: str, body: str, output: str = "") -> str:
    """A function of the flight control, which keeps its value until it is run again."""
    inside = f"<description>{escape(says)}</description><function>{body}</function>"
    out = f"<output>{output}</output>" if output else ""
    return f'<fcs_function name="{name}">{inside}{out}</fcs_function>'


def declared(name: str, initial: float = 0.0) -> str:
    """A property that somebody may set."""
    return f'<property value="{initial!r}">{name}</property>'


def extended(data: np.ndarray, grid: np.ndarray, far: float, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Data and grid with a breakpoint more at -far and far, on the straight lines through the last two."""
    values = np.moveaxis(data, axis, 0)

    def on(end: float, inner: int, outer: int) -> np.ndarray:
        slope = (values[outer] - values[inner]) / (grid[outer] - grid[inner])
        return np.asarray(values[outer] + slope * (end - grid[outer]))

    longer = np.concatenate([[on(-far, 1, 0)], values, [on(far, -2, -1)]])
    return np.moveaxis(longer, 0, axis), np.concatenate([[-far], grid, [far]])


def table(data: np.ndarray, keys: Sequence[tuple[str, np.ndarray]], name: str = "") -> str:
    """A table of one, two or three keys, each a property and its breakpoints."""
    lookups = ("row", "column", "table")[: len(keys)]
    variables = "".join(
        f'<independentVar lookup="{lookup}">{key}</independentVar>'
        for lookup, (key, _) in zip(lookups, keys, strict=True)
    )
    grids = [grid for _, grid in keys]
    if len(keys) == 3:
        slabs = "".join(
            f'<tableData breakPoint="{point!r}">{_rows(data[..., i], grids)}</tableData>'
            for i, point in enumerate(map(float, grids[2]))
        )
    else:
        slabs = f"<tableData>{_rows(data, grids)}</tableData>"
    named = f' name="{name}"' if name else ""
    return f"<table{named}>{variables}{slabs}</table>"


def _rows(data: np.ndarray, grids: Sequence[np.ndarray]) -> str:
    head = [_line(grids[1])] if len(grids) > 1 else []
    rows = data.reshape(len(grids[0]), -1)
    return (
        "\n" + "\n".join(head + [_line([key, *row]) for key, row in zip(grids[0], rows, strict=True)]) + "\n"
    )


def _line(numbers: Iterable[float]) -> str:
    return " ".join([format(float(number), _DIGITS) for number in numbers])


def piecewise(key: str, grid: Sequence[float], values: Sequence[str]) -> str:
    """Straight lines between values at breakpoints of a property, going on beyond both ends; an empty value
    is zero. Only the two it needs are worked out."""
    if len(grid) == 2:
        (low, high), (at_low, at_high) = grid, values
        parts = [
            do("product", do("quotient", do("difference", read(key), other), here - other), at)
            for here, other, at in ((low, high, at_low), (high, low, at_high))
            if at
        ]
        return do("sum", *parts) if parts else value(0.0)
    middle = len(grid) // 2
    below = piecewise(key, grid[: middle + 1], values[: middle + 1])
    above = piecewise(key, grid[middle:], values[middle:])
    return do("ifthen", do("lt", read(key), grid[middle]), below, above)
