"""Figure 7: a SIFT descriptor's gradients and histograms.

D. G. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004, section 6, as
described in docs/algorithms/sift.md. It is computed here in floating point with angles,
independently of the library's integer code."""

import numpy as np

from . import corners, drawing
from .experiment import Experiment, Missing, Result
from .inputs import library

SIDE = 16  # samples along a side of a patch, which give 15 gradients
STEP = 0.28  # distance between samples, as a share of a cell's side
CELL_SIZE = 1.5  # side of a cell, as a multiple of the keypoint's diameter
MAX_STEP = 2.24  # largest distance between samples, in pixels of the octave


def octave(image, size):
    """(the image, halved as often as the keypoint's size requires and blurred; the factor by which
    it is smaller)."""
    pixels, scale = image.astype(int), 1
    while size * CELL_SIZE * STEP / scale >= MAX_STEP:
        height, width = pixels.shape[0] // 2, pixels.shape[1] // 2
        quads = pixels[:2 * height, :2 * width].reshape(height, 2, width, 2)
        pixels, scale = (quads.sum(axis=(1, 3)) + 2) // 4, 2 * scale
    padded = np.pad(pixels, 1, mode="edge")
    rows = padded[:-2] + 2 * padded[1:-1] + padded[2:]
    return (rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:] + 8) // 16, scale


def bilinear(image, x, y):
    x = np.clip(x, 0, image.shape[1] - 1)
    y = np.clip(y, 0, image.shape[0] - 1)
    x0 = np.minimum(x.astype(int), image.shape[1] - 2)
    y0 = np.minimum(y.astype(int), image.shape[0] - 2)
    fx, fy = x - x0, y - y0
    return ((1 - fy) * ((1 - fx) * image[y0, x0] + fx * image[y0, x0 + 1])
            + fy * ((1 - fx) * image[y0 + 1, x0] + fx * image[y0 + 1, x0 + 1]))


def patch(image, keypoint):
    """16 x 16 samples around the keypoint, rotated by its angle."""
    blurred, scale = octave(image, keypoint["size"])
    step = keypoint["size"] * CELL_SIZE * STEP / scale
    u, v = np.meshgrid(*2 * [(np.arange(SIDE) - (SIDE - 1) / 2) * step])
    cosine, sine = np.cos(keypoint["angle_rad"]), np.sin(keypoint["angle_rad"])
    x, y = ((keypoint[axis] + 0.5) / scale - 0.5 for axis in ("x", "y"))
    return bilinear(blurred.astype(float), x + cosine * u - sine * v, y + sine * u + cosine * v)


def gradients(samples):
    """The gradients (15, 15) along x and along y (down), from the diagonals of four samples."""
    u = samples[1:, 1:] - samples[:-1, :-1]
    v = samples[:-1, 1:] - samples[1:, :-1]
    return (u + v) / np.sqrt(2), (u - v) / np.sqrt(2)


def cell_weights():
    """(4, 15): along one axis, the weight of each of the 15 gradients in each of the 4 cells."""
    p = STEP * (np.arange(SIDE - 1) - (SIDE - 2) / 2)
    c = np.arange(4)[:, None]
    return np.exp(-p ** 2 / 8) * np.maximum(0, 1 - np.abs(p + 1.5 - c))


