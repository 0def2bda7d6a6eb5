"""Checks `twoview rerun` and `reconstruct --rerun` by reading the file back: poses, pinholes,
pictures, points and colours are those of the result, and a recording's attitudes and heights those
of its files. Skipped without rerun-sdk, but for what a missing package gets."""

import json
import os
import re
import struct
import subprocess
import sys
import unittest

import cli_support as cli

try:
    import numpy as np
    import rerun  # noqa: F401
    from rerun.chunk import RrdReader
except ImportError:
    RrdReader = None

NEEDS_RERUN = unittest.skipIf(RrdReader is None, "no rerun-sdk: run scripts/bootstrap test")


# Of the cloud.ply of `odometry -o`, for two points.
MAP_HEADER = b"""ply
format binary_little_endian 1.0
element vertex 2
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property int num_observations
property float sigma
property int segment
end_header
"""


def read_back(path):
    """{(entity, component): its rows as lists} of a file."""
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in set(batch.schema.names) - {"rerun.controls.RowId", "log_time", "log_tick"}:
            found[chunk.entity_path, name] = batch.column(name).to_pylist()
    return found


def only(found, entity, component):
    """The value of a component that is logged once."""
    (row,) = found[entity, component]
    return row[0] if len(row) == 1 else row


class Rerun(cli.CliTest):
    def tool(self, *arguments, **environment):
        return subprocess.run(
            [cli.program(), "rerun", *map(str, arguments)], capture_output=True, timeout=120,
            env={**os.environ, "TWOVIEW_PYTHON": sys.executable, **environment})

    @NEEDS_RERUN
    def test_a_pair_reads_back(self):
        left, _ = cli.stereo_pair()
        self.a.write_bytes(cli.png(cli.WIDTH, cli.HEIGHT, [
            sample for value in left for sample in (value, value, value // 2)], channels=3))
        done = subprocess.run(
            [cli.program(), "reconstruct", self.a, self.b, "--camera", self.camera, "--rerun",
             self.folder / "a.rrd", "-o", self.out, "--quiet"],
            capture_output=True, timeout=120,
            env={**os.environ, "TWOVIEW_PYTHON": sys.executable})
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, b"", b""))
        result = json.loads((self.out / "result.json").read_text())
        found = read_back(self.folder / "a.rrd")
        R = np.array(result["R"]).reshape(3, 3)
        # Columns of world_from_cam1 = R^T one after another: the rows of R.
        self.assertTrue(np.allclose(only(found, "/world/camera1", "Transform3D:mat3x3"),
                                    R.ravel(), atol=1e-6))
        self.assertTrue(np.allclose(only(found, "/world/camera1", "Transform3D:translation"),
                                    -R.T @ result["t"], atol=1e-6))
        for view in range(2):
            entity = f"/world/camera{view}/image"
            self.assertEqual(only(found, entity, "Pinhole:resolution"),
                             [float(side) for side in result[f"image_size{view}"]])
            K = np.array(only(found, entity, "Pinhole:image_from_camera")).reshape(3, 3).T
            self.assertTrue(np.allclose(K, self.K(), atol=1e-3), K)
            self.assertGreater(len(only(found, entity, "EncodedImage:blob")), 1000)
        positions = np.array(found["/world/points", "Points3D:positions"][0])
        data = (self.out / "cloud.ply").read_bytes().split(b"end_header\n", 1)[1]
        rows = [struct.unpack_from("<3f3B2f", data, 23 * i) for i in range(len(data) // 23)]
        self.assertEqual(len(positions), result["num_points"])
        self.assertTrue(np.array_equal(positions, np.array([row[:3] for row in rows], np.float32)))
        colours = found["/world/points", "Points3D:colors"][0]
        self.assertEqual(colours, [(r << 24) | (g << 16) | (b << 8) | 255
                                   for _, _, _, r, g, b, _, _ in rows])
        self.assertIn(f"| verdict | {result['verdict']} |",
                      only(found, "/summary", "TextDocument:text"))

    def K(self):
        matrix = re.search(r"camera_matrix.*?\[(.*?)\]", self.camera.read_text(), re.S)[1]
        K = np.array([float(number) for number in matrix.split(",")]).reshape(3, 3)
        K[:2, 2] += 0.5  # Rerun's pixels begin at the corner of the first one
        return K

    @NEEDS_RERUN
    def test_the_lens_is_what_the_result_names(self):
        folder = self.folder / "pair"
        folder.mkdir()
        size = [cli.WIDTH // 2, cli.HEIGHT // 2]  # as after --resize
        half = self.K()
        half[:2] /= 2
        f = 30 * np.hypot(*size) / np.hypot(36, 24)
        film = np.array([[f, 0, size[0] / 2], [0, f, size[1] / 2], [0, 0, 1]])
        for more, K in (({"options": {"camera1": str(self.camera)}}, half),
                        ({"options": {"focal_35mm": 30}}, film),
                        ({"cameras": [{}, {"source": "exif", "focal_35mm": 30}]}, film),
                        ({"cameras": [{}, {"source": "file", "file": str(self.camera)}]}, half),
                        ({}, None)):
            (folder / "result.json").write_text(json.dumps(
                {"image_size0": size, "image_size1": size, "R": [1, 0, 0, 0, 1, 0, 0, 0, 1],
                 "t": [1, 0, 0], **more}))
            self.assertEqual(self.tool(folder, self.folder / "f.rrd").stderr, b"")
            found = read_back(self.folder / "f.rrd")
            key = "/world/camera1/image", "Pinhole:image_from_camera"
            if K is None:
                self.assertNotIn(key, found)
            else:
                drawn = np.array(only(found, *key)).reshape(3, 3).T
                self.assertTrue(np.allclose(drawn, K, atol=1e-3), (more, drawn, K))

    @NEEDS_RERUN
    def test_a_recording_reads_back(self):
        folder = self.folder / "flight"
        (folder / "frames").mkdir(parents=True)
        half = 0.5 ** 0.5
        (folder / "attitude.tum").write_text(
            "# time tx ty tz qx qy qz qw\n100.5 0 0 -1.25 0 0 0 1\n"
            f"101.0 0 0 -1.5 0 0 {half} {half}\n101.5 0 0 -2 {half} 0 0 {half}\n")
        (folder / "frames.txt").write_text("100600000000 5 7 1\n101200000000 6 8 0\n")
        for number in (7, 8):
            (folder / "frames" / f"{number:06d}.png").write_bytes(
                cli.png(8, 8, [number] * 64))
        (folder / "summary.json").write_text('{"frames_received": 2}')
        done = self.tool(folder, self.folder / "b.rrd")
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        self.assertEqual(done.stdout.decode(), f"files        {self.folder / 'b.rrd'}\n")
        found = read_back(self.folder / "b.rrd")
        self.assertEqual([row[0] for row in found["/height_m", "Scalars:scalars"]], [1.25, 1.5, 2])
        self.assertTrue(np.allclose(np.ravel(found["/yaw_deg", "Scalars:scalars"]), [0, 90, 0]))
        self.assertTrue(np.allclose(np.ravel(found["/roll_deg", "Scalars:scalars"]), [0, 0, 90]))
        seconds = [time.total_seconds() for time in found["/world/body", "time"]]
        self.assertEqual(seconds, [0, 0.5, 1])
        self.assertTrue(np.allclose(found["/world/body", "Transform3D:quaternion"][1][0],
                                    [0, 0, half, half]))
        times = [time.total_seconds() for time in found["/picture", "time"]]
        self.assertTrue(np.allclose(times, [0.1, 0.7], atol=1e-6), times)
        self.assertEqual(bytes(found["/picture", "EncodedImage:blob"][1][0]),
                         (folder / "frames" / "000008.png").read_bytes())
        self.assertIn("frames_received", only(found, "/summary", "TextDocument:text"))

    @NEEDS_RERUN
    def test_a_trajectory_reads_back(self):
        folder = self.folder / "odometry"
        folder.mkdir()
        (folder / "trajectory.txt").write_text(
            "# segment 0\n5 1 2 3 0 0 0 1\n6 4 5 6 0 0 0 1\n# segment 1\n7 0 0 9 0 0 0 1\n")
        (folder / "cloud.ply").write_bytes(MAP_HEADER + b"".join(
            struct.pack("<3f3Bifi", x, 2, 3, 10, 20, 30, 5, 0.1, 0) for x in (1, 4)))
        done = self.tool(folder, self.folder / "c.rrd")
        self.assertEqual((done.returncode, done.stderr), (0, b""))
        found = read_back(self.folder / "c.rrd")
        self.assertEqual(found["/world/camera", "Transform3D:translation"],
                         [[[1, 2, 3]], [[4, 5, 6]], [[0, 0, 9]]])
        self.assertEqual(found["/world/camera_path", "LineStrips3D:strips"],
                         [[[[1, 2, 3], [4, 5, 6]], [[0, 0, 9]]]])
        self.assertEqual(found["/world/points", "Points3D:positions"], [[[1, 2, 3], [4, 2, 3]]])
        self.assertEqual(found["/world/points", "Points3D:colors"], [[0x0A141EFF] * 2])

    @NEEDS_RERUN
    def test_a_file_that_cannot_be_is_refused_before_anything_is_computed(self):
        (self.folder / "folder.rrd").mkdir()
        before = self.a.read_bytes()
        for name, words in ((self.a, "does not end in .rrd"),
                            ("folder.rrd", "it is a folder"),
                            ("nowhere/a.rrd", "there is no folder nowhere")):
            done = subprocess.run(
                [cli.program(), "reconstruct", self.a, self.b, "--camera", self.camera,
                 f"--rerun={name}", "-o", self.out], cwd=self.folder, capture_output=True,
                timeout=120, env={**os.environ, "TWOVIEW_PYTHON": sys.executable})
            self.assert_refused(done, words)
        self.assertEqual(self.a.read_bytes(), before)
        (self.folder / "trajectory.txt").write_text("5 1 2 3 0 0 0 1\n")
        self.assert_refused(self.tool(self.folder, self.a), "does not end in .rrd")
        self.assertEqual(self.a.read_bytes(), before)
        for arguments in ((), ("--images", "a"), ("--nonsense",)):
            done = self.tool(*arguments)
            self.one_line(done, "see twoview rerun --help")
            self.assertEqual(done.returncode, 2)

    @NEEDS_RERUN
    def test_bad_input_is_one_line_and_leaves_no_file(self):
        folder = self.folder / "bad"
        self.assert_refused(self.tool(folder, self.folder / "d.rrd"), "no folder")
        folder.mkdir()
        self.assert_refused(self.tool(folder, self.folder / "d.rrd"), "result.json")
        (folder / "result.json").write_text("{")
        self.assert_refused(self.tool(folder, self.folder / "d.rrd"), "no JSON")
        (folder / "result.json").write_text(
            '{"image_size0": [8, 8], "image_size1": [8, 8], "R": null}')
        for data, words in ((b"ply\nend_header\n", "no points"),
                            (b"ply", "no PLY header"),
                            (MAP_HEADER, "fewer points than its header says"),
                            (MAP_HEADER.replace(b"red", b"rot"), "fewer points"),
                            (MAP_HEADER.replace(b"red", b"rot") + bytes(56), "no cloud of twoview"),
                            (MAP_HEADER.replace(b"uchar", b"half"),
                             "not read: 'property half red'")):
            (folder / "cloud.ply").write_bytes(data)
            self.assert_refused(self.tool(folder, self.folder / "d.rrd"), words)
        (folder / "trajectory.txt").write_text("1 2 3\n")
        self.assert_refused(self.tool(folder, self.folder / "d.rrd"), "trajectory.txt: line 1")
        self.assertEqual([path.name for path in self.folder.glob("*.rrd*")], [])

    def test_a_verb_without_the_option_names_the_verb_that_does_it(self):
        for words in (("odometry", self.folder), ("drone", "replay", self.folder)):
            done = subprocess.run([cli.program(), *words, "--rerun", "x.rrd", "-o", self.out],
                                  capture_output=True, timeout=120)
            if b"no option --rerun" not in done.stderr and words[0] == "drone":
                continue  # a program without the drone's driver
            self.assert_refused(done, "no option --rerun; twoview rerun DIR FILE.rrd does it "
                                f"afterwards (see twoview {' '.join(words[:-1])} --help)")

    @NEEDS_RERUN
    def test_a_recordings_pair_reads_back(self):
        ports = [word for channel in ("at", "navdata", "video", "control", "recording")
                 for word in (f"--{channel}-port", "0")]
        with subprocess.Popen([cli.program(), "drone", "simulate", "--duration", "60", *ports],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              text=True) as drone:
            words = drone.stdout.readline().replace(",", "").split()
            if not words:
                self.skipTest("no drone simulate in this program")
            port = {name: words[words.index(name) + 1]
                    for name in ("commands", "navdata", "video", "control")}
            subprocess.run(
                [cli.program(), "drone", "record", "--duration", "3", "-o", self.folder / "flight",
                 "--quiet", "--host", "127.0.0.1", "--at-port", port["commands"],
                 "--navdata-port", port["navdata"], "--video-port", port["video"],
                 "--control-port", port["control"]], check=True, timeout=60)
            drone.terminate()
        file = self.folder / "pair.rrd"
        done = subprocess.run(
            [cli.program(), "reconstruct", "--recording", self.folder / "flight", "--frames", "0",
             "3", "--focal-35mm", "30", "--rerun", file, "-o", self.out, "--quiet"],
            capture_output=True, timeout=120,
            env={**os.environ, "TWOVIEW_PYTHON": sys.executable})
        self.assertIn(done.returncode, (0, 3), done.stderr)  # the drone stands still
        found = read_back(file)
        self.assertIn(f"| verdict | {self.result()['verdict']} |",
                      only(found, "/summary", "TextDocument:text"))

    def test_a_missing_package_is_one_line_before_anything_is_written(self):
        (self.folder / "empty" / "rerun").mkdir(parents=True)
        (self.folder / "empty" / "rerun" / "__init__.py").write_text(
            "raise ImportError('not here')\n")
        environment = {**os.environ, "TWOVIEW_PYTHON": sys.executable,
                       "PYTHONPATH": str(self.folder / "empty")}
        done = subprocess.run(
            [cli.program(), "reconstruct", self.a, self.b, "--camera", self.camera, "--rerun",
             self.folder / "e.rrd", "-o", self.out], env=environment,
            capture_output=True, timeout=120)
        self.assert_refused(done, "rerun-sdk")


if __name__ == "__main__":
    cli.main()
