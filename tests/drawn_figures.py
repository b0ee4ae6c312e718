"""What a figure shows, in words and numbers: what a reader can take from it."""

import numpy as np
from matplotlib.colors import to_rgba_array

from kept import in_short

NAMES = ("title", "xlabel", "ylabel", "xscale", "yscale", "xlim", "ylim")


def shown(figure):
    """The texts and panels of a figure of matplotlib."""
    return {
        "title": figure.get_suptitle(),
        "inches": figure.get_size_inches(),
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
        "texts": [[text.get_text(), *map(float, text.get_position()), *_type(text)] for text in axes.texts],
        "types": [_type(text) for text in (axes.title, axes.xaxis.label, *axes.get_xticklabels()[:1])],
        "grid": [_look(line) for line in (*axes.get_xgridlines()[:1], *axes.get_ygridlines()[:1])],
        "curves": [[_look(line), *map(in_short, line.get_data())] for line in axes.lines],
        # In the unit of the axes: where they lie on the page hangs on fonts.
        "patches": [
            [_hue(of), in_short(of.get_patch_transform().transform_path(of.get_path()).vertices)]
            for of in axes.patches
        ],
        "areas": [
            [
                _hue(area),
                *(in_short(path.vertices) for path in area.get_paths()),
                in_short(area.get_offsets()),
            ]
            for area in axes.collections
        ],
        "pictures": [
            [in_short(np.ma.filled(image.get_array(), np.nan)), *image.get_clim()] for image in axes.images
        ],
    }


def _look(line):
    if not line.get_visible():
        return ""
    look = line.get_color(), line.get_linestyle(), line.get_marker(), line.get_linewidth(), line.get_alpha()
    return f"{line.get_label()}: {' '.join(map(str, look))}"


def _hue(area):
    """Colours of a patch, or of the areas of a collection."""
    return f"{to_rgba_array(area.get_facecolor()).round(4).tolist()} {np.atleast_1d(area.get_linewidth())}"


def _type(text):
    return text.get_fontsize(), text.get_color(), text.get_rotation()


def _words(texts):
    return [text.get_text() for text in texts]
