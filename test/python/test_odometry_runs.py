"""What visual odometry is measured with: rendered flights against their own truth, faults, and
scripts/odometry with a program whose errors are known."""
import contextlib
import io
import json
import os
import re
import stat
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

from twoview_tools import formats
from twoview_tools.accuracy import datasets, fusion
from twoview_tools.odometry import (cli, copies, endurance, evaluate, faults, flights, mapper,
                                    poses, runs, sensors, set_writer, sets, surfaces, targets)

LIBRARY = os.environ.get("TWOVIEW_LIBRARY", "")
BUILT = os.path.join(os.path.dirname(os.path.dirname(LIBRARY)), "bin", "twoview_flights")
if "TWOVIEW_FLIGHTS" not in os.environ and os.access(BUILT, os.X_OK):
    os.environ["TWOVIEW_FLIGHTS"] = BUILT

# A `twoview odometry` that writes the truth through a similarity, with the flaws that its set's
# flaws.json names.
PROGRAM = """#!{python}
import json, os, sys
import numpy as np
from twoview_tools.odometry import poses, sets
source, out = sys.argv[2], sys.argv[4]
found = sets.read_set(source)
flaws = json.load(open(os.path.join(source, "flaws.json")))
truth = found.truth()
path = truth.moved((0.5, np.eye(3)[[1, 2, 0]], np.array([1.0, 2.0, 3.0])))
path.positions[flaws["jump_at"]:] += flaws["jump"]
first = flaws["start"]
poses.write_tum(os.path.join(out, "trajectory.txt"), path[first:])
with open(os.path.join(out, "frames.csv"), "w") as file:
    file.write("timestamp,name,status,reasons,segment,num_tracked,is_keyframe,time_ms\\n")
    for k, (time, name) in enumerate(zip(found.times, found.names)):
        status = "starting" if k < first else flaws["status"]
        file.write(f"{{time:.9f}},{{name}},{{status}},,0,99,0,{{2 + k % 2}}\\n")
with open(os.path.join(out, "result.json"), "w") as file:
    json.dump({{"scale": "unit", "context_bytes": 2 ** 20}}, file)
sys.exit(flaws.get("exit", 0))
"""


def make_set(folder, count=60, size=(64, 48), flaws=None):
    """A set folder with pictures that differ from frame to frame."""
    os.makedirs(os.path.join(folder, "images"))
    times = [5 + k / 30 for k in range(count)]
    names = [f"images/{k:05d}.png" for k in range(count)]
    for k, name in enumerate(names):
        cv2.imwrite(os.path.join(folder, name), np.full(size[::-1], 100 + k, np.uint8))
    s = np.linspace(0, 3, count)
    path = np.stack([np.sin(s), np.cos(2 * s), s], 1)
    poses.write_tum(os.path.join(folder, "groundtruth.txt"),
                    poses.Trajectory(times, path, np.tile(np.eye(3), (count, 1, 1))))
    sets.write_frames(folder, times, names)
    with open(os.path.join(folder, "cameras.yaml"), "w", encoding="ascii") as file:
        file.write("cam0: {image_width: 64, image_height: 48, fx: 50, fy: 50, cx: 32, cy: 24}\n")
    with open(os.path.join(folder, "flaws.json"), "w", encoding="ascii") as file:
        json.dump({"start": 0, "jump": 0, "jump_at": 0, "status": "tracking", **(flaws or {})},
                  file)
    return folder


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, *names):
        return os.path.join(self.folder, *names)


