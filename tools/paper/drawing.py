"""Matplotlib, set up once: the same look for every figure."""

import io

import cv2
import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (after the backend)

from experiment import Picture  # noqa: E402

DPI = 130
GOOD, BAD, BLUE, ORANGE, GREY = "#11794a", "#c3323a", "#1667c1", "#d98a1f", "#8a949e"
pyplot.rcParams.update({
    "font.size": 9, "axes.titlesize": 9.5, "axes.titlelocation": "left", "axes.grid": True,
    "grid.alpha": 0.25, "axes.spines.top": False, "axes.spines.right": False,
    "legend.frameon": False, "legend.fontsize": 8, "figure.constrained_layout.use": True,
    "lines.linewidth": 1.6,
})


def sheet(width, height, *rows_columns, **options):
    """A figure of so many inches and its axes."""
    return pyplot.subplots(*rows_columns, figsize=(width, height), **options)


def show(axis, image, title=""):
    """An image, grey or BGR, without axes; pixel (0, 0) is the centre of the first."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
    axis.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
    axis.set_title(title)
    axis.set_axis_off()
    axis.set_xlim(-0.5, image.shape[1] - 0.5)
    axis.set_ylim(image.shape[0] - 0.5, -0.5)


def finish(figure, alt):
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    pyplot.close(figure)
    return Picture(smaller(buffer.getvalue()), alt, round(figure.get_figwidth() * DPI))


def smaller(png):
    """The same picture in 256 colours where that saves bytes."""
    from PIL import Image
    image = Image.open(io.BytesIO(png)).convert("RGB")
    buffer = io.BytesIO()
    image.quantize(256, dither=Image.Dither.FLOYDSTEINBERG).save(buffer, "PNG", optimize=True)
    return min(png, buffer.getvalue(), key=len)
