"""Reads the data sets (pairs, images, cameras) in the same way as `twoview evaluate`."""

import functools
import hashlib
import os

import numpy as np

from .. import ROOT, formats
from ..sizes import MAX_NATIVE_SIDE, RESIZE_LONG_SIDE

# The sets of wide baselines and changes of scale; every other set is of the group "narrow", as the
# data's README.md defines both.
WIDE_SETS = ("strecha_fountain_P11", "strecha_Herz_Jesus_P8", "middlebury_templeSR",
             "middlebury_dinoSR", "fox_wall", "pc_room", "desk_monitors", "tankard")
GROUPS = ("narrow", "wide")
# The sets of wide baselines that came last; the ten sets before them had a published mean.
NEW_SETS = ("fox_wall", "pc_room", "desk_monitors", "tankard")
# For these sets the truth of pairs_flagged.txt is from a calibrated gantry and is reliable;
# "flagged" only means that plain SIFT could not confirm the pair.
FLAGGED_SETS = ("middlebury_dinoSR", "middlebury_templeSR")


def data_dir():
    return os.environ.get("TWOVIEW_DATA") or os.path.join(os.path.dirname(ROOT), "shared", "data")


def all_sets(folder=None):
    """The names of the sets that have a pairs.txt."""
    folder = folder or data_dir()
    if not os.path.isdir(folder):
        return []
    return sorted(name for name in os.listdir(folder)
                  if os.path.isfile(os.path.join(folder, name, "pairs.txt")))


def group_of(name):
    """The group of a set: "narrow" or "wide"."""
    return "wide" if name in WIDE_SETS else "narrow"


def by_group(names):
    """{group: the names of its sets}, in the order of GROUPS and without empty groups."""
    found = {group: [n for n in names if group_of(n) == group] for group in GROUPS}
    return {group: members for group, members in found.items() if members}


def select_sets(names=None, groups=None):
    """The names of the sets to measure. `names` and `groups` are lists separated by commas; None
    means all. A ValueError says what there is not."""
    have = all_sets()
    if not have:
        raise ValueError(f"no sets with pairs in {data_dir()}; set TWOVIEW_DATA")
    chosen = names.split(",") if names else have
    missing = sorted(set(chosen) - set(have))
    if missing:
        raise ValueError(f"no pairs.txt in {', '.join(missing)}; there are {', '.join(have)}")
    if groups:
        unknown = sorted(set(groups.split(",")) - set(GROUPS))
        if unknown:
            raise ValueError(f"no group {', '.join(unknown)}; there are {', '.join(GROUPS)}")
        chosen = [name for name in chosen if group_of(name) in groups.split(",")]
        if not chosen:
            raise ValueError(f"none of the sets is of the group {groups}")
    return chosen


def read_measurable(path, needs_truth=True):
    """The pairs of a file. Each must have K, no turns, and the truth if it is needed; otherwise a
    ValueError names the line."""
    pairs = formats.read_pairs(path)
    for pair in pairs:
        lack = ("no K" if pair.K0 is None else "no true pose" if needs_truth and pair.R is None
                else "turned images are not measured here" if any(pair.turns) else "")
        if lack:
            raise ValueError(f"{path}: line {pair.number}: {pair.name0} {pair.name1}: {lack}")
    return pairs


def read_cameras(set_dir):
    """{entry: formats.Camera} of a set's cameras.yaml; empty if the set has none."""
    path = os.path.join(set_dir, "cameras.yaml")
    return formats.read_camera_set(path) if os.path.isfile(path) else {}


def distortion_of(camera):
    """The distortion coefficients k1 k2 p1 p2 k3 of a formats.Camera; zeros if there is none.
    ValueError for a lens that has more."""
    k = list(camera.k) if camera else []
    if any(k[5:]):
        raise ValueError("a lens of more than five coefficients is not for these sets")
    return (k + [0.0] * 5)[:5]


def resized_shape(width, height, resize):
    """(width, height) with the long side reduced to `resize`; images are never enlarged. 0 or None
    means no resizing."""
    longer = max(width, height)
    if not resize or longer <= resize:
        return width, height
    return tuple(max(1, int(side * resize / longer + 0.5)) for side in (width, height))


def scale_K(K, scale_x, scale_y):
    """K of a resized image. Pixel (0, 0) is the centre of a pixel. The two factors can differ
    slightly because the shorter side is rounded."""
    scale = np.array([scale_x, scale_y])
    scaled = np.array(K, float)
    scaled[:2] *= scale[:, None]
    scaled[:2, 2] = scale * (K[:2, 2] + 0.5) - 0.5
    return scaled


def default_resize(width, height):
    """The default size of the tables: native if no side is longer than MAX_NATIVE_SIDE, otherwise
    long side RESIZE_LONG_SIDE."""
    return RESIZE_LONG_SIDE if max(width, height) > MAX_NATIVE_SIDE else 0