@unittest.skipUnless(flights.filmer(), "twoview_flights is not built")
class Flights(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.scratch.cleanup)
        cls.folder = flights.render(7, os.path.join(cls.scratch.name, "flight"),
                                    ["--first-frame", "300", "--max-frames", "2",
                                     "--depth-every", "1"])
        cls.set = sets.read_set(cls.folder)
        cls.truth = cls.set.truth()
        cls.camera = next(iter(formats.read_camera_set(cls.set.file("cameras.yaml")).values()))
        cls.K = np.array([[cls.camera.fx, 0, cls.camera.cx], [0, cls.camera.fy, cls.camera.cy],
                          [0, 0, 1]])
        x, y = np.meshgrid(np.arange(8, 632, 7), np.arange(8, 472, 7))
        cls.pixels = np.stack([x.ravel(), y.ravel()], 1)
        rays = datasets.undistort(cls.pixels, cls.K, datasets.distortion_of(cls.camera))
        depth = cv2.imread(cls.folder + "/depth/00300.png", cv2.IMREAD_UNCHANGED)
        z = depth[cls.pixels[:, 1], cls.pixels[:, 0]] / 5000.0
        cls.points = np.column_stack([rays, np.ones(len(rays))]) * z[:, None]  # of camera 0

    def test_a_flight_is_rendered_again_only_when_its_options_change(self):
        before = os.stat(self.folder).st_ino
        options = ["--first-frame", "300", "--max-frames", "2", "--depth-every", "1"]
        self.assertEqual(os.stat(flights.render(7, self.folder, options)).st_ino, before)
        self.assertNotEqual(flights.made_by(options), flights.made_by())

    def test_depths_and_poses_lie_on_the_surfaces(self):
        world = self.points @ self.truth.rotations[0].T + self.truth.positions[0]
        away = surfaces.distances(surfaces.read_boxes(self.set.file("surfaces.json")), world)
        self.assertLess(np.percentile(away, 99.9), 5e-4)  # the depth has steps of 0.2 mm

    def test_a_picture_is_the_one_before_it_carried_by_depth_and_pose(self):
        def carried(R, t):
            seen = (self.points @ R.T + t)
            pixel, _ = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), self.K,
                                         np.array(datasets.distortion_of(self.camera)))
            pixel = pixel.reshape(-1, 2)
            inside = (seen[:, 2] > 0) & (pixel > 1).all(1) & (pixel < (638, 478)).all(1)
            image = cv2.GaussianBlur(cv2.imread(self.folder + "/images/00301.jpg", 0), (5, 5), 1)
            grey = cv2.remap(image, pixel[:, 0].astype(np.float32), pixel[:, 1].astype(np.float32),
                             cv2.INTER_LINEAR).ravel()
            return np.abs(grey[inside].astype(float) - before[inside]).mean()
        image = cv2.GaussianBlur(cv2.imread(self.folder + "/images/00300.jpg", 0), (5, 5), 1)
        before = image[self.pixels[:, 1], self.pixels[:, 0]].astype(float)
        R0, R1 = self.truth.rotations
        t = R1.T @ (self.truth.positions[0] - self.truth.positions[1])
        self.assertGreater(np.linalg.norm(t), 0.01)
        right = carried(R1.T @ R0, t)
        self.assertLess(right, 4)
        self.assertLess(2 * right, carried(np.eye(3), 0 * t))
        self.assertLess(1.1 * right, carried(R1.T @ R0, -t))

    def turning(self):
        """A flight's folder, rendered once."""
        return flights.render(2, os.path.join(self.scratch.name, "turning"),
                              ["--first-frame", "60", "--max-frames", "110",
                               "--depth-every", "0"])

    def test_the_program_contradicts_a_camera_of_another_focal_length(self):
        folder = self.turning()
        with open(folder + "/cameras.yaml", encoding="utf-8") as file:
            camera = file.read()
        for factor, is_wrong in ((1, False), (0.88, True)):
            with self.subTest(factor=factor):
                out = os.path.join(self.scratch.name, f"camera_{factor}")
                os.makedirs(out)
                given = os.path.join(self.scratch.name, "given.yaml")
                with open(given, "w", encoding="utf-8") as file:
                    file.write(re.sub(r"(f[xy]: *)([0-9.]+)",
                                      lambda m: m[1] + str(factor * float(m[2])), camera))
                done = subprocess.run([runs.program_path(None), "odometry", folder, "-o", out,
                                       "--camera", given, "--no-pictures"], check=True,
                                      capture_output=True, text=True)
                with open(out + "/result.json", encoding="utf-8") as file:
                    check = json.load(file)["camera_check"]
                with open(out + "/report.html", encoding="utf-8") as file:
                    report = file.read()
                self.assertEqual(list(check),
                                 ["contradicted", "focal_change_percent", "focal_sigma_percent",
                                  "edge_change_percent", "edge_sigma_percent",
                                  "centre_shift_px", "centre_sigma_px"])
                self.assertEqual(check["contradicted"], is_wrong)
                self.assertLess(abs(check["focal_change_percent"] - 100 * (1 / factor - 1)),
                                3 * np.hypot(check["focal_sigma_percent"], 1))
                words = "contradict the camera"
                self.assertEqual("doubtful     the pictures " + words in done.stdout, is_wrong)
                self.assertEqual("The pictures " + words in report, is_wrong)

    def test_the_program_finds_the_focal_length_of_a_flight_that_turns(self):
        folder = self.turning()
        camera = next(iter(formats.read_camera_set(folder + "/cameras.yaml").values()))
        out = os.path.join(self.scratch.name, "without_camera")
        runs.run_odometry(runs.program_path(None), folder, out, ["--focal-35mm", "auto"])
        with open(out + "/result.json", encoding="utf-8") as file:
            focal = json.load(file)["focal_length"]
        self.assertFalse(focal["uncertain"])
        self.assertLess(abs(focal["pixels"] / np.sqrt(camera.fx * camera.fy) - 1), 0.05)
        written = formats.read_camera(out + "/estimated_camera.yaml")
        self.assertAlmostEqual(written.fx, focal["pixels"], delta=1e-6)

    def test_the_fusion_example_is_as_exact_as_it_says(self):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            fusion.main([self.turning(), "--noise", "0.1", "--draws", "3"])
        values = [float(value) for value in re.search(r"(?m)^all .*", out.getvalue())[0].split()
                  if value not in ("all", "%")]
        _, alone, _, _, _, fused, _, _, nees, share = values
        self.assertLess(fused, alone)
        self.assertLess(nees, 3)
        self.assertGreater(share, 30)

    def test_changed_copies_see_the_same_points(self):
        def pixels(found, k, world):
            camera = next(iter(formats.read_camera_set(found.file("cameras.yaml")).values()))
            truth = found.truth()
            seen = (world - truth.positions[k]) @ truth.rotations[k]
            K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
            return cv2.projectPoints(seen, np.zeros(3), np.zeros(3), K,
                                     np.array(datasets.distortion_of(camera)))[0].reshape(-1, 2)
        world = self.points @ self.truth.rotations[0].T + self.truth.positions[0]
        moved = {"mirrored": lambda p: [639, 0] + p * [-1, 1],
                 "upside_down": lambda p: [639, 479] - p,
                 "half_size": lambda p: (p + 0.5) / 2 - 0.5, "dark": lambda p: p}
        for kind, expected in moved.items():
            found = sets.read_set(copies.make(kind, self.folder, self.folder + "+" + kind))
            for k in range(2):
                own = world * [-1, 1, 1] if kind == "mirrored" else world
                away = pixels(found, k, own) - expected(pixels(self.set, k, world))
                self.assertLess(np.abs(away).max(), 1e-6, kind)
            if kind in ("mirrored", "upside_down"):
                now, before = (set_writer.read_grey(s, 1) for s in (found, self.set))
                for x, y in ((100, 51), (400, 300)):
                    u, v = expected(np.array([x, y]))
                    self.assertEqual(now[v, u], before[y, x], kind)
            self.assertEqual(found.json("fault.json")["source"], "flight")

    def test_the_drones_own_sensors_agree_with_the_truth(self):
        with open(self.set.file("imu.txt"), encoding="ascii") as file:
            lines = [line.split() for line in file if not line.startswith("#")]
        self.assertEqual(lines[0][0], "body_from_cam")
        w, x, y, z = map(float, lines[0][1:])
        body_from_cam = poses.rotations_of([[x, y, z, w]])[0]
        for k, line in enumerate(lines[1:]):
            values = np.array(line, float)
            self.assertAlmostEqual(values[0], self.set.times[k], 6)
            body = poses.rotations_of([values[[2, 3, 4, 1]]])[0]
            error = body @ body_from_cam @ self.truth.rotations[k].T
            # Gravity's direction; the yaw drifts.
            self.assertGreater(error[2, 2], np.cos(4 * values[5]))
            self.assertLess(values[6], -self.truth.positions[k][2] + 5 * values[7])
        speed = np.linalg.norm(np.diff(self.truth.positions, axis=0)) / np.diff(self.set.times)[0]
        self.assertAlmostEqual(np.linalg.norm(values[8:11]), speed, delta=5 * values[11])


