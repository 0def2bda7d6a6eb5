#!/usr/bin/env python3
"""Tests of `twoview room` on the rendered flight past five walls of test_odometry: where the walls
are is known exactly. Files are read by this test's own readers."""
import json
import math
import os
import pty
import re
import resource
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import unittest
import urllib.request
from pathlib import Path

import numpy as np

from cli_support import CliTest, main, png, program
from test_odometry import (CAMERAS, COUNT, FOCAL, HEIGHT, LUMA, PICTURES, SHIFTS, TIMES, TUM_TRUTH,
                           WIDTH, poses)

STEP = 0.1  # units of the truth between two frames
DEPTHS = [FOCAL * STEP / shift for shift in SHIFTS]  # of the walls
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
ROOT = Path(__file__).resolve().parents[2]
# Installed by scripts/check_glb; tests fetch nothing.
VALIDATOR = ROOT / ".cache/gltf_validator/node_modules/gltf-validator"
# Runs in the page: stands where the camera was in the middle of its path, turns until a wall is in
# the middle of the picture, and measures across it as a user does, with clicks.
PROBE = """<script>
  const viewer = window.roomViewer, canvas = document.getElementById("room");
  const x = canvas.clientWidth / 2, y = canvas.clientHeight / 2, found = {hits: 0};
  document.getElementById("room-walk").click();
  viewer.view.pitch = 0;
  for (let k = 0; k < 64; ++k) {
    viewer.view.yaw = k * Math.PI / 32;
    const hit = viewer.pick(x, y);
    if (!hit) continue;
    const ahead = [Math.cos(viewer.view.yaw), Math.sin(viewer.view.yaw), 0];
    const facing = -hit.normal.reduce((sum, n, i) => sum + n * ahead[i], 0);
    const depth = hit.place.reduce((sum, p, i) => sum + (p - viewer.view.eye[i]) * ahead[i], 0);
    if (facing > (found.facing || 0)) Object.assign(found, {facing, depth, yaw: viewer.view.yaw});
    ++found.hits;
  }
  viewer.view.yaw = found.yaw;
  viewer.draw();
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  found.lit = 0;
  for (let i = 0; i < pixels.length; i += 4) found.lit += pixels[i] > 60;
  viewer.click(x - 20, y);
  viewer.click(x + 20, y);
  found.readout = document.getElementById("room-readout").textContent;
  found.size = [canvas.width, canvas.height];
  document.title = JSON.stringify(found);
</script>"""
TYPES = {"float": "f", "uchar": "B", "int": "i"}


def read_ply(path):
    """(the properties of the vertices, a list of rows, a list of triangles) of a room.ply."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines
    counts = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    kinds = [line.split() for line in lines if line.startswith("property") and "list" not in line]
    assert "property list uchar int vertex_indices" in lines, lines
    row = struct.Struct("<" + "".join(TYPES[kind] for _, kind, _ in kinds))
    names = [name for *_, name in kinds]
    size = row.size * counts["vertex"]
    assert len(body) == size + 13 * counts["face"], "the file's length is not what it promises"
    vertices = [dict(zip(names, numbers)) for numbers in row.iter_unpack(body[:size])]
    faces = [face[1:] for face in struct.iter_unpack("<B3i", body[size:]) if face[0] == 3]
    assert len(faces) == counts["face"]
    return names, vertices, faces


def read_glb(data):
    """(JSON, buffer) of a GLB; checks its chunks."""
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON" and size % 4 == 0
    start = 20 + size
    buffer_size, kind = struct.unpack("<I4s", data[start:start + 8])
    assert kind == b"BIN\0" and start + 8 + buffer_size == len(data)
    return json.loads(data[20:start]), data[start + 8:]


# The walls: strips of the picture's height, x from what the first frame shows to the last.
WALLS = [{"z": depth,
          "x": (-(WIDTH / 2) / FOCAL * depth,
                WIDTH / 2 / FOCAL * depth + STEP * (COUNT - 1)),
          "y": tuple((edge * HEIGHT / len(DEPTHS) - HEIGHT / 2) / FOCAL * depth
                     for edge in (k, k + 1))}
         for k, depth in enumerate(DEPTHS)]
QUADS = [[(w["x"][0], w["y"][0], w["z"]), (w["x"][1], w["y"][0], w["z"]),
          (w["x"][1], w["y"][1], w["z"]), (w["x"][0], w["y"][1], w["z"])] for w in WALLS]


def ply_mesh(kind="ascii", quads=True):
    """The walls as a PLY file, as other programs write one: with more properties and elements, and
    their faces as quadrilaterals or as triangles."""
    corners = [p for quad in QUADS for p in quad]
    faces = [f for k in range(len(QUADS)) for f in
             ([(4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3)] if quads else
              [(4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3)])]
    head = (f"ply\nformat {kind} 1.0\ncomment of a test\nelement vertex {len(corners)}\n"
            "property double x\nproperty double y\nproperty uchar red\nproperty double z\n"
            f"element face {len(faces)}\nproperty list uchar uint vertex_index\n"
            "element edge 1\nproperty list short float lengths\nend_header\n").encode()
    if kind == "ascii":
        return head + "".join([f"{x!r} {y!r} 200 {z!r}\n" for x, y, z in corners] + [
            " ".join(map(str, (len(f), *f))) + "\n" for f in faces] + ["2 0.5 1.5\n"]).encode()
    order = "<" if kind == "binary_little_endian" else ">"
    return (head + b"".join(struct.pack(order + "ddBd", x, y, 200, z) for x, y, z in corners) +
            b"".join(struct.pack(f"{order}B{len(f)}I", len(f), *f) for f in faces) +
            struct.pack(order + "hff", 2, 0.5, 1.5))


def depth_picture(levels=2000, shift=0):
    """The true depth of each frame: the walls are strips of the picture."""
    return png(WIDTH, HEIGHT, [round(levels * DEPTHS[y * len(DEPTHS) // HEIGHT]) + shift
                               for y in range(HEIGHT) for _ in range(WIDTH)], depth=16)


def away_from_walls(points):
    """The distance of each point to the nearest wall."""
    nearest = np.full(len(points), np.inf)
    for wall in WALLS:
        beyond = [np.maximum(0, np.maximum(wall[axis][0] - points[:, k],
                                           points[:, k] - wall[axis][1]))
                  for k, axis in enumerate("xy")]
        nearest = np.minimum(nearest, np.sqrt(beyond[0] ** 2 + beyond[1] ** 2 +
                                              (points[:, 2] - wall["z"]) ** 2))
    return nearest


def away_from_triangle(points, corners):
    """The distance of each point to the triangle, from the definition: to its plane where the foot
    lies within, else to the nearest edge."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    inside = np.ones(len(points), bool)
    nearest = np.full(len(points), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.cross(q - p, points - p) @ normal >= 0
        share = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(points - p - share[:, None] * (q - p), axis=1))
    return np.where(inside, np.abs((points - a) @ normal), nearest)


