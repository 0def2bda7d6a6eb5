"""Rectified pairs whose depth is known: tv_densify beside OpenCV's semi-global matching. As a
program it measures both in turn, in one thread, and prints the table of
docs/decisions/0027-dense.md: python bench/dense_pairs.py [ROUNDS], with PYTHONPATH=python and
TWOVIEW_LIBRARY=build/release/lib/libtwoview.so.

motorcycle      Middlebury 2014 as scikit-image ships it (scripts/demo fetches it), with its truth.
bicycle         Middlebury 2014, half size. The set has no truth: what is known is what matching the
                pictures at twice the size gives, where two block sizes and both directions agree.
plain room      Rendered: a room whose walls are plain but for a few pictures and a door.
plain corridor  Rendered: plain walls seen at a slant, furniture with texture.

In the rendered rooms the depth is exact. Their walls have no texture but the slow change of the
light; every pixel has a noise of 1.5 grey levels.
"""

import ctypes
import dataclasses
import os
import statistics
import sys
import time

import cv2
import numpy as np
import twoview
from twoview import _abi

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
CACHE = os.path.join(ROOT, ".cache", "motorcycle")
DATA = os.environ.get("TWOVIEW_DATA") or os.path.join(ROOT, "..", "shared", "data")
FAR_OFF = 0.05  # a point whose depth is off by more than this share is counted as wrong


@dataclasses.dataclass
class Pair:
    """Two pictures whose rows correspond. A point of depth z is at x in picture 0 and at x -
    disparity in picture 1, where disparity + offset = focal / z for a baseline of 1."""
    name: str
    images: list
    focal: float
    centre: tuple      # cx, cy of picture 0
    offset: float      # cx of picture 1 minus cx of picture 0
    num_disparities: int
    disparity: np.ndarray  # of picture 0; NaN where it is not known

    def wrong(self, known, found):
        """The error of the depth of disparities `found`, as a share of the known depth."""
        return np.abs((known + self.offset) / (found + self.offset) - 1)


def motorcycle():
    images = [cv2.imread(os.path.join(CACHE, f"motorcycle_{side}.png"), cv2.IMREAD_GRAYSCALE)
              for side in ("left", "right")]
    if images[0] is None:
        return None
    with np.load(os.path.join(CACHE, "motorcycle_disp.npz")) as stored:
        known = stored[stored.files[0]].astype(float)
    known[~np.isfinite(known)] = np.nan
    return Pair("motorcycle", images, 994.978, (311.193, 254.877), 31.086, 80, known)


def _agreed(images, num_disparities):
    """Disparities on which two block sizes and both directions agree to a pixel."""
    flipped = [np.ascontiguousarray(i[:, ::-1]) for i in images[::-1]]
    found = []
    for block in (5, 11):
        matcher = cv2.StereoSGBM_create(0, num_disparities, block, 8 * block * block,
                                        32 * block * block, 1, 0, 15, 200, 1,
                                        cv2.STEREO_SGBM_MODE_HH)
        ahead = matcher.compute(*images) / 16
        back = matcher.compute(*flipped)[:, ::-1] / 16
        rows, columns = np.indices(ahead.shape)
        other = np.clip(np.rint(columns - ahead).astype(int), 0, ahead.shape[1] - 1)
        found.append(np.where((ahead > 0) & (np.abs(back[rows, other] - ahead) <= 1), ahead,
                              np.nan))
    return np.where(np.abs(found[0] - found[1]) <= 1, found[0], np.nan)


