#!/usr/bin/env python3
"""Tests of camera files of every format: each gives the same camera as OpenCV's own file."""
import json
import unittest

import cli_support as cli
from cli_support import HEIGHT, WIDTH, camera_yaml

FX, FY, CX, CY = 301.5, 299.25, 158.5, 121.25
RADTAN = (-0.21, 0.05, 0.001, -0.002)
FISHEYE = (0.02, -0.01, 0.003, -0.001)


def opencv(k, model=""):
    return camera_yaml(fx=FX, fy=FY, cx=CX, cy=CY, k=k) + model


def kalibr(entries="cam0", model="radtan", k=RADTAN, camera_model="pinhole"):
    return "".join(
        f"{name}:\n  cam_overlaps: []\n  camera_model: {camera_model}\n"
        f"  distortion_coeffs: {list(k)}\n  distortion_model: {model}\n"
        f"  intrinsics: [{FX}, {FY}, {CX}, {CY}]\n  resolution: [{WIDTH}, {HEIGHT}]\n"
        f"  rostopic: /{name}/image_raw\n" for name in entries.split())


# EuRoC's sensor.yaml, with its T_BS.
EUROC = f"""#Default imu sensor yaml file
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [{WIDTH}, {HEIGHT}]
camera_model: pinhole
intrinsics: [{FX}, {FY}, {CX}, {CY}] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: {list(RADTAN)}
"""
ROS_MESSAGE = f"""header: {{seq: 0, frame_id: camera}}
height: {HEIGHT}
width: {WIDTH}
distortion_model: plumb_bob
D: {list(RADTAN) + [0.0]}
K: [{FX}, 0.0, {CX}, 0.0, {FY}, {CY}, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [{FX}, 0.0, {CX}, 0.0, 0.0, {FY}, {CY}, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
SET = "".join(
    f"{name}: {{fx: {fx}, fy: {FY}, cx: {CX}, cy: {CY}, image_width: {WIDTH}, "
    f"image_height: {HEIGHT}, k1: {RADTAN[0]}, k2: {RADTAN[1]}, p1: {RADTAN[2]}, "
    f"p2: {RADTAN[3]}}}\n" for name, fx in (("a", FX), ("left", 400)))


def colmap(*lines):
    return "# Camera list with one line of data per camera:\n" + "".join(f"{x}\n" for x in lines)


def colmap_opencv(number=1, model="OPENCV", k=RADTAN):
    lens = " ".join(map(str, k))
    return f"{number} {model} {WIDTH} {HEIGHT} {FX} {FY} {CX + 0.5} {CY + 0.5} {lens}"


class CameraFiles(cli.CliTest):
    def undistorted(self, camera, *more, status=0):
        """What undistort makes of image a with this camera: the file, and the new camera."""
        out = self.folder / "u"
        done = self.run_program("undistort", self.a, "--camera", camera, "-o", out, "--json", *more)
        self.succeed(done, status)
        K = json.loads(done.stdout)["camera_matrix"]
        return (out / "a.png").read_bytes(), K

    def assert_same(self, text, k, model="", name="cam"):
        given = self.write("given", text)
        pixels, K = self.undistorted(f"{given}{name.removeprefix('cam')}")
        expected = self.undistorted(self.write("opencv.yaml", opencv(k, model)))
        self.assertEqual(K, expected[1])
        self.assertTrue(pixels == expected[0], "the lens is another one")
        straight, _ = self.undistorted(self.write("opencv.yaml", opencv((0, 0, 0, 0))))
        self.assertFalse(pixels == straight, "no lens at all")

    def test_each_format_gives_the_camera_of_opencvs_own_file(self):
        fisheye = "distortion_model: equidistant\n"
        for case, text, k, model in (
                ("Kalibr", kalibr(), RADTAN, ""),
                ("Kalibr, equidistant", kalibr(model="equidistant", k=FISHEYE), FISHEYE, fisheye),
                ("EuRoC", EUROC, RADTAN, ""),
                ("ROS's message", ROS_MESSAGE, RADTAN, ""),
                ("ROS 2's message", ROS_MESSAGE.replace("D:", "d:").replace("K:", "k:"), RADTAN,
                 ""),
                ("cameras.yaml", SET.split("\n")[0], RADTAN, ""),
                ("COLMAP", colmap(colmap_opencv()), RADTAN, ""),
                ("COLMAP, fisheye", colmap(colmap_opencv(1, "OPENCV_FISHEYE", FISHEYE)), FISHEYE,
                 fisheye)):
            with self.subTest(case=case):
                self.assert_same(text, k, model)

    def test_colmaps_models_with_one_focal_length(self):
        for line, k in ((f"3 SIMPLE_RADIAL {WIDTH} {HEIGHT} 300 160 120 -0.1", (-0.1, 0, 0, 0)),
                        (f"3 RADIAL {WIDTH} {HEIGHT} 300 160 120 -0.1 0.02", (-0.1, 0.02, 0, 0))):
            with self.subTest(line=line):
                expected = self.undistorted(
                    self.write("e.yaml", camera_yaml(fx=300, fy=300, cx=159.5, cy=119.5, k=k)))
                self.assertEqual(self.undistorted(self.write("c.txt", colmap(line))), expected)

    def test_of_several_cameras_the_images_name_or_the_users_chooses(self):
        self.assert_same(SET, RADTAN)  # the entry a begins the name a.png
        self.assert_same(kalibr("cam0 cam1"), RADTAN, name="cam:cam1")
        self.assert_same(colmap(colmap_opencv(7), colmap_opencv(9)), RADTAN, name="cam:9")
        two = self.write("chain.yaml", kalibr("cam0 cam1"))
        done = self.run_program("undistort", self.a, "--camera", two, "-o", self.out)
        self.assert_refused(done, "2 cameras (cam0, cam1)", "chain.yaml:cam0")
        done = self.run_program("undistort", self.a, "--camera", f"{two}:cam2", "-o", self.out)
        self.assert_refused(done, "no camera 'cam2' but cam0, cam1")

    def test_the_ids_of_colmaps_cameras_say_nothing_of_files_names(self):
        image = self.write("1.png", self.a.read_bytes())
        cameras = self.write("c.txt", colmap(colmap_opencv(1), colmap_opencv(2)))
        done = self.run_program("undistort", image, "--camera", cameras, "-o", self.out)
        self.assert_refused(done, "2 cameras (1, 2)")

    def test_fourteen_coefficients_are_read_where_the_others_are_zero(self):
        eight = (*RADTAN, 0.01, 0.002, -0.003, 0.004)
        for zeros in (4, 6):
            with self.subTest(count=8 + zeros):
                self.assert_same(opencv((*eight, *[0] * zeros)), eight)
        for place, count in ((8, 12), (13, 14)):
            k = [*eight, *[0] * (count - 8)]
            k[place] = 1e-3
            with self.subTest(place=place):
                done = self.run_program("undistort", self.a, "--camera",
                                        self.write("t.yaml", opencv(k)), "-o", self.out)
                self.assert_refused(done, f"distortion_coefficients[{place}] is not 0", "first 8")

    def test_errors_name_the_field_and_the_formats_known(self):
        for case, text, *words in (
                ("nothing known", "width: 3\n", "camera_matrix is missing", "Kalibr", "COLMAP",
                 "cameras.yaml", "ROS"),
                ("no map", "hello\n", "no YAML map", "Kalibr"),
                ("Kalibr's lens", kalibr(model="fov"), "cam0", "distortion_model 'fov'", "radtan"),
                ("Kalibr's model", kalibr(camera_model="omni"), "camera_model 'omni'", "pinhole"),
                ("Kalibr's count", kalibr(k=(1, 2)), "distortion_coeffs has 2 numbers, not 4"),
                ("no resolution", kalibr().replace("resolution", "size"), "resolution is missing"),
                ("COLMAP's model", colmap(f"1 FOV {WIDTH} {HEIGHT} 1 2 3 4 5"), "line 2", "FOV",
                 "OPENCV_FISHEYE"),
                ("COLMAP's count", colmap(f"1 PINHOLE {WIDTH} {HEIGHT} 1 2 3"), "line 2",
                 "PINHOLE has 4 parameters, not 3"),
                ("COLMAP's number", colmap(f"1 PINHOLE {WIDTH} {HEIGHT} 1 2 3 nan"), "'nan'"),
                ("COLMAP's focal", colmap(f"1 PINHOLE {WIDTH} {HEIGHT} 0 2 3 4"), "fx is 0"),
                ("K", ROS_MESSAGE.replace(f"K: [{FX}", "K: [0.0"), "fx (K[0]) is 0")):
            with self.subTest(case=case):
                done = self.run_program("undistort", self.a, "--camera",
                                        self.write("bad", text), "-o", self.out)
                self.assert_refused(done, "bad", *words)

    def test_opencvs_xml_and_json_are_read(self):
        matrix = [FX, 0, CX, 0, FY, CY, 0, 0, 1]
        entries = "".join(
            f'<{name} type_id="opencv-matrix"><rows>{rows}</rows><cols>{len(values) // rows}'
            f"</cols><dt>d</dt><data>{' '.join(map(str, values))}</data></{name}>"
            for name, rows, values in (("camera_matrix", 3, matrix),
                                       ("distortion_coefficients", 4, RADTAN)))
        self.assert_same('<?xml version="1.0"?>\n<opencv_storage>\n'
                         f"<image_width>{WIDTH}</image_width><image_height>{HEIGHT}</image_height>"
                         f"{entries}\n</opencv_storage>\n", RADTAN)
        self.assert_same(json.dumps({
            "image_width": WIDTH, "image_height": HEIGHT,
            "camera_matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
                              "data": matrix},
            "distortion_coefficients": {"type_id": "opencv-matrix", "rows": 1, "cols": 4, "dt": "d",
                                        "data": RADTAN}}, indent=4), RADTAN)

    def test_a_lens_of_another_spelling_is_not_dropped(self):
        for name in ("dist_coeffs", "distCoeffs", "dist_coefs", "distortion"):
            with self.subTest(name=name):
                self.assert_same(opencv(RADTAN).replace("distortion_coefficients", name), RADTAN)

    def test_opencvs_calibration_sample_says_that_a_lens_is_a_fisheye(self):
        self.assert_same(opencv(FISHEYE) + "fisheye_model: 1\nflags: 10\n", FISHEYE,
                         "distortion_model: equidistant\n")

    def test_entries_that_are_not_understood(self):
        for entry in ("lens_shading: 1", "xi: 0.9", "crop: [1, 2]"):
            with self.subTest(entry=entry):
                camera = self.write("c.yaml", opencv(RADTAN) + entry + "\n")
                done = self.run_program("undistort", self.a, "--camera", camera, "-o", self.out)
                self.assert_refused(done, "c.yaml", entry.split(":")[0], "may concern the lens")
        camera = self.write("c.yaml", camera_yaml() + "weather: fine\nboard_width: 9\n")
        for verb in ("undistort", "reconstruct"):
            with self.subTest(verb=verb):
                images = [self.a] if verb == "undistort" else [self.a, self.b]
                done = self.run_program(verb, *images, "--camera", camera, "-o", self.folder / verb)
                self.succeed(done)
                self.assertIn(b"left out: weather", done.stdout)
                self.assertNotIn(b"board_width", done.stdout)

    def test_four_coefficients_without_a_model_are_named(self):
        lens = (camera_yaml().partition("distortion_coefficients")[0]
                + "dist_coeffs: [[0.1], [0.02], [-0.003], [0.001]]\n")
        for more, is_named in (("", True), ("distortion_model: plumb_bob\n", False)):
            camera = self.write("c.yaml", lens + more)
            done = self.run_program("undistort", self.a, "--camera", camera, "-o", self.out)
            self.succeed(done)
            self.assertEqual(b"dist_coeffs as a fisheye's k1 k2 k3 k4" in done.stdout, is_named)

    def test_a_camera_of_another_size_is_scaled_where_the_user_says_so(self):
        large = self.write("large.yaml", camera_yaml(
            width=2 * WIDTH, height=2 * HEIGHT, fx=2 * cli.FOCAL, fy=2 * cli.FOCAL,
            cx=WIDTH - 0.5, cy=HEIGHT - 0.5))
        wide = self.write("wide.yaml", camera_yaml(width=2 * WIDTH, height=HEIGHT))
        pairs = self.write("pairs.txt", "a.png b.png\n")
        (self.folder / "frames").mkdir()
        for i in range(3):
            (self.folder / "frames" / f"{i}.png").write_bytes(self.a.read_bytes())
        frames = self.folder / "frames"
        for verb, *arguments in (
                ("reconstruct", self.a, self.b), ("undistort", self.a),
                ("evaluate", pairs, "--images", self.folder), ("odometry", frames, "--fps", "10")):
            with self.subTest(verb=verb):
                out = self.folder / f"out_{verb}"
                run = lambda *more: self.run_program(verb, *arguments, *more, "-o", out)
                self.assert_refused(run("--camera", large), f"{WIDTH}x{HEIGHT}",
                                    f"{2 * WIDTH}x{2 * HEIGHT}", "--scale-camera", out=out)
                self.assert_refused(run("--camera", wide, "--scale-camera"), "does not help",
                                    out=out)
                if verb == "odometry":
                    self.assert_refused(run("--scale-camera"), "--scale-camera is for --camera",
                                        "cameras.yaml", out=out)
                done = run("--camera", large, "--scale-camera")
                self.assertNotEqual(done.returncode, 2, done.stderr)
                if verb == "reconstruct":
                    found = json.loads((out / "result.json").read_text())
                    self.succeed(self.reconstruct())
                    for key in ("R", "t", "num_inliers"):
                        self.assertEqual(found[key], self.result()[key])
                    self.assertIn(b"is scaled from", done.stdout)
                if verb == "undistort":
                    camera = (out / "camera.yaml").read_text()
                    self.assertIn(f"data: [ {cli.FOCAL:g}, 0, {(WIDTH - 1) / 2}, ", camera)

    def test_every_verb_takes_them(self):
        chain = self.write("chain.yaml", kalibr("a b", "none", ()))
        self.succeed(self.reconstruct("--camera", chain, camera=False))
        self.assertEqual(self.result()["cameras"][1]["source"], "file")
        matches = self.write("m.txt", "160 120 130 120\n")
        done = self.run_program("triangulate", matches, "--camera0", f"{chain}:a", "--camera1",
                                f"{chain}:b", "--pose", self.out / "result.json", "-o",
                                self.folder / "t")
        self.succeed(done)

    def test_a_camera_on_a_pipe_is_read_once(self):
        done = self.reconstruct("--camera", "/dev/stdin", camera=False,
                                input=self.camera.read_bytes())
        self.succeed(done)


if __name__ == "__main__":
    cli.main()
