"""What a figure shows, in words and numbers: what a reader can take from it."""

import numpy as np
from matplotlib.colors import to_hex

from kept import in_short

NAMES = ("title", "xlabel", "ylabel", "xscale", "yscale", "xlim", "ylim")


def shown(figure):
    """The texts and panels of a figure of matplotlib."""
    return {
        "title": figure.get_suptitle(),
        "legends": [_words(legend.texts) for legend in figure.legends],
        "panels": [_panel(axes) for axes in figure.axes],
    }


def _panel(axes):
    """Limits, words, curves, areas and pictures of a panel; many numbers in short."""
    legend = axes.get_legend()
    return {
        **{name: getattr(axes, f"get_{name}")() for name in NAMES},
        "ticks": [_words(axes.get_xticklabels()), _words(axes.get_yticklabels())],
        "legend": _words(legend.texts) if legend else [],
        "texts": [[text.get_text(), *map(float, text.get_position())] for text in axes.texts],
        "curves": [[_look(line), *map(in_short, line.get_data())] for line in axes.lines],
        # In the unit of the axes: where they lie on the page hangs on fonts.
        "patches": [
            in_short(of.get_patch_transform().transform_path(of.get_path()).vertices) for of in axes.patches
        ],
        "areas": [
            [in_short(path.vertices) for path in area.get_paths()] + [in_short(area.get_offsets())]
            for area in axes.collections
        ],
        "pictures": [
            [in_short(np.ma.filled(image.get_array(), np.nan)), *image.get_clim()] for image in axes.images
        ],
    }


def _look(line):
    return f"{line.get_label()}: {to_hex(line.get_color())} {line.get_linestyle()} {line.get_marker()}"


def _words(texts):
    return [text.get_text() for text in texts]