def brute_force_scores(out, within=0.05):
    """Precision, recall and medians of a room of true poses beside the walls, by counting."""
    _, vertices, faces = read_ply(out / "room.ply")
    places = np.array([(v["x"], v["y"], v["z"]) for v in vertices])
    corners = places[np.array(faces)]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(sides, axis=1)
    rng = np.random.default_rng(5)
    chosen = rng.choice(len(corners), 60000, p=area / area.sum())
    u, v = np.sort(rng.random((2, len(chosen))), axis=0)
    weights = np.stack([u, v - u, 1 - v], 1)
    away = away_from_walls(np.einsum("ij,ijk->ik", weights, corners[chosen]))
    # True points: as many to the square metre on each wall, seen by at least two frames.
    points = np.array([(x, y, w["z"]) for w in WALLS
                       for x in np.arange(w["x"][0] + 0.05, w["x"][1], 0.1)
                       for y in np.arange(w["y"][0] + 0.05, w["y"][1], 0.1)])
    eyes = STEP * np.arange(COUNT)
    column = FOCAL * (points[:, :1] - eyes) / points[:, 2:] + (WIDTH - 1) / 2
    row = FOCAL * points[:, 1] / points[:, 2] + (HEIGHT - 1) / 2
    seen = ((column >= 0) & (column < WIDTH)).sum(1) >= 2
    points = points[seen & (row >= 0) & (row < HEIGHT)]
    missing = np.full(len(points), np.inf)
    for triangle in corners[area > 0]:
        low, high = triangle.min(0) - 0.3, triangle.max(0) + 0.3
        near = np.flatnonzero(((points > low) & (points < high)).all(1))
        if len(near):
            missing[near] = np.minimum(missing[near], away_from_triangle(points[near], triangle))
    precision, recall = (away <= within).mean(), (missing <= within).mean()
    return {"precision_5cm": precision, "recall_5cm": recall,
            "f_5cm": 2 * precision * recall / (precision + recall),
            "accuracy_median": np.median(away), "completeness_median": np.median(missing)}