def direction_shares(gx, gy):
    """(8, 15, 15): each gradient as the sum of two vectors along the nearest of 8 directions, which
    are counter-clockwise in the image."""
    length, angle = np.hypot(gx, gy), np.arctan2(-gy, gx) % (2 * np.pi)
    eighth = np.pi / 4
    low = (angle // eighth).astype(int) % 8
    rest = angle - eighth * (angle // eighth)
    shares = np.zeros((8, *gx.shape))
    for k in range(8):
        shares[k] += np.where(low == k, length * np.sin(eighth - rest) / np.sin(eighth), 0)
        shares[k] += np.where((low + 1) % 8 == k, length * np.sin(rest) / np.sin(eighth), 0)
    return shares


def histograms(samples):
    """The histograms (4, 4, 8): cell row, cell column, direction."""
    weights = cell_weights()
    return np.einsum("ay,bx,kyx->abk", weights, weights, direction_shares(*gradients(samples)))


def quantised(histogram, root):
    """The 128 bytes of the descriptor: clipped at 0.2 of the norm, then with SIFT's norm of 512 or
    as RootSIFT."""
    values = histogram.ravel()
    values = np.minimum(values, 0.2 * np.linalg.norm(values))
    if not values.any():
        return np.zeros(128, np.uint8)
    scaled = 512 * (np.sqrt(values / values.sum()) if root else values / np.linalg.norm(values))
    return np.minimum(np.floor(scaled + 0.5), 255).astype(np.uint8)


def describe(image, keypoint, root):
    """The descriptor of a keypoint, computed from the definition."""
    return quantised(histograms(patch(image, keypoint)), root)


def described_keypoints(image, count):
    """Detects at most `count` keypoints, each at its corner's pixel, as figure 5 has it. Returns
    them with their SIFT and RootSIFT descriptors."""
    tv = library()
    with tv.Context(max_width=image.shape[1], max_height=image.shape[0]) as context:
        corners = tv.detect(context, image, arc=12, threshold=10, levels=1, cell_px=0,
                            subpixel=0)
        keypoints = tv.orient(context, image, corners)[:count]
        keypoints = np.ascontiguousarray(keypoints)
        return keypoints, {kind: tv.describe(context, image, keypoints, descriptor=value)
                           for kind, value in (("sift", tv.Normalisation.SIFT),
                                               ("rootsift", tv.Normalisation.ROOTSIFT))}


def differences(image, keypoints, described):
    """{kind: (n, 128) absolute differences between the library's bytes and those of the
    definition}."""
    found = {}
    for kind, bytes_ in described.items():
        own = np.array([describe(image, k, kind == "rootsift") for k in keypoints])
        found[kind] = np.abs(own.astype(int) - bytes_)
    return found


def draw_place(axis, image, keypoint):
    drawing.show(axis, image, "The keypoint's window of 4 x 4 cells")
    half = 2 * CELL_SIZE * keypoint["size"]
    turn = np.array([[np.cos(keypoint["angle_rad"]), -np.sin(keypoint["angle_rad"])],
                     [np.sin(keypoint["angle_rad"]), np.cos(keypoint["angle_rad"])]])
    middle = np.array([keypoint["x"], keypoint["y"]])
    for k in np.linspace(-half, half, 5):
        for ends in (((k, -half), (k, half)), ((-half, k), (half, k))):
            axis.plot(*(middle + np.array(ends) @ turn.T).T, color="#ffd34d", linewidth=1)
    axis.annotate("", middle + turn @ (1.4 * half, 0), middle,
                  arrowprops={"arrowstyle": "->", "color": drawing.BAD, "linewidth": 1.8})
    reach = 2.2 * half
    axis.set_xlim(middle[0] - reach, middle[0] + reach)
    axis.set_ylim(middle[1] + reach, middle[1] - reach)


def draw_cells(axis, spacing, start):
    for k in range(5):
        for ends in (((start + k * spacing,) * 2, (start, start + 4 * spacing)),
                     ((start, start + 4 * spacing), (start + k * spacing,) * 2)):
            axis.plot(*ends, color="#ffd34d", linewidth=1, zorder=1)


def draw_gradients(axis, samples):
    drawing.show(axis, np.clip(samples, 0, 255), "The 16 x 16 samples, turned, and their gradients")
    k = np.arange(SIDE - 1) + 0.5
    gx, gy = gradients(samples)
    axis.quiver(
        k,
        k,
        gx,
        -gy,
        color="#3fb6ff",
        scale_units="xy",
        scale=np.hypot(gx, gy).max() / 1.6,
        width=0.006,
    )
    draw_cells(axis, 1 / STEP, (SIDE - 1) / 2 - 2 / STEP)


def draw_histograms(axis, histogram):
    axis.set_title("16 histograms of 8 directions")
    axis.set_aspect("equal")
    axis.set_axis_off()
    draw_cells(axis, 1, 0)
    angles = np.arange(8) * np.pi / 4
    longest = histogram.max() / 0.48
    for row in range(4):
        for column in range(4):
            for length, angle in zip(histogram[row, column] / longest, angles):
                if length < 0.02:
                    continue  # an arrow this short has no room for its head
                axis.annotate(
                    "",
                    (column + 0.5 + length * np.cos(angle), row + 0.5 - length * np.sin(angle)),
                    (column + 0.5, row + 0.5),
                    arrowprops={
                        "arrowstyle": "-|>,head_width=0.1,head_length=0.16",
                        "color": drawing.BLUE,
                        "shrinkA": 0,
                        "shrinkB": 0,
                        "linewidth": 1.1,
                    },
                )
    axis.set_xlim(-0.1, 4.1)
    axis.set_ylim(4.1, -0.1)


def draw_bytes(axis, ours, definition):
    axis.bar(np.arange(128), ours, width=1.0, color=drawing.BLUE, label="twoview")
    axis.plot(np.arange(128), definition, ".", color=drawing.BAD, markersize=3,
              label="the histograms above, clipped and scaled")
    for k in range(8, 128, 8):
        axis.axvline(k - 0.5, color="#ccd2d8", linewidth=0.6, zorder=0)
    axis.set_xlim(-0.5, 127.5)
    axis.set_xticks(range(4, 128, 8), [f"{k // 4},{k % 4}" for k in range(16)])
    axis.set_xlabel("cell (row, column), 8 directions each")
    axis.set_title("The 128 bytes, plain SIFT")
    axis.grid(False)
    axis.legend(loc="upper right", ncols=2)


def example(image, keypoints):
    """The index of the keypoint at the corner that figure 5 shows. Raises Missing if there is
    none."""
    corner = corners.example_corner(image)
    off = np.hypot(keypoints["x"] - corner["x"], keypoints["y"] - corner["y"])
    if off.min() > 0:
        raise Missing("the keypoint of figure 5")
    return int(off.argmin())


def figure7(inputs):
    image = inputs.motorcycle.grey[0]
    keypoints, described = described_keypoints(image, 500)
    off = differences(image, keypoints, described)
    chosen = example(image, keypoints)
    samples = patch(image, keypoints[chosen])
    histogram = histograms(samples)
    sheet = drawing.pyplot.figure(figsize=(11, 6.4))
    grid = sheet.add_gridspec(2, 3, height_ratios=(1.55, 1))
    draw_place(sheet.add_subplot(grid[0, 0]), image, keypoints[chosen])
    draw_gradients(sheet.add_subplot(grid[0, 1]), samples)
    draw_histograms(sheet.add_subplot(grid[0, 2]), histogram)
    draw_bytes(
        sheet.add_subplot(grid[1, :]), described["sift"][chosen], quantised(histogram, False)
    )
    keypoint = keypoints[chosen]
    numbers = {
        "keypoint": {name: float(keypoint[name]) for name in ("x", "y", "size", "angle_rad")},
        "descriptor": described["sift"][chosen].tolist(),
        "keypoints_compared": len(keypoints),
    }
    for kind, difference in off.items():
        numbers[kind] = {
            "median": float(np.median(difference)),
            "p99": float(np.percentile(difference, 99)),
            "greatest": int(difference.max()),
            "of_the_drawn": int(off[kind][chosen].max()),
        }
    found = (
        f"The descriptor at figure 5's corner, angle {np.degrees(keypoint['angle_rad']):.1f} "
        f"degrees. The "
        "histograms are computed here in floating point from the definition; clipped and scaled, "
        "they "
        f"are the library's 128 bytes within {numbers['sift']['of_the_drawn']} of 255. Over "
        f"{len(keypoints)} keypoints: 99 % of the bytes within {numbers['sift']['p99']:.0f}, all "
        f"within "
        f"{numbers['sift']['greatest']}."
    )
    return Result(
        numbers,
        found,
        [drawing.finish(sheet, "A keypoint's window, gradients, histograms and " "bytes")],
    )


EXPERIMENTS = [
    Experiment(
        "figure7",
        "SIFT descriptors",
        "Figure 7: a descriptor's gradients and histograms",
        "The gradients around a keypoint, and the histograms of 4 x 4 cells with 8 directions that "
        "they are gathered into: 128 numbers.",
        "Lowe's window and weights, but sampled on a turned grid of 16 x 16 out of one blurred "
        "image: "
        "the number of samples no longer grows with the keypoint, and shares between directions "
        "need "
        "no arctangent (docs/decisions/0003-patch-sift.md). The bytes "
        "stay "
        "comparable with OpenCV's and COLMAP's: median cosine 0.99 with OpenCV's SIFT. Our default "
        "is "
        "RootSIFT, the square roots of the same shares.",
        figure7,
    )
]
