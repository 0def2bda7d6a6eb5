#!/usr/bin/env python3
"""Tests of `twoview odometry`: a rendered flight past five walls, whose path is known, in every
format of a source, and bad input."""
import csv
import http.client
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import struct
import subprocess
import time
import unittest
from pathlib import Path

from cli_support import CliTest, camera_yaml, main, png, png_samples, program

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
DATA = Path(os.environ.get("TWOVIEW_DATA") or SHARED / "data")
WIDTH, HEIGHT, FOCAL, COUNT = 320, 240, 300.0, 20
SHIFTS = (9, 4, 7, 3, 5)  # pixels a frame, of each wall
FPS = 25.0
FILES = ["cloud.ply", "colmap", "frames.csv", "keyframes.txt", "live.txt", "map.twm",
         "report.html", "result.json", "trajectory.txt"]
CAMERAS = f"""cam0:
  image_width: {WIDTH}
  image_height: {HEIGHT}
  fx: {FOCAL}
  fy: {FOCAL}
  cx: {(WIDTH - 1) / 2}
  cy: {(HEIGHT - 1) / 2}
"""


def smooth_noise(width, height):
    """Random grey, the mean of 5 x 5 pixels with four times the contrast: corners everywhere."""
    rng = random.Random(3)
    rows = [[rng.randrange(256) for _ in range(width + 4)] for _ in range(height + 4)]
    rows = [[sum(row[x:x + 5]) for x in range(width)] for row in rows]
    return [bytes(max(0, min(255, 4 * sum(column) // 25 - 381)) for column in zip(*rows[y:y + 5]))
            for y in range(height)]


def render():
    """The frames of a camera that flies to the right; each wall moves left by its own shift."""
    wide = smooth_noise(WIDTH + COUNT * max(SHIFTS), HEIGHT)
    return [b"".join(row[i * SHIFTS[y * 5 // HEIGHT]:][:WIDTH]
                     for y, row in enumerate(wide)) for i in range(COUNT)]


LUMA = render()
PICTURES = [png(WIDTH, HEIGHT, luma) for luma in LUMA]
TIMES = [i / FPS for i in range(COUNT)]
TUM_TRUTH = "# the true path\n" + "".join(f"{t:.9f} {0.1 * i} 0 0 0 0 0 1\n"
                                           for i, t in enumerate(TIMES))


def poses(path):
    """{time: its other numbers} of a TUM file, and its comments."""
    lines = path.read_text().splitlines()
    numbers = [list(map(float, line.split())) for line in lines if not line.startswith("#")]
    return {n[0]: n[1:] for n in numbers}, [line for line in lines if line.startswith("#")]


class OdometryTest(CliTest):
    def set_folder(self, name="set", truth=TUM_TRUTH):
        for i, data in enumerate(PICTURES):
            self.write(f"{name}/images/{i:05}.png", data)
        self.write(f"{name}/frames.txt", "# timestamp filename\n" + "".join(
            f"{t:.9f} images/{i:05}.png\n" for i, t in enumerate(TIMES)))
        self.write(f"{name}/cameras.yaml", CAMERAS)
        if truth:
            self.write(f"{name}/groundtruth.txt", truth)
        return self.folder / name

    def odometry(self, source, *more, out=None, **options):
        return self.run_program("odometry", source, "-o", out or self.out, *more, **options)

    def files(self):
        """What the run wrote. covariances.txt is there where a keyframe has a covariance."""
        return [name for name in self.listing() if name != "covariances.txt"]

    def imu(self, name="set", lines=None):
        """The imu.txt of the flight: the camera looks along the nose and flies to the right."""
        if lines is None:
            lines = [f"{t:.9f} 1 0 0 0 0.01 1.5 0.015 0 {0.1 * FPS} 0 0.02" for t in TIMES]
        return self.write(f"{name}/imu.txt", "# as docs/formats.md says\n"
                          "body_from_cam 0.5 0.5 0.5 0.5\n" + "\n".join(lines) + "\n")

    def trajectory(self, out=None):
        return ((out or self.out) / "trajectory.txt").read_bytes()

    # -- a whole run --------------------------------------------------------------------------

    def test_a_set_folder_gives_all_files_and_the_flown_path(self):
        done = self.succeed(self.odometry(self.set_folder()))
        self.assertEqual(self.files(), FILES)
        self.assertIn(f"{COUNT} frames", done.stdout.decode())
        result = self.result()
        self.assertEqual(result["num_frames"], COUNT)
        self.assertEqual(result["num_tracked"], COUNT)
        self.assertEqual(sum(result["status_counts"].values()), COUNT)
        self.assertEqual((result["scale"], result["scale_sigma"]), ("unit", None))
        self.assertEqual(result["truth"]["coverage"], 1)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 0.5)
        self.assertLess(result["truth"]["rpe_rotation_deg"], 0.2)
        self.assertAlmostEqual(result["truth"]["path_length"], 0.1 * (COUNT - 1), 9)
        self.assertIsNone(result["truth"].get("ate_metric_rmse"))
        # The path of the estimate over that of the truth is the ratio of the scales.
        self.assertAlmostEqual(result["path_length"] / result["truth"]["path_length"],
                               result["truth"]["scale_ratio"],
                               delta=0.02 * result["truth"]["scale_ratio"])
        path, comments = poses(self.out / "trajectory.txt")
        self.assertEqual(sorted(path), [round(t, 9) for t in TIMES])
        self.assertEqual(sum("segment" in c for c in comments), 1)
        for value in path.values():
            self.assertAlmostEqual(math.hypot(*value[3:]), 1, 6)
        live, _ = poses(self.out / "live.txt")
        self.assertTrue(set(live) < set(path), "the first frames are found afterwards")
        self.assertLessEqual(len(poses(self.out / "keyframes.txt")[0]), result["num_keyframes"])
        with open(self.out / "frames.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["name"] for row in rows],
                         [f"images/{i:05}.png" for i in range(COUNT)])
        self.assertEqual([float(row["timestamp"]) in live for row in rows],
                         [row["segment"] == "0" for row in rows])
        for row in rows:
            self.assertIn(row["status"], result["status_counts"])
            self.assertIn(row["pose"], ("tracked", "located"))
            # Reasons of the map are the odometry's own, each in the words of a verdict, too.
            words = {"unconfirmed": "low_parallax", "contradicted": "two_planar_solutions",
                     "one_plane": "two_planar_solutions", "jumped": "low_parallax",
                     "unsure_attitude": "low_parallax", "velocities_disagree": "second_motion"}
            self.assertLessEqual({words[reason] for reason in row["map_reasons"].split()},
                                 set(row["reasons"].split()))
        self.assertIn("unconfirmed", {row["map_reasons"] for row in rows}, "as a segment begins")
        self.assertEqual(sum(int(row["is_keyframe"]) for row in rows), result["num_keyframes"])
        for key in ("mean", "median", "p99", "max"):
            self.assertGreater(result["time_ms"][key], 0)

    def test_frames_that_were_followed_by_their_turn_are_found_in_the_finished_map(self):
        sequence = DATA / "seq_tum_fr1_rpy"
        if not sequence.is_dir():
            self.skipTest(f"no {sequence}")
        self.succeed(self.odometry(sequence, "--max-frames", "300", timeout=120))
        with open(self.out / "frames.csv", newline="") as file:
            turned = [row for row in csv.DictReader(file) if row["status"] == "rotation"]
        self.assertGreaterEqual(len(turned), 2, "while they came, the map did not reach them")
        self.assertEqual({row["pose"] for row in turned}, {"located"})
        live, _ = poses(self.out / "live.txt")
        path, _ = poses(self.out / "trajectory.txt")
        times = [round(float(row["timestamp"]), 9) for row in turned]
        self.assertEqual(len({tuple(live[t][:3]) for t in times}), 1, "the position was held")
        self.assertEqual(len({tuple(path[t][:3]) for t in times}), len(times))
        self.assertLess(self.result()["truth"]["ate_rmse"], 0.03)

    def test_a_principal_point_that_keyframes_contradict_is_moved(self):
        sequence = DATA / "seq_kitti00_first200"
        if not sequence.is_dir():
            self.skipTest(f"no {sequence}")
        given, first = 607.1928, ("--max-frames", "125")
        done = self.succeed(self.odometry(sequence, *first, timeout=120))
        self.assertIn("many keyframes agree that its principal point is off", done.stdout.decode())
        x, y = self.result()["principal_point_shift_px"]
        # kitti00_turn's pairs ask for (-10, 2) px: docs/algorithms/principal_point.md.
        self.assertTrue(-13 < x < -7 and -2 < y < 6, f"{x}, {y}")
        camera = self.out / "corrected_camera.yaml"
        matrix = re.search(r"data: \[ ([^]]*) \]", camera.read_text())[1].split(",")
        self.assertAlmostEqual(float(matrix[2]), given + x, 9)
        info = self.succeed(self.run_program("map", "info", self.out / "map.twm", "--json"))
        self.assertAlmostEqual(json.loads(info.stdout)["camera"]["cx"], given + x, 9)
        colmap = (self.out / "colmap/cameras.txt").read_text().split()
        self.assertAlmostEqual(float(colmap[-2]), given + x + 0.5, 9)
        # With that camera nothing is left to move, and the file is not written over.
        text = camera.read_bytes()
        self.succeed(self.odometry(sequence, *first, "--camera", camera, timeout=120))
        self.assertIsNone(self.result()["principal_point_shift_px"])
        self.assertEqual(camera.read_bytes(), text)
        done = self.succeed(self.odometry(sequence, *first, "--keep-camera", timeout=120))
        self.assertNotIn("principal point", done.stdout.decode())
        self.assertIsNone(self.result()["principal_point_shift_px"])
        self.assertTrue(self.result()["options"]["keep_camera"])
        self.assertFalse(camera.exists(), "that of an earlier run is removed")

    def test_the_cloud_has_the_walls(self):
        self.succeed(self.odometry(self.set_folder()))
        data = (self.out / "cloud.ply").read_bytes()
        head, body = data.split(b"end_header\n", 1)
        count = int(re.search(rb"element vertex (\d+)", head)[1])
        self.assertTrue(0.8 * self.result()["num_points"] < count <= self.result()["num_points"])
        self.assertEqual(len(body), 27 * count)
        points = [struct.unpack_from("<fff", body, 27 * i) for i in range(count)]
        # The first keyframe is the world: a wall's depth is one over its shift.
        depths = {shift: [] for shift in SHIFTS}
        for x, y, z in points:
            row = FOCAL * y / z + (HEIGHT - 1) / 2
            if 0 <= row < HEIGHT:
                depths[SHIFTS[int(row * 5 / HEIGHT)]].append(z * SHIFTS[int(row * 5 / HEIGHT)])
        middles = [sorted(d)[len(d) // 2] for d in depths.values()]
        self.assertGreater(min(map(len, depths.values())), 10)
        self.assertLess(max(middles) / min(middles), 1.06)

    def test_the_points_have_the_colours_of_their_pixels(self):
        """Every pixel is (v, v // 2, 255 - v), and so is every point; of grey ones (v, v, v)."""
        grey = self.set_folder("grey")
        coloured = self.set_folder("coloured")
        for i, data in enumerate(PICTURES):
            samples = [c for v in png_samples(data) for c in (v, v // 2, 255 - v)]
            self.write(f"coloured/images/{i:05}.png",
                       png(WIDTH, HEIGHT, samples, channels=3))
        for folder, colour in ((grey, lambda v: (v, v, v)),
                               (coloured, lambda v: (v, v // 2, 255 - v))):
            self.succeed(self.odometry(folder))
            head, body = (self.out / "cloud.ply").read_bytes().split(b"end_header\n", 1)
            # COLMAP takes no other types and no other spelling of them.
            self.assertEqual(re.findall(r"^property (\w+) (\w+)$", head.decode(), re.M), [
                *(("float", name) for name in "xyz"),
                *(("uchar", name) for name in ("red", "green", "blue")),
                *(("float", name) for name in ("num_observations", "sigma", "segment"))])
            points = list(struct.iter_unpack("<fffBBBfff", body))
            self.assertGreater(len(points), 100)
            self.assertGreater(len({p[3] for p in points}), 20)
            for p in points:
                self.assertEqual(p[3:6], colour(p[3]))
                self.assertEqual(p[6], int(p[6]))
                self.assertGreaterEqual(p[6], 2)
            for line in (self.out / "colmap" / "points3D.txt").read_text().splitlines():
                if not line.startswith("#"):
                    red, green, blue = map(int, line.split()[4:7])
                    self.assertEqual((red, green, blue), colour(red))
            self.succeed(self.run_program("map", "export", self.out / "map.twm", "-o",
                                          self.folder / "exported"))
            data = (self.folder / "exported" / "cloud.ply").read_bytes()
            greys = list(struct.iter_unpack("<fffBBBfff", data.split(b"end_header\n", 1)[1]))
            self.assertTrue(all(p[3] == p[4] == p[5] for p in greys), "a map's are grey")
            # The map's grey levels are of the same place, between pixels.
            apart = sorted(abs(0.299 * p[3] + 0.587 * p[4] + 0.114 * p[5] - grey[3])
                           for p, grey in zip(points, greys))
            self.assertLess(apart[len(apart) // 2], 8)

    def test_a_blank_in_a_name_of_the_colmap_model_is_named(self):
        for i, data in enumerate(PICTURES):
            self.write(f"pictures/my {i:05}.png", data)
        camera = self.write("camera.yaml", camera_yaml(WIDTH, HEIGHT, FOCAL))
        done = self.succeed(self.odometry(self.folder / "pictures", "--fps", "15", "--camera",
                                          camera))
        note, = (n for n in self.result()["notes"] if "blank" in n)
        self.assertIn("'my 00000.png' has a blank", note)
        self.assertIn("has a blank", done.stdout.decode())
        self.assertNotIn("my ", (self.out / "colmap/sparse/images.txt").read_text())

    def test_the_colmap_model_is_consistent(self):
        self.succeed(self.odometry(self.set_folder()))

        def rows(name):
            text = (self.out / "colmap" / name).read_text()
            return [line.split() for line in text.split("\n") if not line.startswith("#")][:-1]

        camera, = rows("cameras.txt")
        self.assertEqual(camera[1:4], ["PINHOLE", str(WIDTH), str(HEIGHT)])
        # COLMAP's pixels begin at the corner of the first one.
        self.assertEqual(list(map(float, camera[4:])), [FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2])
        points = {p[0]: p for p in rows("points3D.txt")}
        images = rows("images.txt")
        seen = set()
        errors = []
        for head, pixels in zip(images[::2], images[1::2]):
            w, x, y, z, *t = map(float, head[1:8])
            R = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                 [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                 [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
            for k in range(0, len(pixels), 3):
                point = points[pixels[k + 2]]
                seen.add((pixels[k + 2], head[0], str(k // 3)))
                X = list(map(float, point[1:4]))
                c = [sum(R[r][k] * X[k] for k in range(3)) + t[r] for r in range(3)]
                errors.append(math.hypot(FOCAL * c[0] / c[2] + WIDTH / 2 - float(pixels[k]),
                                         FOCAL * c[1] / c[2] + HEIGHT / 2 - float(pixels[k + 1])))
        self.assertLess(sorted(errors)[len(errors) // 2], 1)
        tracks = {(p[0], p[k], p[k + 1]) for p in points.values() for k in range(8, len(p), 2)}
        self.assertEqual(tracks, seen)

    def test_a_run_without_a_map_leaves_no_model_of_an_earlier_run(self):
        self.succeed(self.odometry(self.set_folder()))
        self.assertTrue((self.out / "colmap" / "images.txt").is_file())
        still = self.folder / "still"
        still.mkdir()
        for i in range(4):
            (still / f"{i}.png").write_bytes(PICTURES[0])
        run = (still, "--fps", 10, "--camera", self.camera)
        self.assertEqual(self.odometry(*run).returncode, 3)
        self.assertNotIn("colmap", self.listing())
        # What is not of the model, or is read by the run, stays.
        (self.out / "colmap").mkdir()
        (self.out / "colmap" / "mine.txt").write_text("kept")
        given = self.out / "colmap" / "cameras.txt"
        given.write_text(f"1 PINHOLE {WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2}\n")
        (self.out / "colmap" / "images.txt").write_text("old")
        self.assertEqual(self.odometry(*run[:-1], given).returncode, 3)
        self.assertEqual(sorted(path.name for path in (self.out / "colmap").iterdir()),
                         ["cameras.txt", "mine.txt"])

    def test_the_cloud_has_what_two_keyframes_see_apart(self):
        """From the middle of the path there and back: the first keyframe is at no end of it."""
        source = self.set_folder()
        order = [8, 9, 10, 9, 8, 7, 6, 5, 4, 3, 2]
        (source / "frames.txt").write_text("".join(f"{i / FPS:.9f} images/{k:05}.png\n"
                                                   for i, k in enumerate(order)))
        self.succeed(self.odometry(source))
        folder = self.out / "colmap"
        images = [line.split() for line in (folder / "images.txt").read_text().splitlines()
                  if not line.startswith("#")][::2]
        # Turns are below 0.2 degrees, so that the camera is where its translation's opposite is.
        centres = {head[0]: [-float(t) for t in head[5:8]] for head in images}

        def largest_angle(point):
            rays = [[float(x) - c for x, c in zip(point[1:4], centres[image])]
                    for image in point[8::2]]
            return max(math.acos(min(1, sum(a * b for a, b in zip(one, other)) /
                                     math.hypot(*one) / math.hypot(*other)))
                       for one in rays for other in rays)

        angles = [math.degrees(largest_angle(line.split()))
                  for line in (folder / "points3D.txt").read_text().splitlines()
                  if not line.startswith("#")]
        count = int(re.search(rb"element vertex (\d+)", (self.out / "cloud.ply").read_bytes())[1])
        self.assertEqual(count, sum(angle >= 1.5 for angle in angles))
        self.assertLess(count, len(angles))

    def test_a_run_repeats_and_json_is_the_result(self):
        source = self.set_folder()
        done = self.succeed(self.odometry(source, "--json", "--max-frames", 9))
        self.assertEqual(json.loads(done.stdout), self.result())
        self.assertEqual(self.result()["num_frames"], 9)
        first = self.trajectory(), (self.out / "map.twm").read_bytes()
        done = self.succeed(self.odometry(source, "--quiet", "--max-frames", 9))
        self.assertEqual(done.stdout, b"")
        self.assertEqual((self.trajectory(), (self.out / "map.twm").read_bytes()), first)
        self.succeed(self.odometry(source, "--quiet", "--every", 2, "--max-frames", 6))
        rows = (self.out / "frames.csv").read_text().splitlines()[1:]
        self.assertEqual([row.split(",")[1] for row in rows],
                         [f"images/{i:05}.png" for i in range(0, 12, 2)])

    def test_a_map_tells_what_it_holds(self):
        self.succeed(self.odometry(self.set_folder()))
        path, result = self.out / "map.twm", self.result()
        info = json.loads(self.succeed(self.run_program("map", "info", path, "--json")).stdout)
        self.assertEqual([info[k] for k in ("num_keyframes", "num_points", "num_segments")],
                         [result[k] for k in ("num_keyframes", "num_points", "num_segments")])
        self.assertEqual((info["image_size"], info["camera"]["fx"]), ([WIDTH, HEIGHT], FOCAL))
        self.assertIn(b"keyframes over", self.run_program("map", "info", path).stdout)
        self.succeed(self.run_program("map", "export", path, "-o", self.folder / "more"))
        for name in ("cloud.ply", "keyframes.txt"):
            self.assertEqual((self.folder / "more" / name).read_bytes(),
                             (self.out / name).read_bytes(), name)
        data = path.read_bytes()
        for wrong in (b"no map", data[:-1], data[:500] + b"\0\0" + data[502:], data + b"x"):
            done = self.run_program("map", "info", self.write("wrong.twm", wrong))
            self.assertEqual(done.returncode, 2)
            self.one_line(done, "wrong.twm")

    def test_maps_are_merged_where_one_sees_what_another_saw(self):
        whole = self.set_folder()
        self.succeed(self.odometry(whole))
        first = self.folder / "first.twm"
        first.write_bytes((self.out / "map.twm").read_bytes())
        lines = (whole / "frames.txt").read_text().splitlines()
        (whole / "frames.txt").write_text("\n".join(lines[6:]) + "\n")
        self.succeed(self.odometry(whole))
        second, merged = self.out / "map.twm", self.folder / "merged.twm"
        counts = [json.loads(self.succeed(self.run_program("map", "info", path, "--json")).stdout)
                  for path in (first, second)]
        done = self.succeed(self.run_program("map", "merge", first, second, "-o", merged))
        self.assertIn(b"1 segment was seen again", done.stdout)
        info = json.loads(self.succeed(self.run_program("map", "info", merged, "--json")).stdout)
        self.assertEqual(info["num_keyframes"], sum(c["num_keyframes"] for c in counts))
        self.assertEqual(info["num_segments"], 1)
        # What both saw is one point now.
        self.assertLess(info["num_points"], sum(c["num_points"] for c in counts))
        before = merged.read_bytes()
        for arguments, word in ((("map", "merge", first, "-o", merged), "FILES"),
                                (("map", "merge", first, second, "-o", first), "first.twm"),
                                (("map", "merge", first, self.write("wrong.twm", before[:-1]), "-o",
                                  merged), "wrong.twm")):
            done = self.run_program(*arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.one_line(done, word)
            self.assertEqual(merged.read_bytes(), before)
        self.assertIn(b"twoview map merge [OPTIONS] FILES...",
                      self.run_program("map", "merge", "--help").stdout)

    def test_frames_are_scaled_down_with_their_camera(self):
        self.succeed(self.odometry(self.set_folder(), "--resize", WIDTH // 2))
        result = self.result()
        info = self.succeed(self.run_program("map", "info", self.out / "map.twm", "--json"))
        self.assertEqual(json.loads(info.stdout)["image_size"], [WIDTH // 2, HEIGHT // 2])
        self.assertEqual(json.loads(info.stdout)["camera"]["fx"], FOCAL / 2)
        self.assertEqual(result["options"]["resize"], WIDTH // 2)
        self.assertEqual(result["num_tracked"], COUNT)
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 1)

    # -- a camera that nobody knows ------------------------------------------------------------

    def test_a_flight_without_turns_leaves_the_focal_length_doubtful(self):
        # Every focal length explains a camera that goes straight.
        source = self.set_folder()
        (source / "cameras.yaml").unlink()
        done = self.succeed(self.odometry(source))
        text = done.stdout.decode()
        self.assertIn("note         no camera is given: the focal length is estimated", text)
        self.assertIn("the focal length is doubtful", text)
        self.assertIn("advice       turn while you move", text)
        result = self.result()
        focal = result["focal_length"]
        self.assertEqual(list(focal),
                         ["focal_35mm", "pixels", "sigma_percent", "uncertain", "k1", "k2",
                          "k3", "source"])
        self.assertTrue(focal["uncertain"])
        self.assertEqual(focal["source"], "estimated")
        for name in ("k1", "k2", "k3"):  # null, or what a pinhole's few frames leave of it
            self.assertLess(abs(focal[name] or 0), 0.1)
        self.assertGreater(focal["sigma_percent"], 5)
        diagonal = math.hypot(WIDTH, HEIGHT) / math.hypot(36, 24)
        self.assertAlmostEqual(focal["pixels"], focal["focal_35mm"] * diagonal, delta=1e-6)
        self.assertEqual(result["num_tracked"], COUNT)
        self.assertNotIn("estimated_camera.yaml", self.listing())
        self.assertIn("The focal length is doubtful", (self.out / "report.html").read_text())

    def test_auto_comes_before_the_cameras_of_the_folder_and_needs_no_other_camera(self):
        source = self.set_folder()
        self.succeed(self.odometry(source))
        self.assertIsNone(self.result()["focal_length"])
        self.succeed(self.odometry(source, "--focal-35mm", "auto"))
        result = self.result()
        self.assertEqual(result["options"]["focal_35mm"], "auto")
        self.assertEqual(result["focal_length"]["source"], "estimated")
        camera = self.write("camera.yaml", camera_yaml())
        self.out = self.folder / "refused"
        self.assert_refused(self.odometry(source, "--focal-35mm", "auto", "--camera", camera),
                            "without a camera file")
        self.assert_refused(self.odometry("0", "--focal-35mm", "auto"), "a live one")
        for verb in ("evaluate", "undistort", "triangulate"):
            done = self.run_program(verb, "x", "--focal-35mm", "auto", "-o", self.out)
            self.assert_refused(done, "--focal-35mm: auto: reconstruct and odometry alone")

    def test_large_frames_are_followed_by_the_advice_to_make_them_smaller(self):
        wide = png(2049, 48, bytes(2049 * 48))
        for k in range(2):
            self.write(f"wide/{k}.png", wide)
        run = ("wide", "--fps", 10, "--focal-35mm", 26)
        note = "frames above 2048 pixels a side are used as they are: 2049x48; --resize 1600 " \
               "is advised"
        done = self.odometry(*run)
        self.assertEqual(done.stdout.decode().count(f"note         {note}\n"), 1)
        self.assertNotIn("note", done.stderr.decode())
        self.assertEqual(self.result()["notes"], [note])
        self.assertIn(f"<li>{note}</li>", (self.out / "report.html").read_text())
        for more in (("--resize", 0), ("--resize", 1600)):
            self.assertNotIn(b"note", self.odometry(*run, *more).stdout)
            self.assertEqual(self.result()["notes"], [])
        for flag in ("--json", "--quiet"):
            self.assertIn(f"twoview: note: {note}\n", self.odometry(*run, flag).stderr.decode())
        self.assertEqual(self.result()["options"]["resize"], 0)

    def test_options_are_written_and_refused_as_those_of_the_other_verbs(self):
        text = " ".join(self.run_program("odometry", "--help").stdout.decode().split())
        for words in ("--max-points [500, 200000]=20000 most", "--fps [0.001, 10000] frames",
                      "--live-port [1, 65535] the page's", "--seed [0, 2^64 - 1]=",
                      "--focal-35mm auto or [1, 10000]",
                      "--kernels auto|c|sse2|avx2|avx512|neon=auto kernel"):
            self.assertIn(words, text)
        for flag, value, words in (
                ("--max-keypoints", "99", "99 is not in [100, 4096]"),
                ("--window", "1e9", "'1e9' is not a whole number in [3, 20]"),
                ("--fps", "nan", "nan is not in [0.001, 10000]"),
                ("--live-port", "0", "0 is not in [1, 65535]"),
                ("--kernels", "mmx", "'mmx' is none of this version's auto, c, sse2")):
            done = self.odometry(self.set_folder(), flag, value)
            self.assertEqual(done.returncode, 2)
            self.one_line(done, f"{flag}: {words}")

    def test_the_report_holds_all_that_it_shows(self):
        self.succeed(self.odometry(self.set_folder()))
        page = (self.out / "report.html").read_text()
        self.assertNotRegex(page, r"""(src|href)=["']?(https?:|//)""")
        self.assertNotIn("{{", page)
        for name in ("cloud-data", "flight-data"):
            text = re.search(rf'id="{name}">(.*?)</script>', page, re.S)[1]
            data = json.loads(text)
        self.assertEqual(len(data["frames"]["status"]), COUNT)
        self.assertEqual(len(data["keyframes"]), self.result()["num_keyframes"])
        self.assertTrue(all(key["tracks"] for key in data["keyframes"]))
        self.assertEqual(len(data["frames"]["error"]), COUNT)

    def test_the_sensors_of_a_set_folder_make_the_map_metric_and_upright(self):
        source = self.set_folder()
        self.imu()
        self.succeed(self.odometry(source))
        result = self.result()
        self.assertEqual(result["scale"], "metric")
        self.assertAlmostEqual(result["truth"]["scale_ratio"], 1,
                               delta=max(0.02, 2 * result["scale_sigma"]))
        self.assertAlmostEqual(result["path_length"], 0.1 * (COUNT - 1), delta=0.05)
        # The world's z axis points down: the camera's y axis, and so does not change on the way.
        for x, y, z, *q in poses(self.out / "trajectory.txt")[0].values():
            down = [2 * (q[0] * q[1] - q[3] * q[2]), 1 - 2 * (q[0] ** 2 + q[2] ** 2),
                    2 * (q[1] * q[2] + q[3] * q[0])]
            self.assertGreater(down[2], 0.999)
        first = self.trajectory()
        # Samples between the frames give the same quantities; nan means not measured.
        self.imu(lines=[f"{(i - 0.5) / 50:.9f} 1 0 0 0 0.01 1.5 0.015 0 {0.1 * FPS} 0 0.02"
                        for i in range(2 * COUNT + 2)])
        self.succeed(self.odometry(source))
        self.assertEqual(self.trajectory(), first)
        self.imu(lines=[f"{t:.9f} 1 0 0 0 0.01 nan NaN nan 0 0 nan" for t in TIMES])
        self.succeed(self.odometry(source))
        self.assertEqual(self.result()["scale"], "unit")
        self.imu(lines=[f"{t + 9:.9f} 1 0 0 0 0.01 1.5 0.015 0 0 0 0.02" for t in TIMES])
        self.succeed(self.odometry(source))
        unmeasured = self.trajectory()
        self.assertEqual(self.result()["scale"], "unit")
        self.imu(lines=["no sample"])
        self.succeed(self.odometry(source, "--no-imu"))
        self.assertEqual(self.trajectory(), unmeasured)
        self.assertTrue(self.result()["options"]["no_imu"])

    def test_heights_and_velocities_that_no_drone_has_are_left_out_and_counted(self):
        source = self.set_folder()
        lines = [f"{t:.9f} 1 0 0 0 0.01 1.5 0.015 0 {0.1 * FPS} 0 0.02" for t in TIMES]
        lines[5] = lines[5].replace(" 1.5 ", " 5000 ")
        lines[9] = lines[9].replace(f" {0.1 * FPS} ", " 300 ")
        lines[10] = lines[10].replace(f" {0.1 * FPS} ", " -1e9 ")
        self.imu(lines=lines)
        done = self.succeed(self.odometry(source))
        self.assertIn("1 heights above 3000 m and 2 velocities above 150 m/s were left out",
                      (done.stdout + done.stderr).decode())
        result = self.result()
        self.assertEqual((result["scale"], result["scale_contradiction"]), ("metric", None))
        self.assertAlmostEqual(result["truth"]["scale_ratio"], 1, delta=0.02)

    def test_a_file_most_of_which_no_drone_has_gives_no_metre(self):
        # In millimetres the height is still one that a drone may have.
        source = self.set_folder()
        for height, speed in ((1.5, 1e3), (1.5e3, 1e3), (1.5e5, 1)):
            self.imu(lines=[f"{t:.9f} 1 0 0 0 0.01 {height + height / 15 * math.sin(2 * t):.6f} "
                            f"0.015 0 {speed * 0.1 * FPS} 0 0.02" for t in TIMES])
            done = self.succeed(self.odometry(source))
            self.assertIn("most are not in metres, so no height and no velocity is used",
                          (done.stdout + done.stderr).decode())
            self.assertEqual(self.result()["scale"], "unit")

    def test_samples_of_another_clock_are_named(self):
        source = self.set_folder()
        for clock in (lambda t: 1000 * t, lambda t: t + 1.7e9):
            self.imu(lines=[f"{clock(t):.9f} 1 0 0 0 0.01 1.5 0.015 0 {0.1 * FPS} 0 0.02"
                            for t in TIMES])
            self.succeed(self.odometry(source))
            result = self.result()
            self.assertEqual(result["scale"], "unit")
            self.assertRegex(" ".join(result["notes"]),
                             rf"imu.txt: only [01] of {COUNT} frames have a sample .*of one clock")

    def test_a_lying_attitude_is_reported_and_left_out(self):
        source = self.set_folder()
        lines = [f"{t:.9f} 1 0 0 0 0.01 1.5 0.015 0 {0.1 * FPS} 0 0.02" for t in TIMES]
        half = math.sqrt(0.5)
        lines[14] = lines[14].replace(" 1 0 0 0 ", f" {half} {half} 0 0 ", 1)
        self.imu(lines=lines)
        done = self.succeed(self.odometry(source))
        self.assertIn("contradicts the map", done.stdout.decode())
        result = self.result()
        self.assertEqual(result["num_attitudes_ignored"], 1)
        with open(self.out / "frames.csv", newline="") as file:
            ignored = [row["attitude_ignored"] for row in csv.DictReader(file)]
        self.assertEqual(ignored, ["0"] * 14 + ["1"] + ["0"] * (COUNT - 15))
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 0.5)
        self.assertEqual(result["truth"]["coverage"], 1)

    def test_known_covariances_are_written(self):
        self.succeed(self.odometry(self.set_folder()))
        keyframes = sorted(poses(self.out / "keyframes.txt")[0])
        lines = (self.out / "covariances.txt").read_text().splitlines()
        rows = [list(map(float, line.split())) for line in lines if not line.startswith("#")]
        self.assertGreater(len(rows), 1)
        for row in rows:
            self.assertEqual(len(row), 38)
            self.assertEqual(keyframes.index(row[0]) + 1, keyframes.index(row[1]))
            matrix = [row[2 + 6 * i:8 + 6 * i] for i in range(6)]
            for i in range(6):
                self.assertGreater(matrix[i][i], 0)
                for k in range(i):
                    self.assertAlmostEqual(matrix[i][k] / math.sqrt(
                        matrix[i][i] * matrix[k][k]), matrix[k][i] / math.sqrt(
                        matrix[i][i] * matrix[k][k]), 9)
            # A step of a few pixels: well below a degree, and below the step itself.
            self.assertLess(matrix[0][0], 0.02 ** 2)
        self.succeed(self.run_program("map", "export", self.out / "map.twm", "-o",
                                      self.folder / "known"))
        self.assertEqual((self.folder / "known" / "covariances.txt").read_text().splitlines(),
                         lines)

    # -- the formats --------------------------------------------------------------------------

    def test_every_folder_gives_the_same_path(self):
        self.succeed(self.odometry(self.set_folder(truth="")))
        path, result = self.trajectory(), self.result()
        self.assertIsNone(result["truth"])
        for i, data in enumerate(PICTURES):
            self.write(f"tum/rgb/{TIMES[i]:.6f}.png", data)
            self.write(f"euroc/mav0/cam0/data/{i}.png", data)
            self.write(f"kitti/image_0/{i:06}.png", data)
            self.write(f"plain/{i:04}.PNG", data)
        self.write("tum/rgb.txt", "".join(f"{t:.9f} rgb/{t:.6f}.png\n" for t in TIMES))
        self.write("euroc/mav0/cam0/data.csv", "#timestamp [ns],filename\r\n" + "".join(
            f"{round(t * 1e9)},{i}.png\r\n" for i, t in enumerate(TIMES)))
        self.write("euroc/mav0/cam0/sensor.yaml", f"""sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0, -1, 0, 0.5, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
resolution: [{WIDTH}, {HEIGHT}]
camera_model: pinhole
intrinsics: [{FOCAL}, {FOCAL}, {(WIDTH - 1) / 2}, {(HEIGHT - 1) / 2}]
distortion_model: radial-tangential
distortion_coefficients: [0, 0, 0, 0]
""")
        self.write("kitti/times.txt", "".join(f"{t:e}\n" for t in TIMES))
        row = f"{FOCAL} 0 {(WIDTH - 1) / 2} 0 0 {FOCAL} {(HEIGHT - 1) / 2} 0 0 0 1 0"
        self.write("kitti/calib.txt", f"P0: {row}\nP1: {row}\n")
        camera = ("--camera", self.write("own.yaml", camera_yaml()))
        for name, more in (("tum", camera), ("euroc", ()), ("kitti", ()),
                           ("plain", (*camera, "--fps", FPS)), ("set", camera)):
            out = self.folder / f"out_{name}"
            self.succeed(self.odometry(name, *more, out=out))
            self.assertEqual(self.trajectory(out), path, name)
        # EuRoC's poses are the vehicle's, on which the camera sits turned and 0.5 m off.
        euroc = "#timestamp,p x,p y,p z,q w,q x,q y,q z,v\n" + "".join(
            f"{round(t * 1e9)},{0.1 * i},-0.5,7,{math.sqrt(0.5)},0,0,{-math.sqrt(0.5)},0\n"
            for i, t in enumerate(TIMES))
        # T_BS turns by 90 degrees about z, the vehicle by -90: the camera looks as in the world.
        kitti = "".join(f"1 0 0 {0.1 * i} 0 1 0 0 0 0 1 0\n" for i in range(COUNT))
        found = []
        for name, text in (("euroc", euroc), ("kitti", kitti), ("tum", TUM_TRUTH)):
            truth = self.write(f"truth_{name}", text)
            more = camera if name == "tum" else ()
            self.succeed(self.odometry(name, "--truth", truth, *more))
            found.append(self.result()["truth"])
        for truth in found:
            self.assertAlmostEqual(truth["ate_rmse"], found[0]["ate_rmse"], 9)
            self.assertAlmostEqual(truth["rpe_rotation_deg"], found[0]["rpe_rotation_deg"], 5)
            self.assertAlmostEqual(truth["rpe_translation_rmse"],
                                   found[0]["rpe_translation_rmse"], 9)
            self.assertAlmostEqual(truth["scale_ratio"], found[0]["scale_ratio"], 9)

    def test_progress_is_erased_and_a_dumb_terminal_gets_none(self):
        source = self.set_folder()
        for environment, is_shown in (({}, True), ({"NO_COLOR": "1"}, True),
                                      ({"TERM": "dumb"}, False)):
            status, shown = self.on_terminal("odometry", source, "-o", self.out, **environment)
            self.assertEqual(status, 0, shown)
            self.assertEqual(b"\r\033[K1 of 20 frames, " in shown, is_shown, shown)
            if is_shown:
                self.assertRegex(shown, rb"points(\r\033\[K)+[^\r]*source")
            else:
                self.assertNotIn(b"\033", shown)

    def test_a_film_is_tracked(self):
        film = b"YUV4MPEG2 W%d H%d F25:1 Ip A1:1 Cmono\n" % (WIDTH, HEIGHT)
        film += b"".join(b"FRAME\n" + luma for luma in LUMA)
        path = self.write("flight.y4m", film)
        self.succeed(self.odometry(path, "--camera", self.camera,
                                   "--truth", self.write("truth", TUM_TRUTH)))
        self.assertEqual(self.result()["num_frames"], COUNT)
        self.assertLess(self.result()["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertIn("frame_000003.png", (self.out / "frames.csv").read_text())
        # The camera's focal length as for 35 mm film: the same camera.
        focal = FOCAL * math.hypot(36, 24) / math.hypot(WIDTH, HEIGHT)
        self.succeed(self.odometry(path, "--focal-35mm", focal,
                                   "--truth", self.write("truth", TUM_TRUTH)))
        self.assertLess(self.result()["truth"]["ate_rmse_percent_of_path"], 1)
        self.assertEqual(self.result()["options"]["focal_35mm"], focal)
        self.assertIn(f"fx {FOCAL:g}", self.succeed(self.run_program(
            "map", "info", self.out / "map.twm")).stdout.decode())

    def test_a_drone_and_its_recording_are_tracked(self):
        if self.run_program("drone", "simulate", "--help").returncode != 0:
            self.skipTest("the program was built without the simulator")
        pictures = [self.write(f"film/{i:02}.png", data) for i, data in enumerate(PICTURES)]
        channels = ("at", "navdata", "video", "control", "recording")
        child = subprocess.Popen(
            [program(), "drone", "simulate", "--fps", "8", "--duration", "60",
             *(word for c in channels for word in (f"--{c}-port", "0")), "--images", *pictures],
            stdout=subprocess.PIPE, text=True)
        self.addCleanup(child.communicate)
        self.addCleanup(child.kill)
        words = child.stdout.readline().replace(",", "").split()
        ports = [word for option, name in (("at", "commands"), ("navdata",) * 2, ("video",) * 2,
                                           ("control",) * 2)
                 for word in (f"--{option}-port", words[words.index(name) + 1])]
        # The simulator scales the pictures to those of the drone, 640 x 360.
        camera = ("--camera", self.write("drone.yaml", camera_yaml(
            640, 360, 2 * FOCAL, 1.5 * FOCAL, 319.5, 179.5)))
        self.succeed(self.run_program("drone", "record", "--host", "127.0.0.1", *ports,
                                      "-o", "flown", "--duration", "4"))
        live = self.run_program("odometry", "--drone", "127.0.0.1", *ports, *camera,
                                "--duration", "4", "-o", self.out)
        results = [self.result()]
        again = self.odometry("flown", *camera)
        results.append(self.result())
        for done, result in zip((live, again), results):
            self.assertIn(done.returncode, (0, 3), done.stderr.decode())  # the film begins again
            self.assertGreater(result["num_frames"], 12)
            self.assertGreater(result["num_tracked"], 8)
        # A recording is played by the clock that it was recorded by: the same each time, and what
        # is read in one playing belongs to the pictures of the next.
        texts = [(self.out / name).read_bytes() for name in ("trajectory.txt", "keyframes.txt")]
        self.odometry("flown", *camera)
        self.assertEqual(texts, [(self.out / name).read_bytes()
                                 for name in ("trajectory.txt", "keyframes.txt")])
        lines = (self.folder / "flown" / "frames.txt").read_text().splitlines()
        recorded = [1e-9 * int(line.split()[0]) for line in lines]
        rows = (self.out / "frames.csv").read_text().splitlines()[1:]
        for row in rows:
            number = int(row.split(",")[1][len("frame_"):-len(".png")])
            at = [t for t, line in zip(recorded, lines) if int(line.split()[2]) == number]
            self.assertAlmostEqual(float(row.split(",")[0]), at[0], delta=1)
        # How far it is, on a terminal.
        _, shown = self.on_terminal("odometry", "flown", *camera, "-o", self.out)
        self.assertRegex(shown, rb"\r\033\[K\d+ of \d+ frames, ")
        _, shown = self.on_terminal("reconstruct", "--recording", "flown", *camera, "-o",
                                    self.folder / "pair")
        self.assertRegex(shown, rb"\r\033\[Kframe 1 of \d+")
        self.assert_refused(self.odometry("flown", out="new"), "--camera is required",
                            out=self.folder / "new")
        self.assert_refused(self.odometry("flown", "--drone", "127.0.0.1", *camera, out="new"),
                            "not both", out=self.folder / "new")

    def test_a_page_follows_the_flight(self):
        source = self.set_folder()
        names = [COUNT - 1 - abs(COUNT - 1 - j % (2 * (COUNT - 1))) for j in range(40000)]
        self.write("set/frames.txt", "".join(f"{0.04 * i:.3f} images/{n:05}.png\n"
                                             for i, n in enumerate(names)))
        child = subprocess.Popen([program(), "odometry", source, "-o", self.out, "--live"],
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(child.communicate)
        self.addCleanup(child.kill)
        line = child.stdout.readline()
        if not line:
            error = child.stderr.read()
            self.assertIn("built without libmicrohttpd", error)
            self.skipTest(error.strip())
        host, port = re.fullmatch(r"live +http://(127\.0\.0\.1):(\d+)/\n", line).groups()

        def fetched(path, method="GET", **headers):
            connection = http.client.HTTPConnection(host, int(port), timeout=20)
            connection.request(method, path, headers=headers)
            reply = connection.getresponse()
            body = reply.read()
            connection.close()
            return reply.status, reply.getheader("Content-Type"), body

        status, kind, page = fetched("/")
        self.assertEqual((status, kind), (200, "text/html; charset=utf-8"))
        self.assertNotRegex(page.decode(), r"""(src|href)=["']?(https?:|//)""")
        seen = []
        end = time.monotonic() + 60
        while len(seen) < 3 and time.monotonic() < end:
            data = json.loads(fetched("/data.json")[2])
            if data.get("num_frames", 0) > (seen[-1]["num_frames"] if seen else COUNT):
                seen.append(data)
            time.sleep(0.05)
        self.assertEqual(len(seen), 3, "the page does not follow the flight")
        self.assertEqual(seen[-1]["status"], "tracking")
        self.assertEqual((seen[-1]["width"], seen[-1]["height"]), (WIDTH, HEIGHT))
        self.assertGreater(len(seen[-1]["path"]), 3 * 10)
        self.assertEqual(len(seen[-1]["points"]), len(seen[-1]["colours"]))
        self.assertEqual(len(seen[-1]["view"]), 9)
        self.assertGreater(len(seen[-1]["colours"]), 3 * 100)
        self.assertEqual(len(seen[-1]["camera"]), 12)
        self.assertGreater(len(seen[-1]["tracks"]), 50)
        status, kind, picture = fetched("/picture.jpg")
        self.assertEqual((status, kind, picture[:2]), (200, "image/jpeg", b"\xff\xd8"))
        self.assertEqual(fetched("/frames.csv")[0], 404)
        self.assertEqual(fetched("/data.json", Host="elsewhere.example")[0], 403)
        with self.assertRaises((http.client.HTTPException, ConnectionError)):
            fetched("/", "POST")
        taken = self.odometry(source, "--live-port", port, out=self.folder / "other")
        self.assert_refused(taken, "--live", port, "in use", out=self.folder / "other")
        child.send_signal(signal.SIGINT)
        self.assertEqual(child.wait(timeout=60), 0)
        self.assertEqual(self.files(), FILES)
        self.assertGreaterEqual(self.result()["num_frames"], seen[-1]["num_frames"])

    # -- what goes wrong ----------------------------------------------------------------------

    def test_a_frame_that_cannot_be_read_is_left_out(self):
        source = self.set_folder()
        (source / "images/00012.png").write_bytes(b"no picture")
        self.write("set/images/00013.png", png(64, 64, bytes(64 * 64)))
        done = self.succeed(self.odometry(source))
        result = self.result()
        self.assertIn("2 frames could not be used, the first: ", result["notes"][0])
        self.assertIn("00012.png", result["notes"][0])
        self.assertIn(result["notes"][0].encode(), done.stdout)
        self.assertEqual((result["num_frames"], result["num_unreadable"]), (COUNT, 2))
        rows = (self.out / "frames.csv").read_text().splitlines()
        self.assertIn(",lost,unreadable,-1,", rows[13])
        self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 0.5)
        self.assertAlmostEqual(result["truth"]["coverage"], (COUNT - 2) / COUNT)

    def test_a_blank_wall_gives_no_map(self):
        source = self.set_folder()
        for i in range(COUNT):
            self.write(f"set/images/{i:05}.png", png(WIDTH, HEIGHT, bytes([90]) * WIDTH * HEIGHT))
        done = self.odometry(source)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "nothing could be tracked")
        self.assertEqual(self.result()["num_tracked"], 0)
        self.assertEqual(self.result()["truth"]["coverage"], 0)
        self.assertIsNone(self.result()["truth"]["ate_rmse"])
        self.assertNotIn("cloud.ply", self.listing())
        self.assertIn("no map", (self.out / "report.html").read_text())

    def test_many_frames_of_a_blank_wall_take_no_memory_each(self):
        self.write("set/images/wall.png", png(48, 40, bytes([90]) * 48 * 40))
        self.write("set/cameras.yaml", CAMERAS.replace(str(WIDTH), "48").replace(str(HEIGHT), "40")
                   .replace(str((WIDTH - 1) / 2), "23.5").replace(str((HEIGHT - 1) / 2), "19.5"))
        peaks = []
        for count in (200, 4000):
            self.write("set/frames.txt", "".join(f"{i} images/wall.png\n" for i in range(count)))
            command = [program(), "odometry", "set", "-o", str(self.out), "--quiet"]
            child = subprocess.Popen(command, cwd=self.folder, stderr=subprocess.PIPE)
            child.stderr.read()
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            child.stderr.close()
            self.assertEqual(child.returncode, 3)
            self.assertEqual(self.result()["status_counts"]["starting"], count)
            peaks.append(usage.ru_maxrss)
        # A frame's record, its line of frames.csv and its share of the page: below 1 KiB each.
        self.assertLess(peaks[1] - peaks[0], 3800)

    def test_a_single_frame_and_one_frame_a_second(self):
        source = self.set_folder()
        done = self.odometry(source, "--max-frames", 1)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "nothing could be tracked")
        self.assertEqual(self.result()["num_frames"], 1)
        self.assertEqual(self.result()["status_counts"]["starting"], 1)
        # The frames of a second apart, in which the walls move by up to 45 pixels.
        names = range(0, COUNT, 5)
        self.write("set/frames.txt", "".join(f"{k} images/{i:05}.png\n"
                                             for k, i in enumerate(names)))
        self.write("set/groundtruth.txt", "".join(f"{k} {0.1 * i} 0 0 0 0 0 1\n"
                                                  for k, i in enumerate(names)))
        done = self.odometry(source)
        self.assertIn(done.returncode, (0, 3), done.stderr.decode())
        result = self.result()
        self.assertEqual(result["num_frames"], len(names))
        self.assertEqual(sum(result["status_counts"].values()), len(names))
        if result["status_counts"]["tracking"] > 2:
            self.assertLess(result["truth"]["ate_rmse_percent_of_path"], 5)

    def test_a_source_that_ends_lost_says_so(self):
        source = self.set_folder()
        for i in range(12, COUNT):
            self.write(f"set/images/{i:05}.png", png(WIDTH, HEIGHT, bytes([90]) * WIDTH * HEIGHT))
        done = self.odometry(source)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "ended lost")
        self.assertGreaterEqual(self.result()["num_tracked"], 10)
        self.assertEqual(self.files(), FILES)

    def test_ctrl_c_keeps_what_there_is(self):
        source = self.set_folder()
        # The flight to and fro, many times.
        names = [COUNT - 1 - abs(COUNT - 1 - j % (2 * (COUNT - 1))) for j in range(40000)]
        self.write("set/frames.txt", "".join(f"{0.04 * i:.3f} images/{n:05}.png\n"
                                             for i, n in enumerate(names)))
        child = subprocess.Popen([program(), "odometry", source, "-o", self.out, "--quiet"],
                                 stderr=subprocess.PIPE)
        while child.poll() is None and not self.out.exists():
            time.sleep(0.1)
        time.sleep(2)
        child.send_signal(signal.SIGINT)
        error = child.communicate(timeout=120)[1].decode()
        self.assertEqual(child.returncode, 0, error)
        self.assertEqual(self.files(), FILES)
        result = self.result()
        self.assertTrue(result["interrupted"])
        self.assertGreater(result["num_frames"], 8)
        self.assertLess(result["num_frames"], 40000)
        self.assertLess(result["truth"]["coverage"], 0.5)

    def test_ctrl_c_at_any_moment_leaves_all_files_or_none(self):
        source = self.set_folder()
        names = [COUNT - 1 - abs(COUNT - 1 - j % (2 * (COUNT - 1))) for j in range(120)]
        self.write("set/frames.txt", "".join(f"{0.04 * i:.3f} images/{n:05}.png\n"
                                             for i, n in enumerate(names)))
        begin = time.monotonic()
        self.succeed(self.odometry(source))
        whole = time.monotonic() - begin
        ends = []
        for k in range(9):
            shutil.rmtree(self.out)
            child = subprocess.Popen([program(), "odometry", source, "-o", self.out, "--quiet"],
                                     stderr=subprocess.PIPE)
            time.sleep(whole * k / 8)
            child.send_signal(signal.SIGINT)
            # A second one ends the program without results, while it writes them, too.
            while k % 3 == 2 and child.poll() is None:
                if (self.out / "colmap").exists():
                    child.send_signal(signal.SIGINT)
                    break
            error = child.communicate(timeout=60)[1].decode()
            ends.append(child.returncode)
            self.assertIn(child.returncode, (0, 2, 3, -signal.SIGINT, 128 + signal.SIGINT), error)
            lines = [line for line in error.splitlines() if "pictures again" not in line]
            self.assertLessEqual(len(lines), 1, error)
            if child.returncode in (0, 3):
                self.assertEqual(sum(self.result()["status_counts"].values()),
                                 self.result()["num_frames"])
                if self.result()["num_keyframes"]:
                    self.assertEqual(self.files(), FILES)
                    self.succeed(self.run_program("map", "info", self.out / "map.twm"))
            elif self.out.exists():  # it came after the last file, before the program's end
                self.assertEqual(self.files(), FILES, error)
                self.succeed(self.run_program("map", "info", self.out / "map.twm"))
            self.out.mkdir(exist_ok=True)
        self.assertIn(0, ends)

    def test_a_full_disk_is_one_line(self):
        done = self.odometry(self.set_folder(), preexec_fn=lambda: resource.setrlimit(
            resource.RLIMIT_FSIZE, (2000, 2000)))
        self.assert_refused(done, "cannot write", "File too large")

    def test_bad_sources_are_refused(self):
        source = self.set_folder()
        lines = (source / "frames.txt").read_text().splitlines()

        def refused(*words, name="frames.txt", text=None, more=(), where=source):
            kept = (source / name).read_bytes()
            if text is not None:
                self.write(f"set/{name}", text)
            self.assert_refused(self.odometry(where, *more), *words)
            self.write(f"set/{name}", kept)

        refused("nowhere", "neither a folder", where="nowhere")
        refused("no film", where=self.write("film.avi", "no film"))
        refused("--camera is required, or --focal-35mm: a camera", where="0")
        refused("it is empty", text="")
        refused("no frame in it", text="# none\n")
        refused("line 2", "not a time and a file's name", text="0 a.png\n1\n")
        refused("line 1", "not a time", text="nan images/00000.png\n")
        refused("line 4", "not later", text="\n".join(lines[:3] + lines[2:]))
        refused("absent.png", text="0 images/absent.png\n")
        refused("cameras.yaml", "fx", name="cameras.yaml", text=CAMERAS.replace("fx", "gx"))
        refused("320x240", "640x240", name="cameras.yaml", text=CAMERAS.replace(": 320", ": 640"))
        refused("line 1", "7 numbers", name="groundtruth.txt", text="0 0 0 0 0 0 0\n")
        refused("line 2", "not later", name="groundtruth.txt",
                text="0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n")
        refused("line 1", "length 0", name="groundtruth.txt", text="0 0 0 0 0 0 0 0\n")
        sample = "0 1 0 0 0 0.01 1 0.1 0 0 0 0.1\n"
        mount = "body_from_cam 1 0 0 0\n"
        for text, words in (("# none\n", ("no line body_from_cam",)),
                            (sample, ("line 1", "not body_from_cam")),
                            ("body_from_cam 0 0 0 0\n", ("line 1", "not body_from_cam")),
                            (mount + sample[:-4] + "x\n", ("line 2", "neither a finite number")),
                            (mount + sample[2:], ("line 2", "11 numbers, not 12")),
                            (mount + "nan" + sample[1:], ("line 2", "no time")),
                            (mount + sample.replace("0.01", "-1"), ("line 2", "negative")),
                            (mount + sample.replace(" 1 ", " 0 ", 1), ("line 2", "length 0")),
                            (mount + sample + sample, ("line 3", "not later")),
                            (mount + "gyro 0 0 0 0\n", ("line 2", "4 numbers after gyro")),
                            (mount + "gyro nan 0 0 0 1\n", ("line 2", "no time")),
                            (mount + "gyro 0 0 0 0 -1\n", ("line 2", "negative")),
                            (mount + "gyro 0 0 200 0 1\n", ("line 2", "in degrees?")),
                            (mount + 2 * "gyro 0 0 0 0 1\n", ("line 3", "not later"))):
            self.write("set/imu.txt", text)
            self.assert_refused(self.odometry(source), "imu.txt", *words)
        (source / "imu.txt").unlink()
        refused("--fps", "has times", more=("--fps", 30))
        refused("--every", more=("--every", 0))
        refused("--max-keypoints", more=("--max-keypoints", 5))
        refused("cannot read", more=("--truth", "absent"))
        refused("cannot read", more=("--camera", "absent"))
        refused("without a camera file", more=("--camera", "absent", "--focal-35mm", 26))
        refused("--focal-35mm: 'nan' is not a number", more=("--focal-35mm", "nan"))
        (source / "cameras.yaml").unlink()
        self.assert_refused(self.odometry(source / "images"), "--fps is required")
        (self.folder / "void").mkdir()
        self.assert_refused(self.odometry("void"), "neither frames.txt")
        self.assert_refused(self.run_program("odometry", "-o", self.out), "SOURCE is required",
                            "(see twoview odometry --help)")
        for i in range(3):
            self.write(f"kitti/image_0/{i}.png", PICTURES[i])
        self.write("kitti/times.txt", "0\n1\n2\n")
        for fx, cx, cy, words in ((2 * FOCAL, WIDTH, HEIGHT, "scale them"),
                                  (FOCAL, 4 * WIDTH, 0.7 * HEIGHT, "scale them"),
                                  (FOCAL, HEIGHT / 2, WIDTH / 2, "cx and cy exchanged")):
            self.write("kitti/calib.txt", f"P0: {fx} 0 {cx} 0 0 {fx} {cy} 0 0 0 1 0\n")
            self.assert_refused(self.odometry("kitti"), "P0 of calib.txt", words)
        self.write("kitti/times.txt", "0\n1\n")
        self.assert_refused(self.odometry("kitti"), "2 times", "3 images")

    def test_an_output_never_replaces_an_input(self):
        source = self.set_folder()
        os.rename(source / "frames.txt", source / "kept")
        self.write("set/frames.txt", (source / "kept").read_bytes())
        truth = self.write("set/trajectory.txt", TUM_TRUTH)
        done = self.odometry(source, "--truth", truth, out=source)
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "trajectory.txt", "read by this run")
        self.assertEqual(truth.read_text(), TUM_TRUTH)


if __name__ == "__main__":
    if b"odometry" not in subprocess.run([program(), "--help"], capture_output=True).stdout:
        print("skipped: the program was built without TWOVIEW_ODOMETRY")
        raise SystemExit(77)
    unittest.TestLoader.sortTestMethodsUsing = None
    main()
