"""Chessboards rendered through lenses with known parameters, which `calibrate` must recover."""
import functools

import cv2
import numpy as np

INNER = (9, 6)
SQUARE = 0.03
SIZE = (640, 480)
OVER = 3  # rendered samples per pixel along each axis

MILD = ("brown-conrady", (620.0, 617.0, 327.3, 234.6), (-0.28, 0.09, 0.001, -0.0005, 0.0))
WIDE = ("brown-conrady", (380.0, 381.0, 315.2, 243.9), (-0.25, 0.06, 0.0008, -0.0004, -0.006))
RATIONAL = (
    "brown-conrady",
    (520.0, 518.0, 317.5, 241.2),
    (0.5, 0.05, 0.0005, -0.0003, 0.0, 1.2, 0.15, 0.005),
)
FISHEYE = ("kannala-brandt", (300.0, 299.0, 322.8, 238.1), (0.02, -0.01, 0.003, -0.001))


def board_points():
    x, y = np.meshgrid(np.arange(INNER[0]), np.arange(INNER[1]))
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1) * SQUARE


def matrix(numbers):
    fx, fy, cx, cy = numbers
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def distorted(model, k, rays):
    """Pixels of points in front of the camera, by the lens model's formulas and the matrix K."""
    x, y = rays[:, 0] / rays[:, 2], rays[:, 1] / rays[:, 2]
    if model == "kannala-brandt":
        r = np.maximum(np.hypot(x, y), 1e-12)
        t = np.arctan(r)
        s = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8) / r
        return np.stack([x * s, y * s], 1)
    k1, k2, p1, p2, k3, *more = k
    k4, k5, k6 = more or (0, 0, 0)
    r2 = x * x + y * y
    s = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack([x * s + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                     y * s + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], 1)


def project(lens, R, t, points):
    model, (fx, fy, cx, cy), k = lens
    return distorted(model, k, points @ R.T + t) * (fx, fy) + (cx, cy)


@functools.lru_cache(maxsize=None)
def ray_table(lens):
    """The ray of each sample of the image, as a point of the plane z = 1: Newton's method along the
    radius, then in both axes."""
    model, (fx, fy, cx, cy), k = lens
    u = (np.arange(SIZE[0] * OVER) + 0.5) / OVER - 0.5
    v = (np.arange(SIZE[1] * OVER) + 0.5) / OVER - 0.5
    # The lens is smooth, so rays are solved at every eighth sample and interpolated by Catmull-Rom.
    gu, gv = np.linspace(u[0], u[-1], 241), np.linspace(v[0], v[-1], 181)
    grid = np.stack(np.meshgrid((gu - cx) / fx, (gv - cy) / fy), -1).reshape(-1, 2)
    flat = grid.copy()
    for _ in range(60):
        at = distorted(model, k, np.c_[flat, np.ones(len(flat))])
        h = 1e-6
        dx = (distorted(model, k, np.c_[flat + (h, 0), np.ones(len(flat))]) - at) / h
        dy = (distorted(model, k, np.c_[flat + (0, h), np.ones(len(flat))]) - at) / h
        e = grid - at
        if np.abs(e).max() < 1e-13:
            break
        det = dx[:, 0] * dy[:, 1] - dy[:, 0] * dx[:, 1]
        step = np.stack([(dy[:, 1] * e[:, 0] - dy[:, 0] * e[:, 1]) / det,
                         (dx[:, 0] * e[:, 1] - dx[:, 1] * e[:, 0]) / det], 1)
        length = np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
        flat += step * np.minimum(1, 0.2 / length)
    assert np.abs(e).max() < 1e-9, "the lens turns back within the image"
    coarse = flat.reshape(181, 241, 2)
    size = (SIZE[0] * OVER, SIZE[1] * OVER)
    mx = np.tile(np.linspace(0, 240, size[0], dtype=np.float32), (size[1], 1))
    my = np.tile(np.linspace(0, 180, size[1], dtype=np.float32)[:, None], (1, size[0]))
    return smooth_lookup(coarse, mx, my)