def bicycle():
    folder = os.path.join(DATA, "middlebury_bicycle", "images")
    large = [cv2.imread(os.path.join(folder, f"im{side}.png"), cv2.IMREAD_GRAYSCALE)
             for side in (0, 1)]
    if large[0] is None:
        return None
    known = _agreed(large, 256)
    halves = [cv2.resize(i, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in large]
    fours = known.reshape(known.shape[0] // 2, 2, known.shape[1] // 2, 2)
    known = (fours.max((1, 3)) + fours.min((1, 3))) / 4  # the mean of the extremes, halved
    known[fours.max((1, 3)) - fours.min((1, 3)) > 2] = np.nan
    centre = ((532.418 + 0.5) / 2 - 0.5, (488.228 + 0.5) / 2 - 0.5)
    return Pair("bicycle", halves, 1948.17 / 2, centre, 81.932 / 2, 128, known)


# ---- Rendered rooms: boxes with sides parallel to the axes of a world that is turned against the
# camera. z is upwards.

def _hash(*numbers):
    h = np.uint32(2166136261)
    with np.errstate(over="ignore"):
        for n in numbers:
            h = (np.asarray(n).astype(np.int64).astype(np.uint32) ^ h) * np.uint32(16777619)
            h ^= h >> np.uint32(15)
            h *= np.uint32(2246822519)
            h ^= h >> np.uint32(13)
    return h.astype(np.float64) / 2**32


def _noise(u, v, seed):
    """Bilinear noise on a lattice of unit squares, [0, 1)."""
    i, j = np.floor(u), np.floor(v)
    a, b = u - i, v - j
    corner = [_hash(i + k % 2, j + k // 2, np.full_like(i, seed)) for k in range(4)]
    return ((corner[0] * (1 - a) + corner[1] * a) * (1 - b) +
            (corner[2] * (1 - a) + corner[3] * a) * b)


def _texture(kind, u, v, seed):
    """Grey levels of a surface; u and v in metres along it."""
    if kind == "plain":
        return 150 + 25 * _noise(u / 3, v / 3, seed)
    if kind == "wood":
        return 60 + 60 * _noise(u / 0.25, v / 0.012, seed) + 30 * _noise(u / 0.02, v / 0.02, seed)
    if kind == "tiles":
        return 120 + 60 * (((u // 0.3) + (v // 0.3)) % 2) + 20 * _noise(u / 0.02, v / 0.02, seed)
    if kind == "dark":
        return 18 + 14 * _noise(u / 0.03, v / 0.03, seed)
    return (30 + 90 * _noise(u / 0.09, v / 0.09, seed) + 60 * _noise(u / 0.03, v / 0.03, seed + 1) +
            50 * _noise(u / 0.011, v / 0.011, seed + 2))


@dataclasses.dataclass
class Box:
    low: tuple
    high: tuple
    texture: str
    inside: bool = False  # seen from inside: the room itself


def _first_hits(boxes, start, rays):
    """The distance to the first surface along each ray, and the grey level there."""
    best = np.full(len(rays), np.inf)
    grey = np.zeros(len(rays))
    with np.errstate(divide="ignore", invalid="ignore"):
        for seed, box in enumerate(boxes):
            to = [(np.array(corner) - start) / rays for corner in (box.low, box.high)]
            enter, leave = np.minimum(*to), np.maximum(*to)
            sides = leave if box.inside else enter
            axis = sides.argmin(1) if box.inside else sides.argmax(1)
            distance = np.take_along_axis(sides, axis[:, None], 1)[:, 0]
            hit = (distance > 1e-6) & (distance < best)
            if not box.inside:
                hit &= enter.max(1) <= leave.min(1)
            at = start + distance[hit, None] * rays[hit]
            across = np.where(axis[hit] == 0, at[:, 1], at[:, 0])
            along = np.where(axis[hit] == 2, at[:, 1], at[:, 2])
            side = 7 * seed + axis[hit] + 3 * (rays[hit, axis[hit]] > 0)
            kind = box.texture
            if box.inside:  # the floor may differ from the walls
                kind, floor = box.texture.split("/")
                down = (axis[hit] == 2) & (rays[hit, 2] < 0)
                value = np.where(down, _texture(floor, across, along, side),
                                 _texture(kind, across, along, side))
            else:
                value = _texture(kind, across, along, side)
            best[hit] = distance[hit]
            grey[hit] = value * (1 - 0.12 * axis[hit])
    return best, grey


def rendered(name, boxes, position, yaw, pitch, baseline, seed):
    width, height, focal = 640, 480, 520.0
    forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0])
    axes = np.stack([right, np.cross(forward, right), forward])  # rows: x, y, z of the camera
    random = np.random.default_rng(seed)
    images = []
    depth = None
    for view in (0, 1):
        start = np.array(position) + view * baseline * right
        total = np.zeros(width * height)
        for du, dv in ((0, 0), (-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
            u, v = np.meshgrid(np.arange(width) + du, np.arange(height) + dv)
            rays = np.stack([(u - (width - 1) / 2) / focal, (v - (height - 1) / 2) / focal,
                             np.ones_like(u)], -1).reshape(-1, 3) @ axes
            distance, grey = _first_hits(boxes, start, rays)
            if du == 0:  # z along the camera's axis, since the rays have z = 1 there
                depth = distance if view == 0 else depth
            else:
                total += grey / 4
        noisy = total + random.normal(0, 1.5, total.shape)
        images.append(np.clip(np.rint(noisy), 0, 255).astype(np.uint8).reshape(height, width))
    known = focal * baseline / depth.reshape(height, width)
    steps = int(np.ceil((known.max() + 2) / 16)) * 16
    centre = ((width - 1) / 2, (height - 1) / 2)
    return Pair(name, images, focal, centre, 0.0, steps, known)


def plain_room():
    boxes = [Box((0, 0, 0), (5, 4, 2.5), "plain/wood", True),
             Box((4.98, 0.6, 1.2), (5, 1.6, 1.9), "picture"),
             Box((4.97, 2.2, 0), (5, 3.1, 2.05), "wood"),
             Box((2.4, 1.4, 0.70), (3.5, 2.4, 0.75), "wood"),
             Box((2.5, 1.5, 0), (2.56, 1.56, 0.7), "dark"),
             Box((2.5, 2.3, 0), (2.56, 2.36, 0.7), "dark"),
             Box((3.4, 1.5, 0), (3.46, 1.56, 0.7), "dark"),
             Box((2.9, 1.7, 0.75), (3.1, 1.9, 1.0), "picture"),
             Box((3.9, 3.2, 0), (4.7, 3.95, 1.8), "plain"),
             Box((2.2, 0.02, 1.1), (3.2, 0.04, 1.8), "picture"),
             Box((3.6, 0.3, 0), (4.1, 0.8, 0.9), "cloth")]
    return rendered("plain room", boxes, (0.5, 1.7, 1.35), 0.06, 0.12, 0.12, 11)


def plain_corridor():
    boxes = [Box((0, 0, 0), (9, 1.8, 2.4), "plain/tiles", True),
             Box((2.0, 0, 0), (2.9, 0.03, 2.0), "wood"),
             Box((5.0, 1.77, 0), (5.9, 1.8, 2.0), "wood"),
             Box((3.3, 1.45, 0), (4.1, 1.8, 0.9), "cloth"),
             Box((3.5, 1.5, 0.9), (3.7, 1.7, 1.2), "dark"),
             Box((3.6, 0, 1.3), (4.4, 0.02, 1.9), "picture"),
             Box((1.7, 1.3, 0), (1.75, 1.35, 1.7), "dark"),
             Box((8.98, 0.4, 0.8), (9, 1.3, 1.8), "picture"),
             Box((6.2, 0, 0), (6.7, 0.4, 1.4), "plain")]
    return rendered("plain corridor", boxes, (0.3, 0.8, 1.4), 0.10, 0.06, 0.10, 12)


def pairs():
    return [p for p in (motorcycle(), bicycle(), plain_room(), plain_corridor()) if p is not None]


# ---- The two systems.

class Densifier:
    """tv_densify with the memory and the array of points that it is given once."""

    def __init__(self, library, pair):
        height, width = pair.images[0].shape
        self.library, self.pair = library, pair
        cx, cy = pair.centre
        self.cameras = [twoview.Camera(width, height, pair.focal, pair.focal, x, cy)._struct()
                        for x in (cx, cx + pair.offset)]
        self.views = (_abi.tv_image * 2)(*(
            _abi.tv_image(i.ctypes.data, width, height, i.strides[0]) for i in pair.images))
        self.options = library.make(_abi.tv_dense_options)
        self.options.max_cells = 1 << 20
        self.options.max_steps = 256
        self.options.max_relative_sigma = 1  # OpenCV leaves out nothing for it
        t = np.array([-1.0, 0, 0])
        self.cameras_and_motion = _abi.camera_pair(*self.cameras, np.eye(3), t)
        # The points of the truth at every 40th pixel stand for the sparse points of the pair.
        v, u = np.mgrid[20:height:40, 20:width:40].reshape(2, -1)
        known = pair.disparity[v, u] + pair.offset
        u, v, known = (a[np.isfinite(known)] for a in (u, v, known))
        z = pair.focal / known
        self.sparse = np.zeros(len(z), _abi.POINT)
        at = np.stack([(u - cx) / pair.focal * z, (v - cy) / pair.focal * z, z], -1)
        other = at + t
        self.sparse["position"] = at
        self.sparse["angle_rad"] = np.arccos((at * other).sum(1) / np.linalg.norm(at, axis=1) /
                                             np.linalg.norm(other, axis=1))
        self.options.sparse = self.sparse.ctypes.data
        self.options.num_sparse = len(self.sparse)
        size = ctypes.c_size_t()
        library.call("tv_dense_size", *map(ctypes.byref, (*self.cameras, self.options, size)))
        self.size = size
        memory = np.zeros(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
        self.memory = memory[-memory.ctypes.data % _abi.CONTEXT_ALIGNMENT:]
        self.points = np.zeros(self.options.max_cells, _abi.DENSE_POINT)
        self.points["grey"] = 1  # touches the pages

    def __call__(self):
        count = ctypes.c_int32()
        p = _abi.pointer
        self.library.call("tv_densify", p(self.memory), self.size,
                          ctypes.byref(self.cameras_and_motion), self.views,
                          ctypes.byref(self.options), p(self.points),
                          ctypes.c_int32(len(self.points)), ctypes.byref(count))
        return self.points[:count.value]

    def disparities(self, points):
        """Disparity at each pixel of picture 0, NaN where there is none: of the points that round
        to a pixel, the first."""
        found = np.full(self.pair.disparity.shape, np.nan)
        u, v = np.rint(points["pixel0"]).astype(int).T
        found[v, u] = self.pair.focal / points["position"][:, 2] - self.pair.offset
        return found


class OpenCv:
    def __init__(self, pair):
        self.pair = pair
        self.matcher = cv2.StereoSGBM_create(
            minDisparity=0, numDisparities=pair.num_disparities, blockSize=3, P1=72, P2=288,
            disp12MaxDiff=1, uniquenessRatio=5, speckleWindowSize=100, speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY)

    def __call__(self):
        return self.matcher.compute(*self.pair.images)

    def disparities(self, found):
        return np.where(found > 0, found / 16, np.nan)


def figures(pair, found):
    """What the table says of a picture of disparities."""
    both = np.isfinite(found) & np.isfinite(pair.disparity)
    error = pair.wrong(pair.disparity[both], found[both])
    return {"points": int(both.sum()), "median_percent": float(100 * np.median(error)),
            "off_percent": float(100 * np.mean(error > FAR_OFF))}


def cpu_ms(call):
    """CPU time of one call of this process, and what the call returned."""
    begin = time.process_time()
    found = call()
    return 1e3 * (time.process_time() - begin), found


def main(rounds):
    cv2.setNumThreads(1)
    library = _abi.default_library()
    print("pair              CPU ms (of OpenCV's)    points (of OpenCV's)   median %      "
          "off by 5 %  (ours, OpenCV)")
    for pair in pairs():
        ours, peer = Densifier(library, pair), OpenCv(pair)
        ours(), peer()  # the first of each touches its memory
        times = [(cpu_ms(ours)[0], cpu_ms(peer)[0]) for _ in range(rounds)]
        mine, other = (statistics.median(column) for column in zip(*times))
        ratio = statistics.median(a / b for a, b in times)
        a = figures(pair, ours.disparities(ours()))
        b = figures(pair, peer.disparities(peer()))
        print(f"{pair.name:16} {mine:6.1f} {other:6.1f} ({ratio:4.2f})  "
              f"{a['points']:7d} {b['points']:7d} ({a['points'] / b['points']:4.2f})  "
              f"{a['median_percent']:5.2f} {b['median_percent']:5.2f}  "
              f"{a['off_percent']:5.1f} {b['off_percent']:5.1f} "
              f"({a['off_percent'] / max(b['off_percent'], 1e-9):4.2f})", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 15)
