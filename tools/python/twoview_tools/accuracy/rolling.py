#!/usr/bin/env python3
"""Pairs whose camera is not the one that the library is given: a rolling shutter, a wrong lens;
rendered, so that the pose is known. How often is such a pair "ok" with an error that its
covariance excludes?

  scripts/python -m twoview_tools.accuracy.rolling [--pairs N] [--rows FILE] [--save DIR]

Each pair shows a room full of boxes (SCENES of them in turn) from two places 0.1 to 0.45 m and 1 to
12 degrees apart. Each row of a picture is rendered from the pose that the camera had when the row
was read: it turns with 20 to 70 degrees a second about x, y, z of the camera or a mixture of them,
moves with 0 to 1 m/s, and the sensor takes 15 to 30 ms for a picture. In half of the pairs both
pictures have the same turn, in the others each its own. The true pose is that of the middle row. A
line of the table for each kind:

  global         no rolling shutter: the same pairs with a readout of 0 s
  x, y, z, mix   rolling shutters by axis
  lens           global, and the library is given no lens (it has k1 -0.2 or 0.1)
  focal          global, and the library is given a focal length 10 per cent too short or long
  centre         global, and the library is given a principal point 20 pixels off

"beyond 3 sigma": the rotation or the direction is off by more than three of its standard deviations
(the root of the trace of its block of the covariance)."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import argparse
import json

import numpy as np

from . import belief, metrics, parallel, reliability, tables, twoview_ctypes

WIDTH, HEIGHT, FOCAL = 640, 480, 500.0
SCENES = 8
SHUTTERS = ("x", "y", "z", "mix")
KINDS = ("global", *SHUTTERS, "lens", "focal", "centre")
TEXELS = 512  # of a texture's side; it repeats after TEXELS * TEXEL metres
TEXEL = 0.008
LEVELS = 4


def rotation(vector):
    """The rotation by a vector of radians."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


# ---- the scene -----------------------------------------------------------------------------------

def _texture(random):
    """Grey levels of structures of several sizes, and of patches with edges; in mip levels."""
    import cv2
    total = np.zeros((TEXELS, TEXELS))
    for sigma in (1.5, 3, 8, 20):
        noise = np.tile(random.normal(size=(TEXELS, TEXELS)), (3, 3))
        layer = cv2.GaussianBlur(noise, (0, 0), sigma)[TEXELS:2 * TEXELS, TEXELS:2 * TEXELS]
        total += layer / layer.std()
    for _ in range(60):
        x, y = random.integers(0, TEXELS - 60, 2)
        w, h = random.integers(8, 60, 2)
        total[y:y + h, x:x + w] = 0.5 * total[y:y + h, x:x + w] + random.normal(scale=2)
    level = np.clip(125 + 28 * total, 5, 250)
    levels = [cv2.GaussianBlur(level, (0, 0), 0.8)]
    while len(levels) < LEVELS:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return levels


