"""Pictures that make a pose hard or impossible: rendered ones, and changes of given ones.

A View is a picture with its camera; a Pair is two of them and the true pose between them. A change
returns a new View together with the rotation Q from the old camera's frame to the new one's, so
that the truth of a pair follows: R becomes Q R and t becomes Q t.
"""

import functools
from dataclasses import dataclass, replace
from typing import Optional

import cv2
import numpy as np

from . import datasets


@dataclass(frozen=True)
class View:
    luma: np.ndarray  #: (height, width) uint8
    K: np.ndarray  #: (3, 3), pixel (0, 0) is the centre of a pixel
    lens: tuple = (0.0,) * 5  #: k1 k2 p1 p2 k3 of Brown and Conrady
    #: (width, height) that the camera states, where it is another than the picture's
    stated: Optional[tuple] = None


@dataclass(frozen=True)
class Pair:
    views: tuple  #: two Views
    R: np.ndarray  #: the true pose, x1 = R x0 + t
    t: Optional[np.ndarray]  #: None: both were taken from one place, or there is no truth


def of_set(data, pair):
    """The Pair of a datasets.Set's pair, at the size of the tables."""
    names = pair.name0, pair.name1
    cameras = [data.camera(pair, side) for side in (0, 1)]
    views = [View(data.gray(n)[0], K, tuple(lens)) for n, (K, lens) in zip(names, cameras)]
    return Pair(tuple(views), np.asarray(pair.R), np.asarray(pair.t))


# ---- changes of a view ---------------------------------------------------------------------------

QUARTER = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # counter-clockwise, as numpy.rot90
NO_TURN = np.eye(3)


def turned(view, quarters):
    """The picture turned by quarter turns counter-clockwise, and the camera with it."""
    Q = NO_TURN
    for _ in range(quarters % 4):
        K = np.array(view.K)
        K[0, 0], K[1, 1] = view.K[1, 1], view.K[0, 0]
        K[0, 2], K[1, 2] = view.K[1, 2], view.luma.shape[1] - 1 - view.K[0, 2]
        k1, k2, p1, p2, k3 = view.lens
        view = View(np.ascontiguousarray(np.rot90(view.luma)), K, (k1, k2, -p2, p1, k3))
        Q = QUARTER @ Q
    return view, Q


def resized(view, scale, scale_camera=True, state_size=False):
    """The picture made smaller by area averaging, and the camera with it. Without scale_camera it
    keeps its K; with state_size its width and height, too."""
    height, width = view.luma.shape
    size = max(1, round(width * scale)), max(1, round(height * scale))
    luma = cv2.resize(view.luma, size, interpolation=cv2.INTER_AREA)
    if not scale_camera:
        return replace(view, luma=luma, stated=(width, height) if state_size else None), NO_TURN
    K = datasets.scale_K(view.K, size[0] / width, size[1] / height)
    return replace(view, luma=luma, K=K), NO_TURN


def mirrored(view, axis=1):
    """The picture with left and right exchanged (axis 1), or top and bottom (axis 0). The principal
    point and the lens are those of the mirrored picture, but no rotation makes a camera see it."""
    K = np.array(view.K)
    column = 0 if axis == 1 else 1
    K[column, 2] = view.luma.shape[axis] - 1 - K[column, 2]
    k1, k2, p1, p2, k3 = view.lens
    lens = (k1, k2, p1, -p2, k3) if axis == 1 else (k1, k2, -p1, p2, k3)
    return View(np.ascontiguousarray(np.flip(view.luma, axis)), K, lens), NO_TURN


def inverted(view):
    """The negative: 255 minus each pixel."""
    return replace(view, luma=255 - view.luma), NO_TURN


def blurred(view, length_px, angle_deg=30.0):
    """The picture averaged along a straight line of this length, as a moving camera blurs it."""
    side = int(np.ceil(length_px)) | 1
    fine, middle = 8, (side - 1) / 2
    kernel = np.zeros((side, side), np.float32)
    angle = np.radians(angle_deg)
    for s in np.linspace(-length_px / 2, length_px / 2, fine * side):
        x, y = middle + s * np.cos(angle), middle + s * np.sin(angle)
        i, j = min(max(round(y), 0), side - 1), min(max(round(x), 0), side - 1)
        kernel[i, j] += 1
    luma = cv2.filter2D(view.luma, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE)
    return replace(view, luma=luma), NO_TURN


def exposed(view, gain, gamma=1.0):
    """The picture with another exposure: 255 gain (pixel / 255)^gamma, saturated at 255."""
    values = 255.0 * gain * (view.luma / 255.0) ** gamma
    return replace(view, luma=np.clip(np.rint(values), 0, 255).astype(np.uint8)), NO_TURN


def changed(pair, change, *arguments):
    """The pair with view 1 changed, and the truth that follows."""
    view, Q = change(pair.views[1], *arguments)
    return Pair((pair.views[0], view), Q @ pair.R, None if pair.t is None else Q @ pair.t)


def with_itself(view):
    """A pair of the same picture twice."""
    return Pair((view, view), np.eye(3), None)


def mirrored_both(pair):
    """Both pictures with left and right exchanged: those of a mirrored scene, which is a possible
    one. Its pose is S R S, S t with S = diag(-1, 1, 1)."""
    S = np.diag([-1.0, 1, 1])
    views = tuple(mirrored(view)[0] for view in pair.views)
    return Pair(views, S @ pair.R @ S, S @ pair.t)