class RoomTest(CliTest):
    walls_truth = None

    @classmethod
    def setUpClass(cls):
        """The set folder and the odometry's results, which the tests only read."""
        super().setUpClass()
        cls.shared = Path(tempfile.mkdtemp(prefix="twoview_room_"))
        cls.addClassCleanup(shutil.rmtree, cls.shared, ignore_errors=True)
        cls.source, cls.flight = cls.shared / "set", cls.shared / "flight"
        (cls.source / "images").mkdir(parents=True)
        for i, data in enumerate(PICTURES):
            (cls.source / f"images/{i:05}.png").write_bytes(data)
        (cls.source / "frames.txt").write_text("".join(
            f"{t:.9f} images/{i:05}.png\n" for i, t in enumerate(TIMES)))
        (cls.source / "cameras.yaml").write_text(CAMERAS)
        (cls.source / "groundtruth.txt").write_text(TUM_TRUTH)

    def setUp(self):
        super().setUp()
        if not self.flight.exists():
            self.succeed(self.run_program("odometry", self.source, "-o", self.flight))

    def room(self, *more, folder=None, out=None, **options):
        return self.run_program("room", folder or self.flight, "-o", out or self.out, *more,
                                **options)

    def scale(self):
        """Units of the truth in one of the odometry's."""
        path, _ = poses(self.flight / "trajectory.txt")
        first, last = path[min(path)], path[max(path)]
        return STEP * (COUNT - 1) / math.dist(first[:3], last[:3])

    # -- a whole run --------------------------------------------------------------------------

    def test_the_walls_are_where_they_are(self):
        done = self.succeed(self.room())
        self.assertIn("triangles", done.stdout.decode())
        names, vertices, faces = read_ply(self.out / "room.ply")
        self.assertEqual(names, ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "sigma",
                                 "inferred"])
        room = self.result()["room"]
        self.assertEqual((room["num_vertices"], room["num_triangles"]), (len(vertices), len(faces)))
        self.assertGreater(len(faces), 2000)
        self.assertEqual(sorted(set(index for face in faces for index in face)),
                         list(range(len(vertices))), "each vertex is of a triangle")
        scale, normals = self.scale(), 0
        # The camera's path is along x of the first camera, to within the odometry's error.
        self.assert_walls(self.out, scale)
        for v in vertices:
            normals += v["nz"] < -0.5  # towards the camera
            self.assertAlmostEqual(math.hypot(v["nx"], v["ny"], v["nz"]), 1, 3)
            self.assertGreater(v["sigma"], 0)
        self.assertGreater(normals / len(vertices), 0.85)
        nearest = {min(DEPTHS, key=lambda depth: abs(scale * v["z"] - depth)) for v in vertices}
        self.assertGreaterEqual(len(nearest), 4, "nearly all of the walls are there")

    def test_result_json_says_what_was_made(self):
        self.succeed(self.room("--depth-maps"))
        result = self.result()
        room = result["room"]
        for key in ("num_vertices", "num_triangles", "voxel", "size", "share_inferred",
                    "keyframes_used", "ms_per_keyframe", "memory_bytes", "truth"):
            self.assertIn(key, room)
        self.assertEqual(sorted(room["ms_per_keyframe"]), ["depth", "fusion", "mesh"])
        self.assertEqual(room["memory_bytes"], 64 << 20)
        self.assertEqual((room["share_inferred"], room["truth"]), (0, None))
        self.assertAlmostEqual(sum(room["pixels"].values()), 1, 6)
        self.assertGreater(room["pixels"]["measured"], 0.3)
        towards = room["pixels_towards"]  # the camera looks one way all the time
        self.assertAlmostEqual(sum(one["of_all_pixels"] for one in towards.values()), 1, 6)
        self.assertGreater(max(one["of_all_pixels"] for one in towards.values()), 0.9)
        self.assertIn("hardly looked at", (self.out / "report.html").read_text())
        self.assertEqual(len(os.listdir(self.out / "depth")), room["keyframes_used"])
        self.assertGreater(room["depth_maps"]["grey_levels_per_unit"], 0)
        # A run without them removes them.
        self.succeed(self.room())
        self.assertNotIn("depth", self.listing())

    def test_two_runs_write_the_same_bytes(self):
        self.succeed(self.room())
        other = self.folder / "other"
        self.succeed(self.room(out=other))
        for name in ("room.ply", "room.glb"):
            self.assertEqual((self.out / name).read_bytes(), (other / name).read_bytes(), name)

    def test_the_glb_holds_the_same_surface_with_y_up(self):
        self.succeed(self.room())
        _, vertices, faces = read_ply(self.out / "room.ply")
        gltf, buffer = read_glb((self.out / "room.glb").read_bytes())
        self.assertEqual(gltf["asset"]["version"], "2.0")
        self.assertEqual(len(buffer), gltf["buffers"][0]["byteLength"])
        self.assertNotIn("uri", gltf["buffers"][0])
        primitive = gltf["meshes"][0]["primitives"][0]
        self.assertEqual(sorted(primitive["attributes"]), ["COLOR_0", "NORMAL", "POSITION",
                                                           "_SIGMA"])
        kinds = {5125: "I", 5126: "f"}
        sizes = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

        def numbers(index):
            accessor = gltf["accessors"][index]
            view = gltf["bufferViews"][accessor["bufferView"]]
            row = struct.Struct("<" + sizes[accessor["type"]] * kinds[accessor["componentType"]])
            self.assertEqual(view["byteLength"], row.size * accessor["count"])
            self.assertEqual(view["byteOffset"] % 4, 0)
            return list(row.iter_unpack(buffer[view["byteOffset"]:][:view["byteLength"]]))

        positions = numbers(primitive["attributes"]["POSITION"])
        self.assertEqual(len(positions), len(vertices))
        self.assertEqual(len(numbers(primitive["indices"])), 3 * len(faces))
        self.assertEqual({c[3] for c in numbers(primitive["attributes"]["COLOR_0"])}, {1.0})
        accessor = gltf["accessors"][primitive["attributes"]["POSITION"]]
        self.assertEqual(accessor["max"], [max(p[k] for p in positions) for k in range(3)])
        # Without gravity the cameras say where up is: against their y axis.
        heights = [p[1] + v["y"] for p, v in zip(positions, vertices)]
        self.assertLess(max(heights) - min(heights), 0.1 * (accessor["max"][1] -
                                                            accessor["min"][1]))
        if VALIDATOR.is_dir():
            self.assert_valid(self.out / "room.glb")

    def assert_valid(self, path):
        """To the Khronos glTF validator, which has nothing to say against the file."""
        done = subprocess.run([ROOT / "scripts/check_glb", path], capture_output=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stdout.decode() + done.stderr.decode())
        self.assertIn(b"0 errors, 0 warnings, 0 infos", done.stdout)

    def test_odometry_makes_the_room_at_once(self):
        self.succeed(self.room())
        apart = self.result()["room"]
        both = self.folder / "both"
        done = self.succeed(self.run_program("odometry", self.source, "-o", both, "--room"))
        self.assertIn("triangles", done.stdout.decode())
        at_once = self.result(both)["room"]
        self.assertEqual(at_once["keyframes_used"], apart["keyframes_used"])
        # The poses that the files hold are rounded.
        self.assertAlmostEqual(at_once["num_triangles"] / apart["num_triangles"], 1, delta=0.05)
        for name in ("room.ply", "room.glb", "plan.svg", "plan.png", "trajectory.txt"):
            self.assertTrue((both / name).exists(), name)
        self.assertIn('id="room-data"', (both / "report.html").read_text())
        # A run without it leaves nothing of it.
        self.succeed(self.run_program("odometry", self.source, "-o", both))
        self.assertNotIn("room.ply", self.listing(both))
        self.assertIsNone(self.result(both)["room"])
        self.one_line(self.run_program("odometry", self.source, "-o", both, "--voxel", "0.1"),
                      "--room")

    def test_the_live_page_shows_the_surface_as_it_grows_and_ctrl_c_keeps_it(self):
        long, order = self.folder / "long", [*range(COUNT), *range(COUNT - 2, 0, -1)] * 400
        shutil.copytree(self.source, long)
        (long / "frames.txt").write_text("".join(
            f"{k / 25:.9f} images/{i:05}.png\n" for k, i in enumerate(order)))
        child = subprocess.Popen(
            [program(), "odometry", long, "-o", self.out, "--live", "--room", "--no-pictures"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(child.communicate)
        self.addCleanup(child.kill)
        address = re.search(r"http://[\d.:]+/", child.stdout.readline())
        if not address:
            self.skipTest(child.stderr.read().strip())

        def fetched(name):
            with urllib.request.urlopen(address.group() + name, timeout=20) as reply:
                return reply.read()

        data, end = {}, time.monotonic() + 60
        while (data.get("surface") or {}).get("num_keyframes", 0) < 2:
            self.assertLess(time.monotonic(), end, "no surface grows")
            data = json.loads(fetched("data.json"))
            time.sleep(0.05)
        bytes_ = fetched("surface.bin")
        path = np.reshape(data["path"], (-1, 3))
        if CHROMIUM:
            shown = subprocess.run(
                [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
                 "--virtual-time-budget=3000", f"--user-data-dir={self.folder}/profile",
                 address.group()], capture_output=True, timeout=120).stdout.decode()
            self.assertGreater(int(re.search(r'data-triangles="(\d+)"', shown).group(1)), 500)
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(timeout=60), 0)
        num_vertices, num_triangles = np.frombuffer(bytes_, np.uint32, 2)
        self.assertEqual(len(bytes_), 8 + 15 * num_vertices + 12 * num_triangles)
        vertices = np.frombuffer(bytes_, np.float32, 3 * num_vertices, 8).reshape(-1, 3)
        corners = np.frombuffer(bytes_, np.uint32, 3 * num_triangles, 8 + 12 * num_vertices)
        self.assertGreater(num_triangles, 500)
        self.assertLess(corners.max(), num_vertices)
        # The flown path is as long as the true one; its first frame is the world.
        scale = STEP * (COUNT - 1) / np.ptp(path[:, 0])
        off = away_from_walls(scale * (vertices - path[0]))
        self.assertLess(np.median(off), 0.02 * np.median(DEPTHS))
        # The flight ended with the signal, and the room is of what was flown until then.
        result = self.result()
        self.assertTrue(result["interrupted"])
        self.assertLess(result["num_frames"], len(order))
        self.assertGreater(result["room"]["num_triangles"], 1000)

    def test_up_is_where_attitudes_say_it_that_begin_after_the_film(self):
        """The map begins without an attitude, so its z axis is the camera's, not down."""
        late, both, roll = self.folder / "late", self.folder / "late_flight", math.radians(10)
        shutil.copytree(self.source, late)
        (late / "imu.txt").write_text("body_from_cam 0.5 0.5 0.5 0.5\n" + "".join(
            f"{t:.9f} {math.cos(roll / 2):.9f} {math.sin(roll / 2):.9f} 0 0 0.01"
            " nan nan nan nan nan nan\n" for t in TIMES[5:]))
        self.succeed(self.run_program("odometry", late, "-o", both, "--room"))
        self.succeed(self.room(folder=both))
        # The camera looks along the nose: a roll to the right tilts down to the picture's right.
        expected = (-math.sin(roll), -math.cos(roll), 0)
        for folder in (both, self.out):
            room = self.result(folder)["room"]
            self.assertEqual(room["up_source"], "gravity")
            for found, right in zip(room["up"], expected):
                self.assertAlmostEqual(found, right, delta=0.02)

    def test_the_plan_has_the_walls_and_a_scale(self):
        self.succeed(self.room())
        svg = (self.out / "plan.svg").read_text()
        self.assertTrue(svg.startswith("<svg ") and svg.endswith("</svg>\n"))
        self.assertIn("polyline", svg)
        self.assertIn("of floor", svg)
        self.assertGreater(self.result()["room"]["floor_area"], 0)
        self.assertEqual((self.out / "plan.png").read_bytes()[:4], b"\x89PNG")

    @unittest.skipUnless(CHROMIUM, "there is no Chromium")
    def test_the_page_shows_the_surface_and_measures(self):
        self.succeed(self.room())
        text = (self.out / "report.html").read_text()
        page = self.write("page.html", text.replace("</body>", PROBE + "</body>"))
        done = subprocess.run(
            [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--window-size=1000,800",
             "--virtual-time-budget=4000", f"--user-data-dir={self.folder}/profile", "--dump-dom",
             page.as_uri()], capture_output=True, timeout=120)
        title = re.search(r"<title>(.*?)</title>", done.stdout.decode()).group(1)
        found = json.loads(title)
        self.assertGreater(found["hits"], 3)
        self.assertGreater(found["facing"], 0.9)
        # The wall in the middle of the picture.
        self.assertAlmostEqual(self.scale() * found["depth"], DEPTHS[2], delta=0.06 * DEPTHS[2])
        self.assertGreater(found["lit"], 2000)
        number, sigma = re.match(r"([\d.]+) \u00b1 ([\d.]+) ", found["readout"]).groups()
        width, height = found["size"]
        expected = 40 / (0.62 * min(width, 1.5 * height)) * found["depth"]
        self.assertAlmostEqual(float(number), expected, delta=0.05 * expected)
        self.assertGreater(float(sigma), 0)
        self.assertIn("not the metre", found["readout"])

    # -- other sources of poses -----------------------------------------------------------------

    def assert_walls(self, out, scale, share=0.85):
        """Most vertices lie on a wall; scale: units of the truth in one of the file's."""
        _, vertices, _ = read_ply(out / "room.ply")
        right = sum(min(abs(scale * v["z"] - depth) / depth for depth in DEPTHS) < 0.03
                    for v in vertices)
        self.assertGreater(right / len(vertices), share)

    def test_poses_of_a_file_serve_as_well(self):
        self.succeed(self.room("--poses", self.source / "groundtruth.txt", folder=self.source))
        self.assert_walls(self.out, 1)
        self.assertEqual(self.result()["options"]["poses"], str(self.source / "groundtruth.txt"))

    def test_poses_that_the_pictures_contradict_are_refused(self):
        """The true path in a world that is turned: the cameras all have one rotation, and go along
        their x. Written as other programs do, each file is another path, and so is one that goes
        along their z."""
        turn = np.radians(100)
        axis = np.array([1, 2, 3]) / math.sqrt(14)
        x, y, z = math.sin(turn / 2) * axis
        w = math.cos(turn / 2)
        R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                      [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                      [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        places = [STEP * k * R[:, 0] for k in range(COUNT)]

        def file(rotation, places, name):
            return self.write(name, "".join(
                " ".join(f"{v:.9f}" for v in (t, *p, *rotation)) + "\n"
                for t, p in zip(TIMES, places)))

        other = self.folder / "other"
        for words, rotation, at in (
                ("quaternions with w first", (w, x, y, z), places),
                ("camera_from_world", (-x, -y, -z, w), [-R.T @ p for p in places]),
                ("of these frames", (x, y, z, w), [STEP * k * R[:, 2] for k in range(COUNT)])):
            with self.subTest(words):
                poses = file(rotation, at, "wrong.txt")
                done = self.room("--poses", poses, folder=self.source, out=other)
                self.assert_refused(done, "the pictures contradict", words, out=other)

    def test_poses_of_other_frames_and_another_focal_length_are_refused(self):
        data = Path(os.environ.get("TWOVIEW_DATA") or ROOT.parent / "shared/data") / "seq_tsukuba"
        if not data.is_dir():
            self.skipTest(f"no {data}")
        some = self.folder / "some"
        some.mkdir()
        (some / "images").symlink_to(data / "images")
        lines = (data / "frames.txt").read_text().splitlines()[40:58]
        self.write("some/frames.txt", "\n".join(lines) + "\n")
        camera = (data / "cameras.yaml").read_text()
        self.write("some/cameras.yaml", camera.replace("615", "492"))
        truth = (data / "groundtruth.txt").read_text().splitlines()[40:60]
        times, places = zip(*(line.split(" ", 1) for line in truth))
        late = "".join(f"{t} {p}\n" for t, p in zip(times[1:], places))
        other = self.folder / "other"
        done = self.room("--poses", data / "groundtruth.txt", folder=some, out=other)
        self.assert_refused(done, "the pictures contradict", "times the camera's focal length",
                            out=other)
        self.assertRegex(done.stderr.decode(), r"about 1\.2\d times")
        self.write("some/cameras.yaml", camera)
        done = self.room("--poses", self.write("late.txt", late), folder=some, out=other)
        self.assert_refused(done, "the pictures contradict", "as those of the frame after",
                            out=other)

    def test_pictures_of_another_flight_are_refused(self):
        other = self.folder / "other"
        shutil.copytree(self.source, other)
        names = sorted(os.listdir(other / "images"))
        lines = [f"{t:.9f} images/{name}\n" for t, name in zip(TIMES, names[::-1])]
        self.write("other/frames.txt", "".join(lines))
        self.assert_refused(self.room("--source", other), "flight/trajectory.txt",
                            "the pictures contradict", "Are these the pictures from which")

    def test_a_model_of_colmap_and_its_pictures_serve_as_well(self):
        model = self.folder / "model"
        shutil.copytree(self.flight / "colmap", model)
        pictures = self.folder / "pictures"
        shutil.copytree(self.source / "images", pictures / "images")
        # COLMAP's names are relative to the folder of the pictures.
        images = (model / "images.txt").read_text()
        self.assertIn(" images/", images)
        (model / "images.txt").write_text(images.replace(" images/", " "))
        (model / "points3D.txt").unlink()  # of poses alone: the points are found by matching
        self.succeed(self.room("--source", pictures / "images", folder=model))
        self.assert_walls(self.out, self.scale())
        other = self.folder / "other"
        self.assert_refused(self.room(folder=model, out=other), "--source is required", out=other)
        self.assert_refused(self.room("--source", self.folder, folder=model, out=other),
                            "none of the pictures", out=other)
        (model / "images.txt").write_text("1 0 0 0 0 1 2 3 1 00000.png\n\n")
        self.assert_refused(self.room("--source", pictures / "images", folder=model, out=other),
                            "images.txt: line 1 has a quaternion of length 0", out=other)
        (model / "cameras.txt").write_text("1 PINHOLE 320 240 300 300 160 120\n"
                                           "2 PINHOLE 320 240 300 300 160 120\n")
        self.assert_refused(self.room("--source", pictures / "images", folder=model, out=other),
                            "2 cameras", out=other)

    def test_frames_without_poses_are_refused(self):
        self.assert_refused(self.room(folder=self.source), "--poses is required")
        late = self.write("late.txt", "1000 0 0 0 0 0 0 1\n1001 1 0 0 0 0 0 1\n")
        self.assert_refused(self.room("--poses", late, folder=self.source), "no pose has the time")
        self.write("binary/images.bin", b"x")
        self.assert_refused(self.room(folder=self.folder / "binary"), "model_converter")

    # -- beside the truth -----------------------------------------------------------------------

    def truth(self, *more, **options):
        done = self.succeed(self.room(*more, **options))
        self.assertIn("truth        F ", done.stdout.decode())
        return self.result()["room"]["truth"]

    def of_true_poses(self, *more):
        return self.truth("--poses", self.source / "groundtruth.txt", *more, folder=self.source)

    def beside_walls(self):
        """The scores beside the true walls, of one run for the tests that compare others with."""
        if self.walls_truth is None:
            RoomTest.walls_truth = self.of_true_poses("--truth-mesh",
                                                      self.write("walls.ply", ply_mesh()))
        return self.walls_truth

    def test_the_scores_are_those_of_counting_by_brute_force(self):
        truth = self.of_true_poses("--truth-mesh", self.write("walls.ply", ply_mesh()))
        for key, expected in brute_force_scores(self.out).items():
            self.assertAlmostEqual(truth[key], expected, delta=0.015, msg=key)
            self.assertIn(key, truth["registered"])
        self.assertGreater(truth["f_5cm"], 0.3)
        self.assertLess(truth["f_5cm"], 0.95)  # so that the comparison says something
        self.assertEqual(truth["measured_precision_5cm"], truth["precision_5cm"])
        self.assertIsNone(truth["inferred_precision_5cm"])
        self.assertEqual((truth["placed_by"], truth["share_judged"]), ("the given poses", 1))
        self.assertIn("Beside the true surface", (self.out / "report.html").read_text())

    def test_every_form_of_ply_is_the_same_truth(self):
        own = self.beside_walls()  # of quadrilaterals in ASCII
        for kind, quads in (("binary_little_endian", False), ("binary_big_endian", True)):
            truth = self.of_true_poses("--truth-mesh", self.write("w.ply", ply_mesh(kind, quads)))
            for key in ("precision_5cm", "accuracy_median", "f_5cm"):
                self.assertAlmostEqual(truth[key], own[key], delta=0.005, msg=kind)

    def test_a_truth_that_is_moved_is_found_by_registering(self):
        moved = ply_mesh().decode().split("end_header\n")
        lines = moved[1].splitlines()
        for k in range(4 * len(WALLS)):
            x, y, red, z = lines[k].split()
            lines[k] = f"{x} {y} {red} {float(z) + 0.1}"
        mesh = self.write("moved.ply", moved[0] + "end_header\n" + "\n".join(lines) + "\n")
        truth = self.of_true_poses("--truth-mesh", mesh)
        own = self.beside_walls()
        self.assertLess(truth["f_5cm"], 0.6 * own["f_5cm"])
        self.assertAlmostEqual(truth["registered"]["precision_5cm"],
                               own["registered"]["precision_5cm"], delta=0.02)

    def test_a_flight_is_placed_by_its_true_path(self):
        mesh = self.write("walls.ply", ply_mesh())
        truth = self.truth("--truth-mesh", mesh)  # the odometry knew groundtruth.txt
        self.assertEqual(truth["placed_by"], "the true path")
        self.assertGreater(truth["f_5cm"], 0.3)
        self.assertEqual(truth, self.truth("--truth-mesh", mesh, "--truth",
                                           self.source / "groundtruth.txt"))
        both = self.folder / "both"
        self.succeed(self.run_program("odometry", self.source, "-o", both, "--room",
                                      "--truth-mesh", mesh))
        self.assertAlmostEqual(self.result(both)["room"]["truth"]["f_5cm"], truth["f_5cm"],
                               delta=0.03)

    def depth_folder(self, name="depth", **options):
        for i in range(0, COUNT, 3):
            self.write(f"{name}/{i:05}.png", depth_picture(**options))
        return self.folder / name

    def test_true_depths_say_what_a_true_mesh_says(self):
        folder = self.depth_folder()
        by_mesh = self.beside_walls()
        truth = self.of_true_poses("--truth-depth", folder, "--truth-scale", "2000")
        for key in ("precision_5cm", "recall_5cm", "f_5cm"):
            self.assertAlmostEqual(truth[key], by_mesh[key], delta=0.08, msg=key)
        self.assertGreater(truth["share_judged"], 0.9)
        # Without a true path the frames' own poses serve, with a scale fitted to the map's points.
        result = json.loads((self.flight / "result.json").read_text())
        alone = self.folder / "alone"
        shutil.copytree(self.flight, alone)
        result["options"]["truth"] = None
        self.write("alone/result.json", json.dumps(result))
        own = self.truth("--truth-depth", folder, "--truth-scale", "2000", folder=alone)
        self.assertIn("fitted to the map's points", own["placed_by"])
        self.assertGreater(own["f_5cm"], 0.3)
        self.assert_refused(self.room("--truth-mesh", self.write("walls.ply", ply_mesh()),
                                      folder=alone, out=self.folder / "other"),
                            "--truth is required", out=self.folder / "other")

    def test_a_truth_that_is_none_is_refused(self):
        def refused(words, *more):
            self.assert_refused(self.room(*more), words)
        whole = ply_mesh("binary_little_endian")
        for data, words in ((b"solid\n", "no PLY"), (whole[:-40], "truncated"),
                            (whole[:60], "header"),
                            (whole.replace(b"element face 5", b"element face 0"), "faces"),
                            (ply_mesh().replace(b"4 0 1 2 3", b"4 0 1 2 99"), "99 of 20"),
                            (ply_mesh().replace(b"double z", b"double w"), "x y z"),
                            (ply_mesh().replace(b" 200 ", b" nan ", 1), "nan")):
            refused(words, "--truth-mesh", self.write("bad.ply", data))
        refused("gone.ply", "--truth-mesh", self.folder / "gone.ply")
        refused("truth-scale", "--truth-depth", self.depth_folder())
        (self.folder / "empty").mkdir()
        refused("holds no pictures", "--truth-depth", self.folder / "empty", "--truth-scale", "1")
        refused("cannot read", "--truth-depth", self.folder / "gone", "--truth-scale", "1")
        self.write("grey/00000.png", PICTURES[0])
        refused("16 bits", "--truth-depth", self.folder / "grey", "--truth-scale", "1")
        self.write("other/cat.png", depth_picture())
        refused("belongs to a frame", "--truth-depth", self.folder / "other", "--truth-scale", "1")
        self.write("shape/00000.png", png(10, 240, [9] * 2400, depth=16))
        refused("shape", "--truth-depth", self.folder / "shape", "--truth-scale", "1")
        refused("--truth is for", "--truth", self.source / "groundtruth.txt")

    # -- what cannot make a room ------------------------------------------------------------------

    def test_a_turn_on_the_spot_measures_nothing_and_says_so(self):
        still = self.write("still.txt", "".join(f"{t:.9f} 0 0 0 0 0 0 1\n" for t in TIMES))
        done = self.room("--poses", still, folder=self.source)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "no surface")
        room = self.result()["room"]
        self.assertEqual((room["keyframes_used"], room["num_triangles"]), (0, 0))
        self.assertGreater(room["pixels"]["seen_from_one_place"], 0.5)
        self.assertEqual(self.listing(), ["report.html", "result.json"])

    def test_pictures_without_texture_measure_nothing_and_say_so(self):
        plain = self.folder / "plain"
        shutil.copytree(self.source, plain)
        for i in range(COUNT):
            (plain / f"images/{i:05}.png").write_bytes(png(320, 240, bytes([90]) * (320 * 240)))
        done = self.room("--poses", plain / "groundtruth.txt", folder=plain)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "no surface")
        self.assertGreater(self.result()["room"]["pixels"]["no_texture"], 0.95)
        self.assertIn("without texture", (self.out / "report.html").read_text())

    def test_a_single_pose_has_no_partner(self):
        one = self.write("one.txt", f"{TIMES[3]:.9f} 0 0 0 0 0 0 1\n")
        done = self.room("--poses", one, folder=self.source)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "no surface")

    # -- memory and voxels --------------------------------------------------------------------

    def test_a_room_that_does_not_fit_gets_coarser_and_says_so(self):
        done = self.succeed(self.room("--voxel", "0.02", "--max-memory", "1"))
        room = self.result()["room"]
        self.assertEqual(room["first_voxel"], 0.02)
        self.assertGreaterEqual(room["voxel"], 0.04)
        self.assertIn("memory was full", done.stdout.decode())
        self.assertEqual(room["memory_bytes"], 1 << 20)
        # Maps are fused anew as thick as their standard deviations ask, and not as before in voxels
        # that have doubled: twice the memory is enough for half the voxel.
        self.succeed(self.room("--voxel", "0.02", "--max-memory", "2"))
        self.assertLessEqual(self.result()["room"]["voxel"], room["voxel"] / 2)
        # What one keyframe alone saw makes way: 0.32 without that.
        self.succeed(self.room("--voxel", "0.08", "--max-memory", "8"))
        self.assertEqual(self.result()["room"]["voxel"], 0.16)

    # -- bad input ----------------------------------------------------------------------------

    def test_a_folder_that_odometry_did_not_write(self):
        self.write("none/readme.txt", "nothing")
        self.assert_refused(self.room(folder=self.folder / "none"), "result.json")
        self.write("other/result.json", '{"R": null}')
        self.assert_refused(self.room(folder=self.folder / "other"), "not of twoview odometry")
        self.write("other/result.json", "no json")
        self.assert_refused(self.room(folder=self.folder / "other"), "not of twoview odometry")

    def test_a_flight_in_which_nothing_was_tracked(self):
        plain = self.folder / "plain"
        shutil.copytree(self.source, plain)
        for i in range(COUNT):
            (plain / f"images/{i:05}.png").write_bytes(PICTURES[0])
        lost = self.folder / "lost"
        self.assertEqual(self.run_program("odometry", plain, "-o", lost).returncode, 3)
        self.assert_refused(self.room(folder=lost), "nothing could be tracked")

    def test_two_segments_in_different_units_are_not_mixed(self):
        two = self.folder / "two"
        shutil.copytree(self.source, two)
        lines = (two / "frames.txt").read_text()
        for k in range(COUNT, 2 * COUNT):  # after a covered lens another scene: the first, mirrored
            rows = [LUMA[k - COUNT][y * WIDTH:][:WIDTH][::-1] for y in range(HEIGHT)]
            data = bytes(WIDTH * HEIGHT) if k < COUNT + 3 else b"".join(rows)
            (two / f"images/{k:05}.png").write_bytes(png(WIDTH, HEIGHT, data))
            lines += f"{k / 25:.9f} images/{k:05}.png\n"
        (two / "frames.txt").write_text(lines)
        flight = self.folder / "flight"
        self.run_program("odometry", two, "-o", flight)
        self.assertEqual(self.result(flight)["num_segments"], 2)
        done = self.succeed(self.room(folder=flight))
        self.assertIn("2 segments whose units and places do not compare", done.stdout.decode())
        self.assert_walls(self.out, self.scale(), share=0.8)

    def test_pictures_that_have_gone_are_counted(self):
        moved = self.folder / "moved"
        shutil.copytree(self.source, moved)
        for i in range(COUNT // 2, COUNT):
            (moved / f"images/{i:05}.png").unlink()
        done = self.room("--source", moved)
        self.assertIn("could not be read", done.stdout.decode() + done.stderr.decode())
        if done.returncode != 2:
            self.assertGreater(self.result()["room"]["pictures_missing"], 0)

    def test_ctrl_c_keeps_what_there_is(self):
        # Forth and back several times, so that the signal comes before the end.
        long, order = self.folder / "long", [*range(COUNT), *range(COUNT - 2, 0, -1)] * 8
        shutil.copytree(self.source, long)
        (long / "frames.txt").write_text("".join(
            f"{k / 25:.9f} images/{i:05}.png\n" for k, i in enumerate(order)))
        path = self.write("path.txt", "".join(f"{k / 25:.9f} {STEP * i} 0 0 0 0 0 1\n"
                                              for k, i in enumerate(order)))
        master, slave = pty.openpty()
        process = subprocess.Popen(
            [program(), "room", long, "--poses", path, "-o", self.out], stdout=subprocess.PIPE,
            stderr=slave, env={**os.environ, "TERM": "xterm"})
        os.close(slave)
        shown = b""
        while not re.search(rb"room: [1-9]\d* of \d+ keyframes", shown):
            shown += os.read(master, 4096)
        process.send_signal(signal.SIGINT)
        said = process.stdout.read().decode()
        self.assertEqual(process.wait(timeout=60), 0)
        process.stdout.close()
        os.close(master)
        result = self.result()
        self.assertTrue(result["interrupted"])
        self.assertIn("interrupted: the room is of what had been read until then", said)
        self.assertGreater(len(read_ply(self.out / "room.ply")[2]), 1000)

    def test_a_source_that_has_gone_or_moved(self):
        moved = self.folder / "moved"
        shutil.copytree(self.source, moved)
        shutil.copytree(self.flight, self.folder / "flight")
        result = json.loads((self.folder / "flight/result.json").read_text())
        result["source"] = str(self.folder / "gone")
        self.write("flight/result.json", json.dumps(result))
        self.assert_refused(self.room(folder=self.folder / "flight"), "gone", "--source")
        self.succeed(self.room("--source", moved, folder=self.folder / "flight"))
        shutil.rmtree(moved / "images")
        other = self.folder / "other"
        self.assert_refused(self.room("--source", moved, folder=self.folder / "flight", out=other),
                            "picture", out=other)

    def test_pictures_of_another_size_are_refused(self):
        moved = self.folder / "moved"
        shutil.copytree(self.source, moved)
        for i in range(COUNT):
            (moved / f"images/{i:05}.png").write_bytes(png(160, 120, bytes(160 * 120)))
        (moved / "cameras.yaml").unlink()
        self.assert_refused(self.room("--source", moved), "320x240")

    def test_results_of_another_verb_stay(self):
        self.one_line(self.room(out=self.flight), "give another -o")
        self.assertIn("longest_segment", (self.flight / "result.json").read_text())

    def test_a_full_disk_is_one_line(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (30000, 30000))
        done = self.room("--quiet", preexec_fn=limit)
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "cannot write")
        self.assertFalse(self.out.exists(), "something was written")


if __name__ == "__main__":
    main()