class Scene:
    """A room of 7 x 2.7 x 6 m with boxes in it; x right, y down, z forward, the camera near the
    origin. Boxes are not turned; the cameras are."""

    def __init__(self, number):
        random = np.random.default_rng((11, number))
        self.textures = [_texture(random) for _ in range(6)]
        self.boxes = [(np.array([-3.5, -1.4, -1.5]), np.array([3.5, 1.3, 4.5]))]
        for _ in range(14):
            middle = random.uniform((-3, -1, 1.6), (3, 1.1, 4.3))
            half = random.uniform((0.1, 0.1, 0.1), (0.5, 0.6, 0.5))
            self.boxes.append((middle - half, middle + half))

    def grey(self, origins, rays, around):
        """The grey levels along rays (n, 3) from origins (n, 3). around(low, high): the rays that a
        box may meet, as indices."""
        nearest = np.full(len(rays), np.inf, np.float32)
        side = np.zeros(len(rays), np.int64)
        with np.errstate(divide="ignore", invalid="ignore"):
            for number, (low, high) in enumerate(self.boxes):
                inside = number == 0  # the room is seen from within
                some = np.arange(len(rays)) if inside else around(low, high)
                inverse, origin = (1 / rays[some]).astype(np.float32), origins[some]
                a = (low - origin).astype(np.float32) * inverse
                b = (high - origin).astype(np.float32) * inverse
                entry, leave = np.minimum(a, b), np.maximum(a, b)
                axis = leave.argmin(axis=1) if inside else entry.argmax(axis=1)
                entry, leave = entry.max(axis=1), leave.min(axis=1)
                at = leave if inside else entry
                hit = np.flatnonzero((at > 1e-6) & (at < nearest[some]) & (leave > entry))
                seen, axis = some[hit], axis[hit]
                nearest[seen] = at[hit]
                side[seen] = 6 * number + 2 * axis + (rays[seen, axis] > 0)
        points = origins + nearest[:, None] * rays
        axis = side % 6 // 2
        u = np.where(axis == 0, points[:, 1], points[:, 0])
        v = np.where(axis == 2, points[:, 1], points[:, 2])
        slant = np.abs(rays[np.arange(len(rays)), axis]) / np.linalg.norm(rays, axis=1)
        footprint = nearest * np.linalg.norm(rays, axis=1) / FOCAL / TEXEL / np.sqrt(slant + 1e-6)
        level = np.clip(np.log2(np.maximum(footprint, 1e-6)), 0, LEVELS - 1)
        grey = np.zeros(len(rays))
        for number, texture in enumerate(self.textures):
            of_this = np.flatnonzero(side % len(self.textures) == number)
            for lod in range(LEVELS):
                weight = np.maximum(0, 1 - np.abs(level[of_this] - lod))
                some = of_this[weight > 0]
                shift = 0.37 * (side[some] // 6)
                grey[some] += weight[weight > 0] * _bilinear(
                    texture[lod], (u[some] + shift) / TEXEL / 2**lod, v[some] / TEXEL / 2**lod)
        return grey


def _bilinear(image, x, y):
    height, width = image.shape
    x, y = x - 0.5, y - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = x - x0, y - y0
    x0, x1, y0, y1 = x0 % width, (x0 + 1) % width, y0 % height, (y0 + 1) % height
    return ((1 - fy) * ((1 - fx) * image[y0, x0] + fx * image[y0, x1])
            + fy * ((1 - fx) * image[y1, x0] + fx * image[y1, x1]))


# ---- one pair ------------------------------------------------------------------------------------

class Pair:
    """What is drawn of pair `number` of a kind."""

    def __init__(self, kind, number, seed):
        random = np.random.default_rng((seed, number))  # the same geometry for all kinds
        self.kind, self.number, self.seed = kind, number, seed
        self.scene = number % SCENES
        R0 = rotation(random.uniform(-0.25, 0.25, 3))
        turn = random.normal(size=3) * (0.6, 1, 0.4)
        turn *= np.radians(random.uniform(1, 12)) / np.linalg.norm(turn)
        step = random.normal(size=3)
        step *= random.uniform(0.1, 0.45) / np.linalg.norm(step)
        place = random.uniform((-1.5, -0.5, -1), (1.5, 0.5, 0))
        self.world_from_cam = [R0, R0 @ rotation(turn)]
        self.places = [place, place + R0 @ step]
        self.k1 = random.choice([-0.2, 0.1])
        self.focal_factor = random.choice([0.9, 1.1])
        self.centre_shift = 20 * np.exp(2j * np.pi * random.uniform())
        axis = np.eye(3)["xyz".index(kind)] if kind in "xyz" else random.normal(size=3)
        self.readout = random.uniform(0.015, 0.030) if kind in SHUTTERS else 0.0
        rates = np.radians(random.uniform(20, 70, 2)) * random.choice([-1, 1], 2)
        if random.integers(0, 2):
            rates[1] = rates[0]
        self.turns = [rate * axis / np.linalg.norm(axis) for rate in rates]
        direction = step / np.linalg.norm(step)
        self.velocity = R0 @ direction * random.uniform(0, 1)

    def truth(self):
        """R and t of cam1_from_cam0."""
        R = self.world_from_cam[1].T @ self.world_from_cam[0]
        return R, self.world_from_cam[1].T @ (self.places[0] - self.places[1])

    def picture(self, scene, view):
        """The picture of a view, uint8."""
        import cv2
        random = np.random.default_rng((self.seed, self.number, view))
        x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
        rays = np.stack([(x - (WIDTH - 1) / 2) / FOCAL, (y - (HEIGHT - 1) / 2) / FOCAL,
                         np.ones_like(x, float)], axis=-1)
        if self.kind == "lens":
            distorted, rays = rays[..., :2].copy(), rays.copy()
            for _ in range(10):
                r_sq = (rays[..., :2]**2).sum(axis=-1, keepdims=True)
                rays[..., :2] = distorted / (1 + self.k1 * r_sq)
        times = self.readout * ((np.arange(HEIGHT) + 0.5) / HEIGHT - 0.5)
        R = [self.world_from_cam[view] @ rotation(time * self.turns[view]) for time in times]
        rays = np.einsum("yij,yxj->yxi", R, rays).reshape(-1, 3)
        origins = np.repeat(self.places[view] + times[:, None] * self.velocity, WIDTH, axis=0)

        def around(low, high):
            corners = np.array(np.meshgrid(*zip(low, high))).reshape(3, 8).T - self.places[view]
            seen = corners @ self.world_from_cam[view]
            if seen[:, 2].min() < 0.1:
                return np.arange(len(rays))
            at = FOCAL * seen[:, :2] / seen[:, 2:] + ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
            margin = 60 if self.kind == "lens" else 30  # pixels that the rows' poses may move it
            (x0, y0), (x1, y1) = (np.clip(at.min(axis=0) - margin, 0, (WIDTH, HEIGHT)).astype(int),
                                  np.clip(at.max(axis=0) + margin, 0, (WIDTH, HEIGHT)).astype(int))
            return np.arange(len(rays)).reshape(HEIGHT, WIDTH)[y0:y1, x0:x1].ravel()

        grey = scene.grey(origins, rays, around).reshape(HEIGHT, WIDTH)
        grey = cv2.GaussianBlur(grey, (0, 0), 0.6) + random.normal(scale=2, size=grey.shape)
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)

    def told(self):
        """The K that the library is given."""
        focal, centre = FOCAL, complex((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
        if self.kind == "focal":
            focal *= self.focal_factor
        if self.kind == "centre":
            centre += self.centre_shift
        return np.array([[focal, 0, centre.real], [0, focal, centre.imag], [0, 0, 1]])


def run_pair(pair, scene, context, options, save=None):
    R_true, t_true = pair.truth()
    pictures = [pair.picture(scene, view) for view in range(2)]
    K = pair.told()
    camera = twoview_ctypes.make_camera(K, WIDTH, HEIGHT)
    result, cloud = context.reconstruct(pictures[0], camera, pictures[1], camera, options)
    row = {"kind": pair.kind, "number": pair.number, "readout_s": pair.readout,
           "rates_deg": [float(np.degrees(np.linalg.norm(turn))) for turn in pair.turns],
           **belief.row_of_result(result)}
    row.update(reliability.sigmas(row["covariance"]))
    has_pose = result.has_R and result.has_t
    if has_pose:
        R, t = np.array(result.R).reshape(3, 3), np.array(result.t)
        row["rotation_error_deg"] = metrics.rotation_error_deg(R, R_true)
        row["direction_error_deg"] = float(np.degrees(np.arccos(np.clip(
            t @ t_true / np.linalg.norm(t_true), -1, 1))))
    if save:
        import cv2
        stem = os.path.join(save, f"{pair.kind}_{pair.number:03d}_")
        for name, picture in zip("ab", pictures):
            cv2.imwrite(f"{stem}{name}.png", picture)
        with open(stem + "truth.yaml", "w", encoding="utf-8") as file:
            file.write(f"R: {np.ravel(R_true).tolist()}\nt: {t_true.tolist()}\n")
        with open(stem + "camera.yaml", "w", encoding="utf-8") as file:
            file.write(f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_matrix: {{rows: 3, "
                       f"cols: 3, data: {np.ravel(K).tolist()}}}\n")
    kept = {key: getattr(cloud, key) for key in ("matches", "inlier_mask", "keypoints")}
    return row, kept


def _run_piece(work):
    """The rows of the pairs of one scene."""
    pairs, library, options, save = work
    context = twoview_ctypes.Context(twoview_ctypes.Library(library), max_width=WIDTH,
                                     max_height=HEIGHT, max_keypoints=2048)
    scene = Scene(pairs[0].scene)
    return [run_pair(pair, scene, context, options, save)[0] for pair in pairs]


# ---- the table -----------------------------------------------------------------------------------

def is_beyond(row, sigmas=3):
    """Whether the error of a pose is excluded by its covariance."""
    return any(row[what + "_error_deg"] > sigmas * row[f"sigma_{what}_deg"]
               for what in ("rotation", "direction"))


def table(rows):
    head = ("kind", "pairs", "ok", "ok, beyond 3 sigma", "per cent of ok", "chi2 median (ok)")
    lines = []
    kinds = [kind for kind in KINDS if any(row["kind"] == kind for row in rows)]
    for name, some in [(kind, [kind]) for kind in kinds] + [("all shutters", SHUTTERS)]:
        of_kind = [row for row in rows if row["kind"] in some]
        ok = [row for row in of_kind if row["verdict"] == "ok"]
        beyond = sum(map(is_beyond, ok))
        chi2 = [row["principal_point_chi2"] for row in ok if row["principal_point_chi2"]]
        lines.append((name, len(of_kind), len(ok), beyond,
                      f"{100 * beyond / max(len(ok), 1):.1f}",
                      f"{np.median(chi2) if chi2 else 0:.1f}"))
    widths = [max(len(str(line[k])) for line in [head, *lines]) for k in range(len(head))]
    return "\n".join("  ".join(str(cell).rjust(width) for cell, width in zip(line, widths))
                     for line in [head, *lines])


def main(argv=None):
    parser = argparse.ArgumentParser(prog="twoview_tools.accuracy.rolling", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=24, metavar="N", help="of each kind (24)")
    parser.add_argument("--kinds", default=",".join(KINDS), help="separated by commas")
    parser.add_argument("--seed", type=int, default=1, help="of scenes' pairs (1)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (1)")
    parser.add_argument("--rows", metavar="FILE", help="write a JSON object a line for each pair")
    parser.add_argument("--save", metavar="DIR", help="write the pictures, cameras and poses")
    parser.add_argument("--lib", help="libtwoview.so (default: build/release/lib)")
    arguments = parser.parse_args(argv)
    if arguments.save:
        os.makedirs(arguments.save, exist_ok=True)
    options = ({}, {}, dict(belief.PLAIN_CAMERA))
    pairs = [Pair(kind, number, arguments.seed) for kind in arguments.kinds.split(",")
             for number in range(arguments.pairs)]
    work = [([pair for pair in pairs if pair.scene == scene], arguments.lib, options,
             arguments.save) for scene in sorted({pair.scene for pair in pairs})]
    rows = []
    for part in parallel.run(_run_piece, work, arguments.jobs):
        rows += part
    if arguments.rows:
        with open(arguments.rows, "w", encoding="utf-8") as file:
            for row in rows:
                file.write(json.dumps(metrics.finite(row), allow_nan=False) + "\n")
    tables.say(table(rows))


if __name__ == "__main__":
    main()