def smooth_lookup(coarse, mx, my):
    """Catmull-Rom interpolation in both axes, in doubles: cv2.remap rounds positions to 1/32."""
    def along(values, place, axis):
        n = values.shape[axis]
        i = np.clip(place.astype(int), 1, n - 3)
        f = (place - i).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        a, b, c, d = (np.take(values, i + o, axis) for o in (-1, 0, 1, 2))
        return b + f / 2 * (c - a + f * (2 * a - 5 * b + 4 * c - d + f * (3 * (b - c) + d - a)))
    return along(along(coarse, mx[0].astype(float), 1), my[:, 0].astype(float), 0)


def meet(H, rays):
    """The points, in squares, where rays meet the board's plane; points far off the board for rays
    that do not meet it."""
    x, y = rays[..., 0], rays[..., 1]
    w = H[2, 0] * x + H[2, 1] * y + H[2, 2]
    w = np.where(w > 0, SQUARE * w, 1e-9)
    return (H[0, 0] * x + H[0, 1] * y + H[0, 2]) / w, (H[1, 0] * x + H[1, 1] * y + H[1, 2]) / w


def within(X, Y, squares):
    """Whether points lie on the board, widened on all sides by this many squares."""
    return (
        (X > -1 - squares)
        & (X < INNER[0] + squares)
        & (Y > -1 - squares)
        & (Y < INNER[1] + squares)
    )


def render(rays, R, t, rng, blur=0.8, noise=3.0):
    """Renders a board with a white margin of one square on a grey background, seen through the
    lens."""
    H = np.linalg.inv(np.stack([R[:, 0], R[:, 1], t], 1))
    samples = np.full(rays.shape[:2], 110, np.float32)
    step = 24  # samples: each 24th is tested first, to find the board's part of the image
    rows, columns = np.nonzero(within(*meet(H, rays[::step, ::step]), 3))
    if len(rows):
        part = tuple(
            slice(max(0, step * (i.min() - 1)), step * (i.max() + 2)) for i in (rows, columns)
        )
        X, Y = meet(H, rays[part])
        samples[part][within(X, Y, 1)] = 205
        even = (np.floor(X).astype(np.int32) + np.floor(Y).astype(np.int32)) % 2 == 0
        samples[part][within(X, Y, 0) & even] = 45
    # A pixel of the image is the mean of OVER x OVER samples.
    image = cv2.resize(samples, SIZE, interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), blur)
    return np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)


def poses(lens, count, rng, max_tilt_deg=42):
    """Random tilted and rolled poses of boards that lie in the image with their margin."""
    outline = np.array([[-2, -2], [9.0, -2], [10, 2], [10, 7], [3, 7], [-2, 7], [-2, 2], [4, -2]])
    outline = np.c_[outline, np.zeros(len(outline))] * SQUARE
    middle = np.array([4, 2.5, 0]) * SQUARE
    # Half the width and height of the field of view on the plane z = 1, each at most 1.2.
    reach = np.minimum(1.2, np.array(SIZE) / (2 * np.array(lens[1][:2])))
    found = []
    while len(found) < count:
        direction, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(5, max_tilt_deg))
        axis = np.array([np.cos(direction), np.sin(direction), 0]) * tilt
        R = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(np.array([0, 0, rng.normal(0, 0.5)]))[0]
        depth = rng.uniform(0.12, 0.6)
        way = np.r_[rng.uniform(-reach, reach), 1]
        # The board is turned to face the camera first, so that its tilt is against the line of
        # sight.
        z = way / np.linalg.norm(way)
        x = np.cross([0, 1.0, 0], z)
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(z, x), z], 1) @ R
        t = z * depth - R @ middle
        if (outline @ R.T + t)[:, 2].min() < 0.02:
            continue
        pixels = project(lens, R, t, outline)
        extent = np.ptp(pixels[:, 0]) / SIZE[0]
        if pixels.min() < 6 or (pixels > np.array(SIZE) - 7).any() or extent < 0.33:
            continue
        found.append((R, t))
    return found
