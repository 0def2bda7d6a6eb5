"""Sets up Matplotlib once, so that all figures look the same."""

import io

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (the backend must be chosen before)

from .experiment import Picture  # noqa: E402

DPI, MOST_PNG_BYTES = 130, 100000
GOOD, BAD, BLUE, ORANGE, GREY = "#11794a", "#c3323a", "#1667c1", "#d98a1f", "#8a949e"
pyplot.rcParams.update({
    "font.size": 9, "axes.titlesize": 9.5, "axes.titlelocation": "left", "axes.grid": True,
    "grid.alpha": 0.25, "axes.spines.top": False, "axes.spines.right": False,
    "legend.frameon": False, "legend.fontsize": 8, "figure.constrained_layout.use": True,
    "lines.linewidth": 1.6,
})


def sheet(width, height, *rows_columns, **options):
    """A figure of this size in inches, and its axes."""
    return pyplot.subplots(*rows_columns, figsize=(width, height), **options)


def show(axis, image, title=""):
    """Shows an image, grey or BGR, without axes. Pixel (0, 0) is the centre of the first pixel."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    axis.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axis.set_title(title)
    axis.set_axis_off()
    axis.set_xlim(-0.5, image.shape[1] - 0.5)
    axis.set_ylim(image.shape[0] - 0.5, -0.5)


def finish(figure, alt):
    """Encodes the figure as PNG, or as WebP if photographs make the PNG too large."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    pyplot.close(figure)
    width = round(figure.get_figwidth() * DPI)
    if len(buffer.getvalue()) <= MOST_PNG_BYTES:
        return Picture(buffer.getvalue(), "png", alt, width)
    image = cv2.imdecode(np.frombuffer(buffer.getvalue(), np.uint8), cv2.IMREAD_COLOR)
    return Picture(
        cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, 88])[1].tobytes(),
        "webp",
        alt,
        width,
    )
