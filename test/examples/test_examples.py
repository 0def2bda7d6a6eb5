"""The examples: built against an installed library by CMake and by pkg-config alone, and run as
their README says.

Arguments: the project's folder, its build folder, cmake, the C compiler.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCE, BUILD, CMAKE, CC = sys.argv[1:5]
EXAMPLES = pathlib.Path(SOURCE, "examples")
PROGRAM = pathlib.Path(BUILD, "bin", "twoview")
SKIP_CODE = 77
# The Motorcycle pair's fx, fy, cx of image 0, cx of image 1, and cy, in pixels.
CAMERA = ["994.978", "994.978", "311.193", "342.279", "254.877"]

try:
    import cv2
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(SKIP_CODE)


def run(*command, status=0, **options):
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, timeout=300, **options
    )
    assert done.returncode == status, (command, done.returncode, done.stdout, done.stderr)
    return done.stdout + done.stderr


def number(pattern, text):
    found = re.search(pattern, text)
    assert found, (pattern, text)
    return float(found.group(1))


class Examples(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        prefix = cls.folder / "prefix"
        run(CMAKE, "--install", BUILD, "--prefix", prefix)
        cls.prefix = prefix
        cls.bin = cls.folder / "build"
        run(
            CMAKE,
            "-G",
            "Ninja",
            "-S",
            EXAMPLES,
            "-B",
            cls.bin,
            f"-DCMAKE_PREFIX_PATH={prefix}",
            f"-DCMAKE_C_COMPILER={CC}",
            "-DCMAKE_C_FLAGS=-Wall -Wextra -Werror",
            "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror",
        )
        run(CMAKE, "--build", cls.bin)
        cls.image = []
        for side in ("left", "right"):
            colour = cv2.imread(
                os.path.join(SOURCE, ".cache", "motorcycle", f"motorcycle_{side}.png")
            )
            if colour is None:
                print("skipped: the Motorcycle pair is not in .cache (scripts/bootstrap)")
                sys.exit(SKIP_CODE)
            cls.image.append(cls.folder / f"{side}.pgm")
            cv2.imwrite(str(cls.image[-1]), cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))
        cls.matches = cls.folder / "matches.txt"
        cls.matches.write_text(
            subprocess.run(
                [cls.bin / "04_match", *cls.image], capture_output=True, text=True, check=True
            ).stdout
        )

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def example(self, name, *arguments, **options):
        return run(self.bin / name, *arguments, **options)

    def test_calibrate(self):
        if not (self.bin / "01_calibrate").exists():
            self.skipTest("OpenCV is not installed")
        boards = []
        K = np.array([[500.0, 0, 319.5], [0, 500, 239.5], [0, 0, 1]])
        sheet = np.kron((np.indices((8, 9)).sum(0) % 2) * 225 + 15, np.ones((40, 40))).astype(
            np.uint8
        )
        sheet = cv2.copyMakeBorder(sheet, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=240)
        for k in range(8):
            tilt = np.array([0.35 * np.cos(k), 0.35 * np.sin(k), 0.1 * k])
            R = cv2.Rodrigues(tilt)[0]
            M = np.diag([1 / 40, 1 / 40, 1]) @ np.array([[1, 0, -220], [0, 1, -200], [0, 0, 1.0]])
            H = (
                K
                @ np.column_stack(
                    [R[:, 0], R[:, 1], [0.6 * np.sin(2 * k), 0.4 * np.cos(3 * k), 12]]
                )
                @ M
            )
            boards.append(self.folder / f"board{k}.png")
            cv2.imwrite(str(boards[-1]), cv2.warpPerspective(sheet, H, (640, 480), borderValue=128,
                                                             flags=cv2.INTER_AREA))
        text = self.example("01_calibrate", self.folder / "camera.yaml", 8, 7, *boards)
        self.assertAlmostEqual(number(r"fx ([\d.]+)", text), 500, delta=5)
        self.assertIn("camera_matrix", (self.folder / "camera.yaml").read_text())

    def test_undistort(self):
        out = self.folder / "undistorted.pgm"
        text = self.example(
            "02_undistort", self.image[0], out, 600, 600, 370, 250, -0.3, 0.1, 0, 0, 0
        )
        self.assertIn("good to", text)
        self.assertEqual(cv2.imread(str(out), 0).shape, cv2.imread(str(self.image[0]), 0).shape)

    def test_detect(self):
        out = self.folder / "corners.ppm"
        twelve = number(r": (\d+) corners", self.example("03_detect", self.image[0], out))
        nine = number(r": (\d+) corners", self.example("03_detect", self.image[0], out, 9))
        self.assertTrue(100 < twelve < nine)
        self.assertEqual(cv2.imread(str(out)).shape[2], 3)

    def test_match(self):
        rows = [line.split() for line in self.matches.read_text().splitlines()]
        self.assertGreater(len(rows), 400)
        # The pair is rectified, so both pixels of nearly all true matches lie in the same row.
        level = sum(abs(float(r[1]) - float(r[3])) < 2 for r in rows)
        self.assertGreater(level, 0.7 * len(rows))

    def test_fundamental(self):
        text = self.example("05_fundamental", self.matches)
        self.assertGreater(number(r": (\d+) of", text), 300)

    def test_epipolar(self):
        text = self.example("06_epipolar", self.matches, 741, 500)
        # The camera moved sideways, so both epipoles are outside their images.
        self.assertEqual(text.count("outside"), 2, text)
        self.assertEqual(text.count("-> line"), 5)

    def test_imu(self):
        level = ["1", "0", "0", "0"]
        text = self.example("07_imu", self.matches, *CAMERA[:3], CAMERA[4], *level, *level, "1")
        self.assertIn("(ok)", text)
        self.assertIn("of the estimated rotation", text)

    def test_triangulate(self):
        rows = [
            line.split()
            for line in self.example("08_triangulate", self.matches, *CAMERA).splitlines()[1:]
        ]
        self.assertEqual(len(rows), 7)
        for row in rows:
            self.assertGreater(int(row[1]), 300)
            self.assertLess(float(row[2]), 1)

    def test_reconstruct(self):
        out = self.folder / "cloud.ply"
        text = self.example("09_reconstruct", *self.image, out, *CAMERA)
        points = int(number(r", (\d+) points", text))
        self.assertGreater(points, 300)
        self.assertEqual(len(out.read_text().split("end_header\n")[1].splitlines()), points)

    def test_static_memory(self):
        text = self.example("10_static_memory")
        self.assertIn("none of the heap", text)
        self.assertAlmostEqual(number(r"t = \((-?[\d.]+)", text), -1, delta=0.02)
        symbols = run("nm", "--undefined-only", self.bin / "10_static_memory")
        self.assertNotRegex(symbols, r"\b(malloc|calloc|realloc)\b")

    def test_room(self):
        if not (self.bin / "17_room").exists():
            self.skipTest("built without the room")
        out = self.folder / "room.obj"
        text = self.example("17_room", out)
        self.assertIn("none of the heap", text)
        lines = [line.split() for line in out.read_text().splitlines()]
        vertices = np.array([line[1:] for line in lines if line[0] == "v"], float)
        self.assertEqual(sum(line[0] == "f" for line in lines), number(r"(\d+) triangles", text))
        wall, pillar = np.abs(vertices[:, 2] - 2) < 0.03, np.abs(vertices[:, 2] - 1.5) < 0.03
        self.assertGreater((wall | pillar).mean(), 0.85)
        self.assertGreater(pillar.mean(), 0.05)
        self.assertGreater(np.ptp(vertices[wall, 0]), 2)  # metres of wall
        symbols = run("nm", "--undefined-only", self.bin / "17_room")
        self.assertNotRegex(symbols, r"\b(malloc|calloc|realloc)\b")
        self.assertIn("usage", self.example("17_room", status=2))
        self.assertIn("cannot write", self.example("17_room", "/nowhere/room.obj", status=2))

    def flight(self, name):
        """40 pictures of a flight of 2 m past a wall of tiles with a nearer half."""
        if not (self.bin / name).exists():
            self.skipTest("built without odometry")
        random = np.random.default_rng(13)
        tiles = random.integers(0, 256, (2, 200, 400)).astype(np.uint8)
        far, near = tiles.repeat(8, axis=1).repeat(8, axis=2)
        for k in range(40):
            picture = far[:480, 16 * k : 16 * k + 640].copy()
            picture[280:] = near[280:480, 28 * k : 28 * k + 640]
            yield picture

    def test_odometry(self):
        frames = []
        for k, picture in enumerate(self.flight("13_odometry")):
            frames.append(self.folder / f"flight{k:02}.pgm")
            cv2.imwrite(str(frames[-1]), picture)
        text = self.example("13_odometry", 500, 500, 320, 240, *frames)
        self.assertGreater(number(r"(\d+) of 40 poses known", text), 20)
        self.assertIn("none of the heap", text)
        x, y, z = map(float, re.findall(r"at \((.*), (.*), (.*)\)", text)[-1])
        self.assertGreater(x, 10 * max(abs(y), abs(z)))
        symbols = run("nm", "--undefined-only", self.bin / "13_odometry")
        self.assertNotRegex(symbols, r"\b(malloc|calloc|realloc)\b")
        self.assertIn("usage", self.example("13_odometry", status=2))

    def test_frame_loop(self):
        # NV12 whose rows are padded, with frame 5 twice, frame 8 out of order, a clock that begins
        # anew at frame 20, and a lens cap before frames 30 to 32.
        stride, text = 704, ""
        pictures = list(self.flight("16_frame_loop"))
        order = [*range(6), 5, 6, 8, 7, *range(9, 40)]
        for k in 30, 31, 32:
            pictures[k] = np.full_like(pictures[k], 16)
        random = np.random.default_rng(16)
        frames, times = self.folder / "frames.nv12", self.folder / "times.txt"
        with frames.open("wb") as file:
            for k in order:
                whole = random.integers(0, 256, (720, stride)).astype(np.uint8)
                whole[:480, :640] = pictures[k]
                file.write(whole.tobytes())
                text += f"{(100 if k < 20 else -0.6) + k / 30:.6f}\n"
        times.write_text(text)
        camera = (500, 500, 320, 240, 640, 480)
        said = self.example("16_frame_loop", *camera, stride, frames, times)
        self.assertIn("39 frames, ", said)
        self.assertIn("2 frames left out", said)
        self.assertIn("0.067 s  the clock began anew after 100.633 s", said)
        rows = [line for line in said.splitlines() if re.match(r" *[\d.]+ s  (?!the)", line)]
        words = [row.split()[2] for row in rows]
        self.assertEqual(len(rows), 39)  # without 5 again, and 7
        self.assertTrue({"tracking", "weak"} & set(words[15:19]), words)
        self.assertIn(words[19], ("tracking", "weak"))
        self.assertEqual(set(words[29:32]), {"lost"})
        self.assertIn(words[-1], ("tracking", "weak"))
        # From a pipe, by the clock.
        with frames.open("rb") as pipe:
            done = subprocess.run([str(self.bin / "16_frame_loop"), *map(str, camera),
                                   str(stride), "-"], stdin=pipe, capture_output=True, text=True)
        self.assertIn("41 frames, ", done.stdout)
        self.assertIn("0 frames left out", done.stdout)
        # What the caller did wrong is named.
        for stride, words in ((639, "the image's stride does not fit its width"),
                              (0, "stride is out of its range"),
                              (-704, "stride is out of its range")):
            self.assertIn(words, self.example("16_frame_loop", *camera, stride, frames, status=2))
        self.assertIn("cut off", self.example("16_frame_loop", *camera, 700, frames, status=2))
        self.assertIn("no frame", self.example("16_frame_loop", *camera, 704, "/dev/null",
                                               status=2))
        times.write_text("1\n2\n")
        self.assertIn("TIMES ends", self.example("16_frame_loop", *camera, 704, frames, times,
                                                 status=2))
        symbols = run("nm", "--undefined-only", self.bin / "16_frame_loop")
        self.assertNotRegex(symbols, r"\b(malloc|calloc|realloc|fopen)\b")
        self.assertIn("usage", self.example("16_frame_loop", status=2))

    def against_the_simulator(self, name, *before, seconds=5, options=()):
        """What an example prints that receives a simulated drone for some seconds."""
        if not (self.bin / name).exists() or "drone" not in run(PROGRAM, "--help"):
            self.skipTest("built without the drivers")
        command = [PROGRAM, "drone", "simulate", "--duration", "30", *options]
        for channel in ("at", "navdata", "video", "control", "recording"):
            command += [f"--{channel}-port", "0"]
        drone = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            words = drone.stdout.readline().replace(",", "").split()
            ports = [
                words[words.index(name) + 1] for name in ("commands", "navdata", "video", "control")
            ]
            return self.example(name, *before, "127.0.0.1", seconds, *ports)
        finally:
            drone.kill()
            drone.communicate()

    def test_ardrone_against_the_simulator(self):
        text = self.against_the_simulator("11_ardrone")
        self.assertGreater(number(r"(\d+) pictures", text), 20)
        self.assertIn("heading", text)

    def test_drone_map_against_the_simulator(self):
        path = self.folder / "map.twm"
        text = self.against_the_simulator("14_drone_map", path, seconds=8,
                                          options=("--tour", "--fps", "10"))
        self.assertGreater(number(r"(\d+) pictures", text), 20)
        # The drone has taken off, and flies at 1.2 to 1.5 m: the map knows the metre.
        self.assertRegex(text, r"tracking at \(.*\) m, \d+ points")
        info = json.loads(run(PROGRAM, "map", "info", path, "--json"))
        self.assertGreater(info["num_points"], 300)
        self.assertGreater(info["num_keyframes"], 5)
        self.assertIn("usage", self.example("14_drone_map", status=2))

    def test_absolute_pose(self):
        if not (self.bin / "15_absolute_pose").exists():
            self.skipTest("built without odometry")
        random = np.random.default_rng(15)
        K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
        R = cv2.Rodrigues(np.array([0.2, -0.5, 0.1]))[0]
        t = np.array([0.3, -1, 2])
        pixels = random.uniform((0, 0), (640, 480), (300, 2))
        rays = np.column_stack([pixels, np.ones(300)]) @ np.linalg.inv(K).T
        points = (rays * random.uniform(2, 8, (300, 1)) - t) @ R
        pixels += 0.5 * random.normal(size=pixels.shape)
        pixels[200:] = random.uniform((0, 0), (640, 480), (100, 2))
        file = self.folder / "points.txt"
        np.savetxt(file, np.column_stack([pixels, points]))
        text = self.example("15_absolute_pose", file, 500, 500, 320, 240)
        self.assertIn("ok: ", text)
        self.assertEqual(number(r"wrong match is in line (\d+)", text), 201)
        found = re.search(r"stands at \((.*), (.*), (.*)\)", text).groups()
        np.testing.assert_allclose(np.array(found, float), -R.T @ t, atol=0.02)
        self.assertTrue(0 < number(r"sigma of the rotation: ([\d.]+)", text) < 0.2)
        np.savetxt(file, np.column_stack([random.permutation(pixels), points]))
        self.assertIn("refused", self.example("15_absolute_pose", file, 500, 500, 320, 240,
                                              status=3))
        self.assertIn("usage", self.example("15_absolute_pose", status=2))

    def test_each_builds_by_pkg_config_alone(self):
        if not shutil.which("pkg-config"):
            self.skipTest("no pkg-config")
        paths = [str(p.parent) for p in self.prefix.rglob("*.pc")]
        environment = dict(os.environ, PKG_CONFIG_PATH=":".join(sorted(set(paths))))
        for source in sorted(EXAMPLES.glob("*.c")):
            packages = ["twoview"]
            if source.stem in ("11_ardrone", "14_drone_map"):
                if not (self.bin / source.stem).exists():
                    continue
                packages += ["twoview_ardrone", "twoview_h264"]
            optional = ("13_odometry", "15_absolute_pose", "16_frame_loop", "17_room")
            if source.stem in optional and not (self.bin / source.stem).exists():
                continue
            flags = run("pkg-config", "--cflags", "--libs", *packages, env=environment).split()
            run(CC, "-std=c11", source, "-o", self.folder / "alone", *flags, "-lm")

    def test_wrong_arguments_are_told(self):
        for source in sorted(EXAMPLES.glob("0[2-9]*.c")):
            self.assertIn("usage", self.example(source.stem, status=2))
        self.assertIn(
            "cannot read", self.example("03_detect", "/nowhere.pgm", "/dev/null", status=2)
        )

    def test_each_has_a_row_in_the_readme_and_is_short(self):
        readme = (EXAMPLES / "README.md").read_text()
        for source in sorted(EXAMPLES.glob("[0-9]*")):
            self.assertIn(f"`{source.name}`", readme)
            self.assertLess(len(source.read_text().splitlines()), 100, source.name)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