class Faults(Folder):
    def setUp(self):
        super().setUp()
        self.source = make_set(self.path("source"))
        self.other = make_set(self.path("other"), size=(32, 24))

    def inject(self, kind):
        return sets.read_set(faults.inject(kind, self.source, self.path(kind), self.other))

    def picture(self, found, k):
        return cv2.imread(os.path.join(found.path, found.names[k]), cv2.IMREAD_GRAYSCALE)

    def test_each_keeps_the_truth_and_changes_its_interval_only(self):
        for kind in ("black", "covered", "other_room", "person"):
            found = self.inject(kind)
            first, last = found.json("fault.json")["intervals"][0]
            self.assertEqual(len(found.times), 60)
            self.assertEqual(len(found.truth()), 60)
            for k, time in enumerate(found.times):
                picture = self.picture(found, k)
                self.assertEqual(picture.shape, (48, 64))
                if not first <= time <= last:
                    self.assertTrue((picture == 100 + k).all(), (kind, k))
        self.assertEqual(self.inject("black").json("fault.json")["source"], "source")

    def test_black_and_covered_are_dark_and_the_other_room_is_the_others(self):
        self.assertLess(self.picture(self.inject("black"), 40).mean(), 10)
        self.assertLess(self.picture(self.inject("covered"), 40).mean(), 70)
        found = self.inject("other_room")
        fault = found.json("fault.json")
        self.assertEqual(fault["elsewhere"], fault["intervals"])
        start = int(np.flatnonzero(np.array(found.times) >= fault["elsewhere"][0][0])[0])
        self.assertTrue((self.picture(found, start) == 120).all())  # its frame 20 of 60

    def test_slow_and_dropped_leave_frames_out(self):
        slow = self.inject("slow")
        self.assertGreaterEqual(np.diff(slow.times).min(), 0.2 - 1e-6)
        self.assertEqual(len(slow.times), 10)
        self.assertAlmostEqual(len(self.inject("dropped").times), 48, delta=8)

    def test_the_person_covers_two_fifths_of_the_picture(self):
        grey, mask = faults.person_of((480, 640), np.random.default_rng(1))
        seen = (mask[:480] > 0).sum() / (480 * 640)
        self.assertAlmostEqual(seen, faults.PERSON_SHARE, delta=0.03)
        self.assertGreater(grey[mask > 0].std(), 25)  # textured

    def test_copies_keep_the_truth_of_each_picture(self):
        source = sets.read_set(self.source)
        true = dict(zip(source.names, source.truth().positions))
        for kind, count in (("backwards", 60), ("second_half", 30), ("every_second", 30),
                            ("every_third", 20), ("noisy", 60), ("blurred", 60), ("flicker", 60)):
            found = sets.read_set(copies.make(kind, self.source, self.path(kind)))
            self.assertEqual(len(found.times), count)
            self.assertTrue((np.diff(found.times) > 0).all(), kind)
            positions = dict(zip(np.round(found.truth().times, 6), found.truth().positions))
            for time, name in zip(found.times, found.names):
                path = os.path.join(found.path, name)
                if os.path.islink(path):
                    here = true[os.path.relpath(os.path.realpath(path), os.path.realpath(
                        self.source))]
                    self.assertLess(np.abs(positions[round(time, 6)] - here).max(), 1e-9, kind)
        flicker = [self.picture(found, k).mean() / (100 + k) for k in range(60)]
        self.assertGreater(np.std(flicker), 0.1)
        with self.assertRaisesRegex(ValueError, "no copy 'fire'"):
            copies.make("fire", self.source, self.path("x"))

    def test_a_fault_of_sensors_changes_its_columns_only(self):
        with open(self.path("source", "imu.txt"), "w", encoding="ascii") as file:
            file.write("# a comment\nbody_from_cam 1 0 0 0\n")
            for k in range(40):
                file.write(f"{0.1 * k} 1 0 0 0 0.01 {1 + 0.1 * k} 0.02 {0.5 * k} 0 1 0.05\n")
        before = np.loadtxt(self.path("source", "imu.txt"), skiprows=2)
        for kind in sensors.KINDS:
            folder = sensors.make(kind, self.source, self.path("sensors", kind))
            after = np.loadtxt(os.path.join(folder, "imu.txt"), skiprows=1)
            changed = sorted(set(np.nonzero(np.abs(after - before) > 1e-8)[1]))
            self.assertTrue(set(changed) <= ({6} if "height" in kind else {8, 10}), kind)
            self.assertEqual(not changed, kind == "none")
            self.assertEqual(sets.read_set(folder).names, sets.read_set(self.source).names)
        after = np.loadtxt(self.path("sensors", "velocity_late", "imu.txt"), skiprows=1)
        np.testing.assert_allclose(after[3:, 8], before[:-3, 8], atol=1e-8)
        with self.assertRaises(ValueError):
            sensors.make("height_furlongs", self.source, self.path("sensors", "x"))

    def test_an_unknown_fault_is_refused(self):
        with self.assertRaisesRegex(ValueError, "no fault 'fire'"):
            faults.inject("fire", self.source, self.path("x"))