def undistort(points, K, distortion):
    """Converts distorted pixels (n x 2) to normalised undistorted points (Brown-Conrady) by
    Newton's method; NaN where it does not converge."""
    points = np.asarray(points, float).reshape(-1, 2)
    target = (points - K[:2, 2]) / [K[0, 0], K[1, 1]]
    if not any(distortion):
        return target
    k1, k2, p1, p2, k3 = distortion
    x, y = target.T.copy()
    for _ in range(50):
        s = x * x + y * y
        radial = 1 + s * (k1 + s * (k2 + s * k3))
        slope = k1 + s * (2 * k2 + 3 * k3 * s)  # d radial / d s
        error_x = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x) - target[:, 0]
        error_y = y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y - target[:, 1]
        xx = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
        xy = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
        yy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
        with np.errstate(all="ignore"):
            determinant = xx * yy - xy * xy
            x = x - (yy * error_x - xy * error_y) / determinant
            y = y - (xx * error_y - xy * error_x) / determinant
    with np.errstate(invalid="ignore"):
        bad = ~(np.hypot(error_x, error_y) < 1e-9)
    x[bad] = y[bad] = np.nan
    return np.column_stack([x, y])


def read_luma(path):
    """The luma of an image file, computed from its colours as the program does, so that it does not
    depend on the file format. (If OpenCV is asked for grey, it returns a JPEG's own luma.)"""
    import cv2
    image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype != np.uint8:
        raise ValueError(f"{path}: no image, or not of 8 bits")
    if image.ndim == 3:
        codes = {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
        image = cv2.cvtColor(image, codes[image.shape[2]])
    return image


def resized_luma(path, resize):
    """(8-bit luma with the long side reduced to `resize`, scale in x, scale in y)."""
    import cv2
    image = read_luma(path)
    height, width = image.shape
    size = resized_shape(width, height, resize)
    if size != (width, height):
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(image), size[0] / width, size[1] / height


class Set:
    """A data set. An image stays in memory after it was first read."""

    def __init__(self, set_dir, resize=None, flagged=False, max_pairs=None):
        """resize: the long side in pixels, 0 for the native size, None for the size of the tables.
        max_pairs: use this many pairs, evenly spaced."""
        self.dir = set_dir
        self.max_pairs = max_pairs
        self.name = os.path.basename(os.path.normpath(set_dir))
        self.pair_files = [os.path.join(set_dir, "pairs.txt")]
        flagged_file = os.path.join(set_dir, "pairs_flagged.txt")
        if flagged and self.name in FLAGGED_SETS and os.path.isfile(flagged_file):
            self.pair_files.append(flagged_file)
        self.pairs = [pair for path in self.pair_files for pair in read_measurable(path)]
        if max_pairs and max_pairs < len(self.pairs):
            step = np.linspace(0, len(self.pairs) - 1, max_pairs)
            self.pairs = [self.pairs[i] for i in sorted(set(np.round(step).astype(int)))]
        self.cameras = read_cameras(set_dir)
        if resize is None:
            resize = default_resize(*self._native_size(self.pairs[0].name0))
        self.resize = resize

    def path(self, name):
        return os.path.join(self.dir, "images", name)

    def _native_size(self, name):
        image = read_luma(self.path(name))
        return image.shape[1], image.shape[0]

    @functools.lru_cache(maxsize=None)
    def gray(self, name):
        """(8-bit luma, scale in x, scale in y) of an image."""
        return resized_luma(self.path(name), self.resize)

    @functools.lru_cache(maxsize=None)
    def pixel_hash(self, name):
        """A hash of the file and of its decoded and resized pixels."""
        digest = hashlib.sha256(self.gray(name)[0].tobytes())
        with open(self.path(name), "rb") as f:
            digest.update(f.read())
        return digest.hexdigest()

    def camera(self, pair, side):
        """(K scaled to the images in use, distortion) of image `side` of a pair."""
        name, K = ((pair.name0, pair.K0), (pair.name1, pair.K1))[side]
        camera = formats.choose_camera(self.cameras, name, K)
        return scale_K(K, *self.gray(name)[1:]), distortion_of(camera)

    def max_size(self):
        """The smallest (width, height) that contains every image of the pairs."""
        shapes = [self.gray(n)[0].shape for p in self.pairs for n in (p.name0, p.name1)]
        return max(s[1] for s in shapes), max(s[0] for s in shapes)


@functools.lru_cache(maxsize=2)
def load(set_dir, flagged, max_pairs):
    """A Set, the last two of which stay in memory with their images: for a process that gets one
    piece of work after another."""
    return Set(set_dir, flagged=flagged, max_pairs=max_pairs)
