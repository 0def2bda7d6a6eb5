#!/usr/bin/env python3
"""Tests of `twoview import` and `twoview export`: bags of every form, which rosbags and mcap write,
to set folders that are compared number by number; bad input; and exported bags that the same
packages read. Skipped without rosbags and mcap, but for what a missing package gets."""
import contextlib
import io
import json
import math
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
import unittest
from pathlib import Path

from cli_support import CliTest, main, program

SOURCE = Path(__file__).resolve().parents[2]

try:
    import cv2
    import numpy as np
    from bags import FORMS, write_bag
    from mcap.reader import make_reader
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore
    sys.path[:0] = [str(SOURCE / "tools" / "python"), str(SOURCE / "python")]
    os.environ.setdefault("TWOVIEW_LIBRARY", str(
        Path(program()).resolve().parents[1] / "lib" / "libtwoview.so"))
    from twoview_tools.bags import cli as verbs
except ImportError:
    AnyReader = None

NEEDS_ROSBAGS = unittest.skipIf(AnyReader is None,
                                "no rosbags, mcap and OpenCV: run scripts/bootstrap test")
T0 = 1_700_000_000_123_456_789
STEP = 40_000_000
WIDTH, HEIGHT = 32, 24
K = [300.0, 0, 15.5, 0, 301.0, 11.5, 0, 0, 1]
HALF = math.sqrt(0.5)
# A camera that looks along the x axis of its vehicle: base from camera.
LOOKS_AHEAD = (-0.5, 0.5, -0.5, 0.5)


def grey(index, width=WIDTH, height=HEIGHT):
    return np.random.default_rng(index).integers(0, 256, (height, width), dtype=np.uint8)


def numbers(path):
    return [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]


def pictures(make, count=5, topic="/cam/image_raw", **more):
    for i in range(count):
        ns = T0 + i * STEP
        yield topic, ns + 7, make.image(ns, grey(i).tobytes(), WIDTH, HEIGHT, **more)


def info(make, topic="/cam/camera_info", ns=T0, **more):
    return topic, ns, make.camera_info(ns, more.pop("width", WIDTH), more.pop("height", HEIGHT),
                                       more.pop("K", K), **more)


class BagTest(CliTest):
    """Most tests run the verb within this process, which saves the start of a Python each time."""

    def setUp(self):
        super().setUp()
        self.count = 0
        self.out = self.folder / "set"

    def new(self):
        """A new folder below the test's own."""
        self.count += 1
        folder = self.folder / f"{self.count}"
        folder.mkdir()
        return folder

    def run_verb(self, *arguments, **environment):
        return subprocess.run([program(), *map(str, arguments)], capture_output=True, timeout=120,
                              env={**os.environ, "TWOVIEW_PYTHON": sys.executable, **environment})

    def run_here(self, verb, *arguments):
        out, errors = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
            try:
                status = verbs.main(verb, list(map(str, arguments)))
            except SystemExit as end:
                status = end.code
        return subprocess.CompletedProcess((verb, *arguments), status, out.getvalue().encode(),
                                           errors.getvalue().encode())

    def bag(self, messages, form="ros1"):
        return write_bag(self.new(), form, messages)

    def imported(self, bag, *more):
        self.out = self.new() / "set"
        done = self.run_here("import", bag, "-o", self.out, "--json", *more)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def refused(self, messages, *words, more=(), form="ros1"):
        """One line with these words, status 2, and no folder."""
        bag = messages if isinstance(messages, Path) else self.bag(messages, form)
        self.out = self.new() / "set"
        self.assert_refused(self.run_here("import", bag, "-o", self.out, *more),
                            "twoview: import: ", *words)
        self.assertEqual(os.listdir(self.out.parent), [])

    def picture(self, index):
        """The picture of a line of frames.txt, as OpenCV reads it."""
        name = numbers(self.out / "frames.txt")[index][1]
        return cv2.imread(str(self.out / name), cv2.IMREAD_UNCHANGED)