class Command(Folder):
    def run_cli(self, *arguments, **flaws):
        source = self.path("set")
        if not os.path.isdir(source):
            make_set(source, flaws=flaws)
        program = self.path("program")
        with open(program, "w", encoding="ascii") as file:
            file.write(PROGRAM.format(python=sys.executable))
        os.chmod(program, os.stat(program).st_mode | stat.S_IXUSR)
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            status = cli.main(["--sets", source, "--program", program, "--json",
                               self.path("all.json"), *arguments])
        with open(self.path("all.json"), encoding="utf-8") as file:
            return status, out.getvalue(), json.load(file)

    def test_a_perfect_run_has_no_error_and_its_coverage(self):
        status, text, found = self.run_cli(start=6)
        run = found["runs"][0]
        self.assertEqual(status, 0, text)
        self.assertLess(run["truth"]["ate_rmse"], 1e-9)
        self.assertAlmostEqual(run["truth"]["coverage"], 0.9)
        self.assertAlmostEqual(run["truth"]["scale_ratio"], 0.5)
        self.assertEqual(run["status_counts"]["starting"], 6)
        self.assertAlmostEqual(run["time_ms"]["mean"], 2.5)
        self.assertGreater(run["peak_rss_mib"], 5)
        self.assertIn("90.0 %", text)

    def test_a_silent_jump_is_reported_and_fails(self):
        status, text, found = self.run_cli(jump=2.0, jump_at=40)
        self.assertEqual(status, 1)
        self.assertGreater(found["runs"][0]["silent"]["num_wrong"], 0)
        self.assertEqual(found["runs"][0]["silent"]["unflagged_jumps"], 1)
        self.assertIn("NO   sets and flights: no unflagged jump: 0 of 1; not set", text)

    def test_a_said_jump_is_not_silent(self):
        status, _, found = self.run_cli(jump=2.0, jump_at=40, status="weak")
        self.assertEqual((status, found["runs"][0]["silent"]["num_wrong"]), (0, 0))
        self.assertGreater(found["runs"][0]["truth"]["ate_rmse"], 0.1)

    def test_a_program_that_fails_is_named(self):
        status, text, found = self.run_cli(exit=2)
        self.assertEqual(status, 1)
        self.assertIn("status 2", found["runs"][0]["error"])
        self.assertIn("status 2", text)

    def test_every_seed_is_run_and_the_worst_one_judged(self):
        _, text, found = self.run_cli("--seeds", "3")
        self.assertEqual([run["seed"] for run in found["runs"]], [None, 1, 2])
        self.assertEqual(len({run["label"] for run in found["runs"]}), 3)
        self.assertRegex(text, r"(?m)^set +3 +0.0000 / 0.0000 / 0.0000")
        self.assertEqual(len(self.run_cli("--seeds", "2", "--seed", "1")[2]["runs"]), 2)

    def test_live_poses_of_another_unit_are_compared_among_themselves(self):
        self.run_cli("--keep", self.path("kept"))
        out = self.path("kept", "twoview", "set")
        live = poses.read_tum(os.path.join(out, "trajectory.txt"))
        live.positions[:25] *= 3  # before the metre is known
        poses.write_tum(os.path.join(out, "live.txt"), live)
        source = sets.read_set(self.path("set"))
        self.assertGreater(evaluate.evaluate(out, source)["silent_live"]["num_wrong"], 0)
        known = {round(float(time), 6) for time in live.times[25:]}
        with open(os.path.join(out, "frames.csv"), encoding="utf-8") as file:
            head, *rows = file.read().splitlines()
        with open(os.path.join(out, "frames.csv"), "w", encoding="utf-8") as file:
            file.write(head + ",scale\n")
            for row in rows:
                is_metric = round(float(row.split(",")[0]), 6) in known
                file.write(row + (",metric\n" if is_metric else ",unit\n"))
        found = evaluate.evaluate(out, source)
        self.assertEqual(found["silent_live"]["num_wrong"], 0)
        self.assertLess(found["live"]["ate_rmse"], 1e-9)

    def test_a_set_that_is_not_there_is_one_line(self):
        error = io.StringIO()
        with contextlib.redirect_stderr(error):
            self.assertEqual(cli.main(["--sets", self.path("nothing")]), 2)
        self.assertEqual(len(error.getvalue().splitlines()), 1)