# ---- rendered pictures ---------------------------------------------------------------------------

WIDTH, HEIGHT, FOCAL = 480, 360, 420.0
K = np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2], [0, 0, 1]])
TEXEL = 0.004  # metres of one pixel of a board's texture


def rotation(x_deg, y_deg, z_deg):
    """The rotation matrix of a rotation vector in degrees."""
    return cv2.Rodrigues(np.radians([x_deg, y_deg, z_deg]))[0]


def spots(seed, width=900, height=700):
    """A texture of patches of random grey: corners everywhere, and no two places alike."""
    random = np.random.default_rng(seed)
    luma = np.full((height, width), 128, np.uint8)
    for _ in range(width * height // 250):
        x, y = random.integers(0, width), random.integers(0, height)
        w, h = random.integers(4, 22, 2)
        luma[y:y + h, x:x + w] = random.integers(20, 236)
    return luma


def lattice(period, width=1600, height=1200):
    """Dark lines, a fifth of the period wide, along both sides of square cells."""
    y, x = np.mgrid[:height, :width] % period
    return np.where(np.minimum(x, y) < period / 5, 40, 200).astype(np.uint8)


def bricks(period, width=1600, height=1200):
    """Rows of bricks, each row moved by half a brick, with light joints."""
    y, x = np.mgrid[:height, :width]
    row = y // (period // 2)
    joint = (y % (period // 2) < period // 10) | ((x + row % 2 * (period // 2)) % period
                                                 < period // 10)
    return np.where(joint, 210, 90).astype(np.uint8)


def blinds(period, width=1600, height=1200):
    """Level stripes, and two cords that hold them: corners in columns, all alike."""
    y, x = np.mgrid[:height, :width]
    stripes = np.where(y % period < period // 2, 220, 60)
    cords = (x % (width // 4)) < period // 3
    return np.where(cords, 120, stripes).astype(np.uint8)


def render(boards, R, t):
    """The View of boards, each (texture, its centre in metres, its rotation), given from far to
    near: four samples a pixel, averaged."""
    fine = datasets.scale_K(K, 2, 2)
    picture = np.full((2 * HEIGHT, 2 * WIDTH), 128, np.uint8)
    for texture, centre, turn in boards:
        height, width = texture.shape
        origin = np.asarray(centre) + turn @ (-TEXEL / 2 * np.array([width - 1, height - 1, 0]))
        H = fine @ np.column_stack([R @ turn[:, 0] * TEXEL, R @ turn[:, 1] * TEXEL, R @ origin + t])
        size = (2 * WIDTH, 2 * HEIGHT)
        inside = cv2.warpPerspective(np.full_like(texture, 255), H, size, flags=cv2.INTER_NEAREST)
        picture = np.where(inside > 0, cv2.warpPerspective(texture, H, size), picture)
    return View(cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), K)


def rendered(boards, R, t):
    """The Pair of boards from the origin and from the pose R, t."""
    t = np.asarray(t, float)
    return Pair((render(boards, np.eye(3), np.zeros(3)), render(boards, R, t)), R,
                t / np.linalg.norm(t))


@functools.lru_cache(maxsize=1)
def room():
    """A pair of a rendered wall with three boards before it, from a wide baseline."""
    boards = [(spots(1, 1600, 1200), (0.2, 0, 4.0), rotation(0, 20, 0)),
              (spots(2, 200, 260), (-0.8, 0.3, 2.6), rotation(10, -25, 0)),
              (spots(3, 240, 160), (0.6, -0.4, 2.9), rotation(-15, 20, 5)),
              (spots(4, 160, 160), (0.3, 0.5, 2.2), rotation(0, -10, -10))]
    return rendered(boards, rotation(2, -8, 3), (0.6, 0.08, 0.1))


PATTERNS = {"lattice": lattice, "bricks": bricks, "blinds": blinds}


def patterned(name, period, seed):
    """A pair of a wall that a pattern covers, and nothing else is seen; the wall's tilt and the
    motion are drawn from the seed."""
    random = np.random.default_rng(seed)
    tilt = rotation(*random.uniform(-25, 25, 2), random.uniform(-5, 5))
    R = rotation(*random.uniform(-6, 6, 3))
    t = random.uniform(-1, 1, 3) * (0.4, 0.4, 0.3)
    return rendered([(PATTERNS[name](period), (0, 0, 2.2), tilt)], R, t)


def without_truth(luma0, luma1):
    return Pair((View(luma0, K), View(luma1, K)), np.eye(3), None)


def noise(deviation, seed, num=2):
    """Pictures of grey and independent normal noise of this standard deviation."""
    random = np.random.default_rng(seed)
    return [np.clip(np.rint(random.normal(128, deviation, (HEIGHT, WIDTH))), 0, 255)
            .astype(np.uint8) for _ in range(num)]


def corner_in_noise(deviation, seed):
    """A pair of noise, with one strong corner, which moves."""
    pictures = noise(deviation, seed)
    for picture, (x, y) in zip(pictures, ((200, 150), (223, 158))):
        picture[y:, x:] = np.clip(picture[y:, x:] + 90.0, 0, 255).astype(np.uint8)
    return without_truth(*pictures)


def blank(grey0, grey1):
    """A pair of pictures of one grey level each."""
    return without_truth(*(np.full((HEIGHT, WIDTH), grey, np.uint8) for grey in (grey0, grey1)))