@NEEDS_ROSBAGS
class Import(BagTest):
    def test_every_form_of_bag_gives_the_same_set(self):
        def messages(make):
            yield "/talk", T0, make.string("hello")
            yield "/tf_static", T0, make.frames(
                make.transform(T0, "base", "imu"),
                make.transform(T0, "base", "camera", (0.1, 0, 0.2), LOOKS_AHEAD))
            yield info(make, D=[-0.1, 0.02, 0.001, 0.002, 0.003])
            for i in range(5):
                ns = T0 + i * STEP
                yield "/imu", ns, make.imu(ns, (0, 0, math.sin(i / 10), math.cos(i / 10)))
                yield "/odom", ns, make.odometry(ns, (i, 2, 3), (0, 0, HALF, HALF))
            yield from pictures(make, encoding="mono8")

        found = {}
        for form in FORMS:
            with self.subTest(form):
                summary = self.imported(self.bag(messages, form))
                self.assertEqual(summary["notes"], [])
                for key in ("num_frames", "num_attitudes", "num_poses"):
                    self.assertEqual(summary[key], 5)
                for i in range(5):
                    self.assertTrue((self.picture(i) == grey(i)).all())
                found[form] = {path.name: path.read_bytes() for path in self.out.iterdir()
                               if path.is_file()}
        self.assertEqual(set(found["ros1"]), {"frames.txt", "cameras.yaml", "imu.txt",
                                              "groundtruth.txt"})
        for form in FORMS:
            self.assertEqual(found[form], found["ros1"], form)
        self.assertEqual([line[0] for line in numbers(self.out / "frames.txt")],
                         [f"1700000000.{123456789 + i * STEP:09d}" for i in range(5)])
        camera = (self.out / "cameras.yaml").read_text()
        for line in ("fx: 300", "fy: 301", "cx: 15.5", "cy: 11.5", "k1: -0.1", "p2: 0.002",
                     "k3: 0.003", "image_width: 32", "image_height: 24"):
            self.assertIn(f"  {line}\n", camera)
        # base from camera is x = z, y = -x, z = -y; the vehicle's axes of imu.txt have y and z the
        # other way round: x = z, y = x, z = y.
        mount, *samples = numbers(self.out / "imu.txt")
        self.assertEqual(mount[0], "body_from_cam")
        self.assertEqual([float(value) for value in mount[1:]], [0.5, 0.5, 0.5, 0.5])
        for i, sample in enumerate(samples):
            self.assertEqual(sample[0], f"1700000000.{123456789 + i * STEP:09d}")
            # A turn to the left is one by a negative angle about the axis that points down.
            expected = (math.cos(i / 10), 0, 0, -math.sin(i / 10), 0.03)
            for value, expected in zip(sample[1:6], expected):
                self.assertAlmostEqual(float(value), expected, 8)
            self.assertEqual(sample[6:], ["nan", "0", "nan", "nan", "nan", "0"])
        # The vehicle looks along y, so the camera's z axis does, its x axis along x.
        for i, pose in enumerate(numbers(self.out / "groundtruth.txt")):
            expected = (i - 0, 2 + 0.1, 3.2, -HALF, 0, 0, HALF)
            for value, one in zip(pose[1:], expected):
                self.assertAlmostEqual(float(value), one, 8)

    def test_the_list_has_each_topic_with_type_number_and_rate(self):
        def messages(make):
            yield info(make)
            yield from pictures(make)
            yield "/talk", T0, make.string("hello")

        for form in ("ros1", "sqlite3", "mcap"):
            bag = self.bag(messages, form)
            done = self.succeed(self.run_here("import", bag, "--list"))
            self.assertRegex(
                done.stdout.decode(),
                r"topic +/cam/image_raw +sensor_msgs/msg/Image +5 +25.00 Hz  picture\n")
            rows = json.loads(self.run_here("import", bag, "--list", "--json").stdout)["topics"]
            self.assertEqual([(row["name"], row["type"], row["count"], row["used_for"])
                              for row in rows],
                             [("/cam/camera_info", "sensor_msgs/msg/CameraInfo", 1, "camera"),
                              ("/cam/image_raw", "sensor_msgs/msg/Image", 5, "picture"),
                              ("/talk", "std_msgs/msg/String", 1, "")])
            self.assertAlmostEqual(rows[1]["rate_hz"], 25, 9)

    def test_encodings_become_the_pixels_that_they_say(self):
        # Blue, green, red.
        colour = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        deep = np.random.default_rng(2).integers(0, 65536, (HEIGHT, WIDTH), dtype=np.uint16)
        rgb, alpha = colour[:, :, ::-1], np.full((HEIGHT, WIDTH, 1), 9, np.uint8)
        flat = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        flat[:] = (30, 90, 200)  # blue, green, red
        # BT.601 from 16 to 235, as ROS's cv_bridge takes it.
        y, u, v = np.rint(np.array([16, 128, 128]) + np.array(
            [[65.481, 128.553, 24.966], [-37.797, -74.203, 112], [112, -93.786, -18.214]])
            @ flat[0, 0, ::-1] / 255)
        uyvy = np.tile(np.array([u, y, v, y], np.uint8), (HEIGHT, WIDTH // 2))
        cases = [("mono8", grey(0), grey(0), 0), ("8UC1", grey(0), grey(0), 0),
                 ("mono16", deep.astype("<u2"), deep, 0), ("16UC1", deep.astype("<u2"), deep, 0),
                 ("rgb8", rgb, colour, 0), ("bgr8", colour, colour, 0), ("8UC3", colour, colour, 0),
                 ("rgba8", np.concatenate([rgb, alpha], 2), colour, 0),
                 ("bgra8", np.concatenate([colour, alpha], 2), colour, 0),
                 ("rgb16", (rgb.astype("<u2") * 257), colour.astype(np.uint16) * 257, 0),
                 ("uyvy", uyvy, flat, 3), ("yuv422", uyvy, flat, 3),
                 ("yuyv", uyvy.reshape(-1, 2)[:, ::-1], flat, 3),
                 ("yuv422_yuy2", uyvy.reshape(-1, 2)[:, ::-1], flat, 3)]
        for order in ("rggb", "bggr", "gbrg", "grbg"):
            mosaic = np.empty((HEIGHT, WIDTH), np.uint8)
            for place, letter in enumerate(order):
                mosaic[place // 2::2, place % 2::2] = flat[0, 0, "bgr".index(letter)]
            cases += [(f"bayer_{order}8", mosaic, flat, 0),
                      (f"bayer_{order}16", mosaic.astype("<u2") * 257,
                       flat.astype(np.uint16) * 257, 0)]
        for form in ("ros1", "mcap"):
            for encoding, pixels, expected, most in cases:
                with self.subTest(encoding):
                    bag = self.bag(lambda make: [
                        ("/a", T0, make.image(T0, pixels.tobytes(), WIDTH, HEIGHT, encoding))],
                        form)
                    self.imported(bag)
                    got = self.picture(0)
                    self.assertEqual((got.shape, got.dtype), (expected.shape, expected.dtype))
                    difference = np.abs(got.astype(int) - expected.astype(int))
                    self.assertLessEqual(difference.max(), most)

    def test_the_order_of_bytes_and_longer_rows_are_read(self):
        deep = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(HEIGHT, WIDTH) * 13
        padded = np.zeros((HEIGHT, WIDTH * 2 + 6), np.uint8)
        padded[:, :WIDTH * 2] = deep.astype(">u2").view(np.uint8).reshape(HEIGHT, -1)
        self.imported(self.bag(lambda make: [("/a", T0, make.image(
            T0, padded.tobytes(), WIDTH, HEIGHT, "mono16", is_bigendian=True))]))
        self.assertTrue((self.picture(0) == deep).all())

    def test_compressed_pictures_keep_their_bytes(self):
        deep = np.random.default_rng(2).integers(0, 65536, (HEIGHT, WIDTH), dtype=np.uint16)
        jpeg = cv2.imencode(".jpg", grey(0))[1].tobytes()
        png8, png16 = (cv2.imencode(".png", one)[1].tobytes() for one in (grey(1), deep))
        mosaic = np.empty((HEIGHT, WIDTH), np.uint8)
        mosaic[0::2, 0::2], mosaic[0::2, 1::2] = 200, 90
        mosaic[1::2, 0::2], mosaic[1::2, 1::2] = 90, 30
        for about, data, ending, kept in (
                ("jpeg", jpeg, ".jpg", jpeg), ("rgb8; jpeg compressed bgr8", jpeg, ".jpg", jpeg),
                ("png", png8, ".png", png8), ("mono16; png compressed ", png16, ".png", png16),
                ("16UC1; compressedDepth png", bytes(12) + png16, ".png", png16),
                ("bayer_rggb8; png compressed ", cv2.imencode(".png", mosaic)[1].tobytes(), ".ppm",
                 None)):
            with self.subTest(about):
                bag = self.bag(lambda make: [
                    ("/a/compressed", T0, make.compressed(T0, data, about))])
                summary = self.imported(bag)
                name = numbers(self.out / "frames.txt")[0][1]
                self.assertTrue(name.endswith(ending), name)
                if kept is None:
                    self.assertEqual(self.picture(0)[5, 5].tolist(), [30, 90, 200])
                else:
                    self.assertEqual((self.out / name).read_bytes(), kept)
                    self.assertEqual(summary["size"], [WIDTH, HEIGHT])

    def test_lenses_are_those_that_camera_info_names(self):
        cases = (
            ("plumb_bob", (-0.3, 0.1, 0, 0, 0.01), {"k1": "-0.3", "k3": "0.01"}, ()),
            ("", (), {"k1": "0"}, ()),
            ("rational_polynomial", (1, 2, 3, 4, 5, 6, 7, 8), {"k1": "1", "k6": "8"}, ()),
            ("equidistant", (0.1, 0.2, 0.3, 0.4), {"distortion_model": "equidistant", "k4": "0.4"},
             ()))
        for model, D, entries, _ in cases:
            for form in ("ros1", "sqlite3"):
                with self.subTest(model=model, form=form):
                    self.imported(self.bag(lambda make: [
                        info(make, model=model, D=D), *pictures(make, 1)], form))
                    text = (self.out / "cameras.yaml").read_text()
                    for entry, value in entries.items():
                        self.assertIn(f"  {entry}: {value}\n", text)
        for model, words in (("fov", ("fov",)), ("my_own", ("my_own",))):
            bag = self.bag(lambda make: [info(make, model=model, D=[0.9]), *pictures(make, 1)])
            self.refused(bag, "/cam/camera_info", *words, "--camera-info none")
            self.imported(bag, "--camera-info", "none")
            self.assertFalse((self.out / "cameras.yaml").exists())

    def test_binning_and_a_part_of_the_sensor_are_applied_and_a_rectified_picture_takes_p(self):
        summary = self.imported(self.bag(lambda make: [
            info(make, width=128, height=96, K=[600, 0, 63.5, 0, 600, 47.5, 0, 0, 1], binning=2,
                 roi=(32, 24, 64, 48)), *pictures(make, 1)]))
        text = (self.out / "cameras.yaml").read_text()
        self.assertIn("fx: 300\n", text)
        self.assertIn("cx: 15.5\n", text)
        self.assertEqual(summary["notes"], [])
        summary = self.imported(self.bag(lambda make: [
            info(make, D=[0.5], P=[250, 0, 16, 0, 0, 251, 12, 0, 0, 0, 1, 0]),
            *pictures(make, 1, "/cam/image_rect_color")]))
        text = (self.out / "cameras.yaml").read_text()
        for line in ("fx: 250", "fy: 251", "cx: 16", "k1: 0"):
            self.assertIn(f"  {line}\n", text)
        self.assertIn("is rectified", summary["notes"][0])

    def test_stamps_that_are_zero_give_the_times_of_receipt_and_a_note(self):
        def messages(make):
            for i in range(3):
                yield "/a", T0 + i * STEP, make.image(0, grey(i).tobytes(), WIDTH, HEIGHT)
                yield "/pose", T0 + i * STEP + 5, make.pose_stamped(99, (i, 0, 0))

        summary = self.imported(self.bag(messages))
        self.assertEqual(summary["times"], "receive")
        self.assertTrue(any("/a have no stamps" in note for note in summary["notes"]))
        self.assertEqual(numbers(self.out / "frames.txt")[1][0], "1700000000.163456789")
        self.assertEqual(numbers(self.out / "groundtruth.txt")[2][0], "1700000000.203456794")

    def test_times_are_sorted_and_what_repeats_or_has_no_stamp_is_left_out_and_counted(self):
        def messages(make):
            for i in (0, 2, 1, 2):
                yield "/a", T0, make.image(T0 + i * STEP, grey(i).tobytes(), WIDTH, HEIGHT)
            yield "/a", T0, make.image(0, grey(7).tobytes(), WIDTH, HEIGHT)
            yield "/a", T0, make.image(T0 + 9 * STEP, bytes(7 * HEIGHT), WIDTH, HEIGHT, "mono8")

        summary = self.imported(self.bag(messages))
        self.assertEqual([line[0][-9:] for line in numbers(self.out / "frames.txt")],
                         ["123456789", "163456789", "203456789"])
        for i in range(3):
            self.assertTrue((self.picture(i) == grey(i)).all())
        text = " ".join(summary["notes"])
        for words in ("1 message of /a is left out: it has the time of one before it",
                      "1 message of /a is left out: it has no stamp", "rows of 7 bytes"):
            self.assertIn(words, text)

    def test_poses_of_every_type_are_the_truth_and_without_frames_a_note_says_of_what(self):
        for kind in ("pose_stamped", "pose_with_covariance", "odometry", "transform"):
            with self.subTest(kind):
                def pose(make):
                    if kind == "transform":
                        return make.transform(T0, "world", "body", (1, 2, 3), (0, 0, 1, 0))
                    return getattr(make, kind)(T0, (1, 2, 3), (0, 0, 1, 0))

                bag = self.bag(lambda make: [("/p", T0, pose(make)), *pictures(make, 1)])
                summary = self.imported(bag)
                self.assertEqual([float(value) for value in
                                  numbers(self.out / "groundtruth.txt")[0][1:]],
                                 [1, 2, 3, 0, 0, 1, 0])
                self.assertTrue(any("groundtruth.txt: the poses of /p are of" in note
                                    for note in summary["notes"]))

    def test_attitudes_that_cannot_be_used_are_left_out_with_the_reason(self):
        def flight(make, **more):
            yield "/tf_static", T0, make.frames(make.transform(T0, "imu", "camera"))
            for i in range(3):
                given = {"q": (0, 0, math.sin(i), math.cos(i)), **more}
                yield "/imu", T0 + i, make.imu(T0 + i, **given)
            yield from pictures(make, 2)

        for more, words in (({"covariance": (-1, 0)}, "no orientation"),
                            ({"q": (0, 0, 0, 0)}, "no orientation"),
                            ({"q": (0, 0, 0, 1)}, "all 3 orientations of /imu are the same"),
                            ({"a": (9.81, 0, 0)}, "90 degrees from the vertical")):
            with self.subTest(words):
                bag = self.bag(lambda make: flight(make, **more))
                summary = self.imported(bag)
                self.assertTrue(any("no imu.txt" in note and words in note
                                    for note in summary["notes"]), summary["notes"])
                self.assertFalse((self.out / "imu.txt").exists())
        # No errors stated: one degree. z down: the accelerations point along -z.
        summary = self.imported(self.bag(lambda make: flight(make, covariance=(0, 0),
                                                             a=(0, 0, -9.81))))
        self.assertTrue(any("1 degree" in note for note in summary["notes"]))
        self.assertTrue(any("z down" in note for note in summary["notes"]))
        mount, _, second, _ = numbers(self.out / "imu.txt")
        self.assertEqual([float(value) for value in mount[1:]], [1, 0, 0, 0])
        for value, expected in zip(second[1:6], (math.cos(1), 0, 0, math.sin(1), math.radians(1))):
            self.assertAlmostEqual(float(value), expected, 6)

    def test_without_frames_the_mount_is_asked_for(self):
        def messages(make):
            for i in range(2):
                yield "/imu", T0 + i, make.imu(T0 + i, (0, 0, math.sin(i), math.cos(i)))
            yield from pictures(make, 1)

        bag = self.bag(messages)
        self.assertTrue(any("--body-from-cam" in note for note in self.imported(bag)["notes"]))
        self.assertFalse((self.out / "imu.txt").exists())
        self.imported(bag, "--body-from-cam", "0.5", "0.5", "0.5", "0.5")
        self.assertEqual(numbers(self.out / "imu.txt")[0],
                         ["body_from_cam", *["0.500000000"] * 4])

    def test_one_camera_in_two_forms_and_depths_beside_it_are_no_question(self):
        jpeg = cv2.imencode(".jpg", grey(0))[1].tobytes()

        def messages(make):
            yield info(make)
            yield "/cam/image_raw/compressed", T0, make.compressed(T0, jpeg)
            yield "/depth/image_raw", T0, make.image(T0, bytes(WIDTH * HEIGHT * 2), WIDTH, HEIGHT,
                                                     "16UC1")
            yield from pictures(make, 3)

        bag = self.bag(messages)
        summary = self.imported(bag)
        self.assertEqual(summary["topics"]["image"], "/cam/image_raw")
        self.assertEqual(summary["topics"]["camera_info"], "/cam/camera_info")
        self.assertTrue(any("/depth/image_raw" in note for note in summary["notes"]))
        summary = self.imported(bag, "--image", "/depth/image_raw")
        self.assertEqual(self.picture(0).dtype, np.uint16)

    def test_without_camera_info_the_rest_is_imported_and_a_note_says_so(self):
        done = self.run_here("import", self.bag(lambda make: pictures(make, 2)), "-o", self.out)
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        self.assertIn("note         no camera file: no CameraInfo", done.stdout.decode())
        self.assertFalse((self.out / "cameras.yaml").exists())
        summary = self.imported(self.bag(lambda make: [info(make, K=[0] * 9), *pictures(make, 1)]))
        self.assertTrue(any("not calibrated" in note for note in summary["notes"]))

    def test_a_bag_that_was_cut_gives_what_is_whole_and_a_note(self):
        def messages(make):
            for i in range(60):
                ns = T0 + i * STEP
                yield "/a", ns, make.image(ns, grey(i, 64, 64).tobytes(), 64, 64)

        for form in ("ros1", "ros1-lz4", "ros1-bz2", "mcap", "mcap-folder", "sqlite3"):
            bag = self.bag(messages, form)
            file = bag if bag.is_file() else next(
                path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))
            whole = file.read_bytes()
            for share in (0.5, 0.9):
                with self.subTest(form=form, share=share):
                    file.write_bytes(whole[:int(share * len(whole))])
                    if file != bag:
                        (bag / "metadata.yaml").unlink(missing_ok=True)
                    summary = self.imported(bag)
                    self.assertTrue(summary["cut"])
                    self.assertTrue(any("cut or damaged" in note for note in summary["notes"]))
                    # An MCAP file has a number of pictures in a chunk.
                    self.assertGreaterEqual(summary["num_frames"], 60 * share - 18)
                    self.assertLess(summary["num_frames"], 60)
                    for i in range(summary["num_frames"]):
                        self.assertTrue((self.picture(i) == grey(i, 64, 64)).all())
            for length in (0, 3, 20, 60):
                file.write_bytes(whole[:length])
                self.refused(bag)

    def test_a_chunk_of_wrong_bytes_costs_that_chunk(self):
        def messages(make):
            for i in range(60):
                ns = T0 + i * STEP
                yield "/a", ns, make.image(ns, grey(i, 64, 64).tobytes(), 64, 64)

        bag = self.bag(messages, "mcap")
        data = bytearray(bag.read_bytes())
        data[len(data) // 2] ^= 255
        bag.write_bytes(data)
        summary = self.imported(bag)
        self.assertTrue(any("in 1 chunk" in note for note in summary["notes"]))
        self.assertGreater(summary["num_frames"], 30)
        for i, (time, _) in enumerate(numbers(self.out / "frames.txt")):
            index = (int(time.replace(".", "")) - T0) // STEP
            self.assertTrue((self.picture(i) == grey(index, 64, 64)).all())

    def test_a_recording_that_was_killed_and_one_without_definitions_are_read(self):
        """sqlite3 of ROS 2 before Jazzy has no table of definitions, and a killed one a journal."""
        bag = self.bag(lambda make: [*pictures(make), info(make)], "sqlite3")
        file, = bag.glob("*.db3")
        with contextlib.closing(sqlite3.connect(file)) as database:
            database.execute("DROP TABLE message_definitions")
            database.execute("PRAGMA journal_mode=WAL")
            database.execute("INSERT INTO messages(topic_id, timestamp, data) SELECT topic_id, "
                             "timestamp, data FROM messages WHERE topic_id = 2")
            database.commit()
            killed = self.new()
            for path in bag.glob("*.db3*"):
                shutil.copy(path, killed)
        self.assertTrue(any(path.stat().st_size for path in killed.glob("*-wal")))
        for source in (killed, killed / file.name):
            summary = self.imported(source)
            self.assertEqual((summary["num_frames"], summary["topics"]["camera_info"]),
                             (5, "/cam/camera_info"))
        rows = json.loads(self.run_here("import", killed, "--list", "--json").stdout)["topics"]
        self.assertEqual(rows[0]["count"], 2)  # one of them in the journal

    def test_a_signal_leaves_nothing(self):
        def messages(make):
            for i in range(400):
                ns = T0 + i * STEP
                yield "/a", ns, make.image(ns, grey(i % 9, 400, 300).tobytes(), 300, 400)

        bag = self.bag(messages)
        self.out = self.new() / "set"
        started = subprocess.Popen([program(), "import", str(bag), "-o", str(self.out)],
                                   env={**os.environ, "TWOVIEW_PYTHON": sys.executable},
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        while started.poll() is None and not os.listdir(self.out.parent):
            time.sleep(0.002)
        started.send_signal(signal.SIGTERM)
        started.communicate(timeout=60)
        if started.returncode != 0:  # it had not ended before the signal came
            self.assertEqual(started.returncode, -signal.SIGTERM)
            self.assertEqual(os.listdir(self.out.parent), [])

    # -- bad input ----------------------------------------------------------------------------

    def test_bad_input_is_one_line_and_leaves_nothing(self):
        self.refused(lambda make: [], "without any message")
        self.refused(lambda make: [("/talk", T0, make.string("x"))],
                     "no topic of Image or CompressedImage", "/talk (std_msgs/msg/String)")
        two = self.bag(lambda make: [*pictures(make, 1, "/left/image_raw"),
                                     *pictures(make, 1, "/right/image_raw")])
        self.refused(two, "2 topics have pictures: /left/image_raw, /right/image_raw", "--image")
        self.refused(two, "no topic /up", "/left/image_raw, /right/image_raw",
                     more=("--image", "/up"))
        self.refused(lambda make: [("/a", T0, make.odometry(T0, (0, 0, 0))),
                                   ("/b", T0, make.pose_stamped(T0, (0, 0, 0))),
                                   *pictures(make, 1)],
                     "2 topics have Odometry or a pose: /a, /b", "--truth")
        floats = bytes(4 * WIDTH * HEIGHT)
        self.refused(lambda make: [("/a", T0, make.image(T0, floats, WIDTH, HEIGHT, "32FC1"))],
                     "/a", "'32FC1'", "mono8")
        self.refused(lambda make: [("/a", T0, make.compressed(T0, b"\0\0\0\1" * 9, "h264"))],
                     "'h264'", "JPEG")
        self.refused(self.write("text.bag", "no bag"), "is no bag")
        self.refused(self.write("old.bag", "#ROSBAG V1.2\n"), "V1.2")
        self.refused(self.folder / "nothing", "there is none")
        (self.folder / "empty").mkdir()
        self.refused(self.folder / "empty", "is no ROS 2 bag")
        good = self.bag(lambda make: pictures(make, 1))
        full = self.new()
        (full / "mine").touch()
        done = self.run_here("import", good, "-o", full)
        self.assert_refused(done, "twoview: import: ", "is not empty")
        self.assertEqual(os.listdir(full), ["mine"])
        self.assert_refused(self.run_here("import", good), "-o SET is required")

    def test_two_cameras_take_the_camera_info_beside_the_chosen_one(self):
        bag = self.bag(lambda make: [
            info(make, "/left/camera_info"), info(make, "/right/camera_info", K=[9, *K[1:]]),
            *pictures(make, 1, "/left/image_raw"), *pictures(make, 1, "/right/image_raw")])
        summary = self.imported(bag, "--image", "/left/image_raw")
        self.assertEqual(summary["topics"]["camera_info"], "/left/camera_info")
        bag = self.bag(lambda make: [
            info(make, "/left/camera_info"), *pictures(make, 1, "/left/image_raw"),
            *pictures(make, 1, "/right/image_raw")])
        summary = self.imported(bag, "--image", "/right/image_raw")
        self.assertFalse((self.out / "cameras.yaml").exists())
        self.assertTrue(any("none of /left/camera_info" in note for note in summary["notes"]))

    def test_other_encodings_of_mcap_are_listed_and_not_read(self):
        from mcap.writer import Writer
        path = self.folder / "fox.mcap"
        with open(path, "wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema("foxglove.CompressedImage", "protobuf", b"\x0a\xff")
            channel = writer.register_channel("/cam", "protobuf", schema)
            writer.add_message(channel, T0, b"x", T0)
            writer.finish()
        done = self.succeed(self.run_here("import", path, "--list"))
        self.assertIn("not read: protobuf", done.stdout.decode())
        self.refused(path, "/cam (foxglove.CompressedImage)")


class RoundTrip(BagTest):
    @NEEDS_ROSBAGS
    def test_an_imported_flight_gives_the_odometry_of_its_folder_and_its_export_reads_back(self):
        from test_odometry import CAMERAS, LUMA, TIMES, TUM_TRUTH
        from test_odometry import HEIGHT as height
        from test_odometry import PICTURES
        from test_odometry import WIDTH as width
        for i, data in enumerate(PICTURES):
            self.write(f"given/images/{i:05}.png", data)
        self.write("given/frames.txt", "".join(
            f"{time + 1:.9f} images/{i:05}.png\n" for i, time in enumerate(TIMES)))
        self.write("given/cameras.yaml", CAMERAS)
        self.write("given/groundtruth.txt", "".join(
            f"{float(line.split()[0]) + 1:.9f} {line.split(maxsplit=1)[1]}\n"
            for line in TUM_TRUTH.splitlines()[1:]))

        def messages(make):
            yield info(make, width=width, height=height,
                       K=[300, 0, (width - 1) / 2, 0, 300, (height - 1) / 2, 0, 0, 1])
            for i, (time, luma) in enumerate(zip(TIMES, LUMA)):
                ns = round((time + 1) * 1e9)
                yield "/cam/image_raw", ns, make.image(ns, luma, width, height)
                yield "/odom", ns, make.odometry(ns, (0.1 * i, 0, 0), child="camera")

        bag = self.bag(messages, "mcap")
        done = self.succeed(self.run_verb("import", bag, "-o", self.out))
        self.assertNotIn("note", done.stdout.decode())
        results = {}
        for source in (self.folder / "given", self.out):
            out = self.folder / f"path of {source.name}"
            self.succeed(self.run_verb("odometry", source, "-o", out, "--quiet"))
            result = json.loads((out / "result.json").read_text())
            truth = {key: value if value is None else round(value, 9)
                     for key, value in result["truth"].items()}
            results[source.name] = [(out / "trajectory.txt").read_text(),
                                    (out / "live.txt").read_text(), truth]
        self.assertEqual(results["given"], results["set"])
        self.export_reads_back(self.folder / "path of set")

    def export_reads_back(self, path):
        lines = numbers(path / "trajectory.txt")
        cloud = json.loads((path / "result.json").read_text())["num_points"]
        for name in ("out.bag", "folder", "out.mcap", "folder of mcap"):
            with self.subTest(name):
                out = self.folder / name
                more = ("--storage", "mcap") if "of mcap" in name else ()
                done = self.succeed(self.run_here("export", path, "-o", out, *more, "--json"))
                self.assertEqual(json.loads(done.stdout)["num_poses"], len(lines))
                found = {}
                if name == "out.mcap":
                    store = get_typestore(Stores.ROS2_HUMBLE)
                    with open(out, "rb") as file:
                        for schema, channel, raw in make_reader(file).iter_messages():
                            found.setdefault(channel.topic, []).append(
                                (raw.log_time, store.deserialize_cdr(raw.data, schema.name)))
                else:
                    with AnyReader([out]) as reader:
                        for connection, ns, raw in reader.messages():
                            found.setdefault(connection.topic, []).append(
                                (ns, reader.deserialize(raw, connection.msgtype)))
                self.assertEqual(set(found), {"/twoview/odometry", "/twoview/cloud", "/tf_static"})
                self.assertEqual(len(found["/twoview/odometry"]), len(lines))
                for line, (ns, message) in zip(lines, found["/twoview/odometry"]):
                    stamp = message.header.stamp
                    self.assertEqual(stamp.sec * 10**9 + stamp.nanosec, ns)
                    self.assertEqual(ns, round(float(line[0]) * 1e9))
                    pose = message.pose.pose
                    values = (pose.position.x, pose.position.y, pose.position.z, pose.orientation.x,
                              pose.orientation.y, pose.orientation.z, pose.orientation.w)
                    for value, expected in zip(values, map(float, line[1:])):
                        self.assertAlmostEqual(value, expected, 7)
                    self.assertEqual((message.header.frame_id, message.child_frame_id),
                                     ("twoview_map", "camera"))
                    self.assertEqual(message.pose.covariance[0], -1)
                    self.assertEqual(message.twist.covariance[0], -1)
                (_, message), = found["/twoview/cloud"]
                from_ply = self.cloud(path / "cloud.ply")
                self.assertEqual(message.width, len(from_ply))
                self.assertGreater(message.width, cloud // 2)
                self.assertEqual([field.name for field in message.fields],
                                 ["x", "y", "z", "rgb", "sigma", "num_observations"])
                points = np.frombuffer(message.data.tobytes(), [
                    ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("sigma", "<f4"),
                    ("num_observations", "<u4")])
                for axis in "xyz":
                    self.assertTrue((points[axis] == from_ply[axis]).all())
                self.assertTrue((points["rgb"] >> 16 == from_ply["red"]).all())
                (_, frames), = found["/tf_static"]
                transform = frames.transforms[0]
                self.assertEqual((transform.header.frame_id, transform.child_frame_id),
                                 ("map", "twoview_map"))
        for arguments, words in (((path, "-o", self.folder / "out.bag"), "is there already"),
                                 ((self.folder, "-o", self.folder / "x.bag"), "no trajectory.txt"),
                                 ((path, "-o", self.folder / "no/x.bag"), "there is no folder")):
            self.assert_refused(self.run_here("export", *arguments), "twoview: export: ", words,
                                out=self.folder / "no")

    @staticmethod
    def cloud(path):
        data = path.read_bytes()
        head, _, body = data.partition(b"end_header\n")
        kinds = {"float": "<f4", "uchar": "u1", "int": "<i4"}
        names = [line.split() for line in head.decode().splitlines() if line.startswith("property")]
        return np.frombuffer(body, [(words[2], kinds[words[1]]) for words in names])


class WithoutPackages(BagTest):
    def test_a_missing_package_is_one_line(self):
        blocked = self.folder / "blocked"
        for name in ("rosbags", "mcap"):
            self.write(f"blocked/{name}.py", f"raise ImportError('no {name}', name='{name}')\n")
        self.write("a.bag", "#ROSBAG V2.0\n")
        (self.folder / "path").mkdir()
        for verb in (("import", self.folder / "a.bag", "-o", self.out),
                     ("export", self.folder / "path", "-o", self.folder / "b.bag")):
            done = self.run_verb(*verb, PYTHONPATH=str(blocked))
            self.assert_refused(done, "pip install")
            self.assertFalse(self.out.exists())


if __name__ == "__main__":
    main()