class Endurance(Folder):
    def test_the_way_leads_there_and_back(self):
        self.assertEqual(endurance.there_and_back(4, 9).tolist(), [0, 1, 2, 3, 2, 1, 0, 1, 2])
        source = sets.read_set(make_set(self.path("source")))
        found = sets.read_set(endurance.repeat(source.path, self.path("long"), 150))
        self.assertEqual(len(found.times), 150)
        self.assertTrue((np.diff(found.times) > 0).all())
        self.assertEqual(found.names[59 + 7], os.path.abspath(
            os.path.join(source.path, source.names[59 - 7])))
        np.testing.assert_allclose(found.truth().positions[59 + 7],
                                   source.truth().positions[59 - 7])

    def test_more_time_in_a_later_part_is_not_flat(self):
        def reached(*times):  # of ways of a thousand frames there and back
            return endurance.judged([{"truth": {"coverage": 1.0}, "num_keyframes": 9,
                                      "num_segments": 1, "peak_rss_mib": 50.0, "times_ms": each}
                                     for each in times], 501)[0]
        flat = [5.0] * 10000
        longer = flat[:9000] + [5.6] * 1000
        self.assertTrue(reached(flat))
        self.assertTrue(reached(([4.0] * 500 + [6.0] * 500) * 10))
        self.assertFalse(reached(longer))
        self.assertFalse(reached(flat[:4000] + [5.6] * 1000 + flat[5000:]))
        self.assertIsNone(reached(flat[:1999]))
        # What every run takes longer for is the program's; what one does, the machine's.
        self.assertFalse(reached(longer, longer, longer))
        self.assertTrue(reached(longer, flat[:2000] + [7.0] * 2000 + flat[4000:]))


class Mapper(Folder):
    def test_positions_come_out_of_colmaps_text(self):
        os.makedirs(self.path("colmap"))
        with open(self.path("colmap", "images.txt"), "w", encoding="ascii") as file:
            # Half a turn about z, and nothing seen by the second image.
            file.write("# comment\n1 0 0 0 1 1 2 3 1 images/a b.png\n5 6 1\n"
                       "2 1 0 0 0 1 2 3 1 images/c.png\n\n")
        found = mapper.keyframes_of(self.folder)
        np.testing.assert_allclose(found["images/a b.png"], [1, 2, -3], atol=1e-12)
        np.testing.assert_allclose(found["images/c.png"], [-1, -2, -3], atol=1e-12)


class Targets(unittest.TestCase):
    def test_only_an_exact_truth_judges_the_covariance(self):
        def judged(**changes):
            run = {"label": "x", "set": "x", "kind": "flight", "num_unsaid_losses": 0,
                   "covariance": {"inside_share": 0.95, "num_pairs": 100, "is_truth_exact": True,
                                  **changes}}
            return [reached for reached, text in targets.judge([run]) if "covariance" in text][0]
        self.assertTrue(judged())
        self.assertFalse(judged(inside_share=0.5))
        self.assertFalse(judged(inside_share=0.99))
        self.assertIsNone(judged(is_truth_exact=False))

    def test_the_mean_time_is_of_the_frames_of_one_size(self):
        def run(size, *times):
            return {"label": "x", "set": "x", "kind": "set", "picture_size": size,
                    "times_ms": list(times), "time_ms": {"max": max(times)}}
        small = run([640, 480], 4.0, 4.0, 7.0)
        for last, mean, every in ((run([1241, 376], 20.0), True, True),
                                  (run([640, 480], 20.0), False, True),
                                  (run(None, 26.0), True, False)):
            found = [reached for reached, text in targets.judge([small, last]) if " ms" in text]
            self.assertEqual(found, [mean, every])

    def test_a_metre_that_is_off_is_judged_by_its_sigma(self):
        def judged(ratio, kind, scale="metric"):
            run = {"label": f"flight_00+{kind}", "set": "flight_00", "kind": "sensors",
                   "num_segments": 1, "scale": scale, "scale_sigma": 0.01,
                   "truth": {"scale_ratio": ratio, "ate_rmse": 0.1, "coverage": 1}}
            return [reached for reached, text in targets.judge([run]) if "sigmas: " in text]
        self.assertEqual(judged(1.02, "height_mm"), [True])
        self.assertEqual(judged(1.04, "height_mm"), [False])
        self.assertEqual(judged(2, "velocity_double", "unit"), [True])
        self.assertEqual(judged(0.96, "none"), [False])

    def test_the_worst_seed_counts(self):
        runs = [{"label": "seq_tsukuba", "set": "seq_tsukuba", "kind": "set", "num_segments": 1,
                 "truth": {"ate_rmse": ate, "coverage": 1.0}} for ate in (0.001, 0.0071, 0.002)]
        self.assertFalse(targets.judge(runs)[0][0])
        self.assertTrue(targets.judge([runs[0], runs[2]])[0][0])

    def test_a_set_needs_both_its_error_and_its_coverage(self):
        def judged(ate, coverage):
            run = {"label": "seq_tsukuba", "set": "seq_tsukuba", "kind": "set", "num_segments": 1,
                   "truth": {"ate_rmse": ate, "coverage": coverage}}
            return targets.judge([run])[0][0]
        self.assertTrue(judged(0.0069, 0.95))
        self.assertFalse(judged(0.0071, 0.95))
        self.assertFalse(judged(0.001, 0.94))
        self.assertFalse(judged(None, 0.99))


if __name__ == "__main__":
    unittest.main()
