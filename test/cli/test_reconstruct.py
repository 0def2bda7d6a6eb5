#!/usr/bin/env python3
"""Tests of twoview reconstruct: from two images to its output files."""
import json
import math
import os
import re
import shutil
import struct
import tempfile
import unittest
from pathlib import Path

import cli_support as cli
from cli_support import FOCAL, HEIGHT, WIDTH

RESULT_KEYS = (
    """image0 image1 num_keypoints num_matches num_matches_left_out num_inliers config verdict
  reasons effort R t E F H
alternative evidence covariance noise_px principal_point_shift_px principal_point num_points
median_parallax_deg rms_reprojection_px scale
num_dense_points dense_sigma_median_percent dense_pose_sigma_median_percent
scale_sigma imu truth timings_ms context_bytes options seed version kernels""".split()
)
STAGES = "pyramid detect describe match estimate refine triangulate total".split()
OPTIONS = """max_keypoints arc threshold levels scale_factor orientation descriptor ratio method
max_error_px confidence max_iterations fixed_iterations seed kernels triangulation guided_matching
align_matches bundle_adjustment sigma_by_size effort principal_point_sigma
camera0 camera1 focal_35mm resize""".split()
TRUTH = "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nt: [-1, 0, 0]\nbaseline: 0.5\ndepth0: depth.pfm\n"


def read_ply(path):
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode()
    properties = re.findall(r"^property (\w+) (\w+)$", header, re.M)
    count = int(re.search(r"^element vertex (\d+)$", header, re.M).group(1))
    layout = "<fffBBBffff" if ("float", "sigma") in properties else "<fffBBBff"
    points = list(struct.iter_unpack(layout, data[end:]))
    return header, properties, count, points


class Reconstruct(cli.CliTest):
    plain_run = None

    def plain(self):
        """The run of the default pair without an option, which many tests look at: the program runs
        once, and each test gets a copy of the output folder."""
        if Reconstruct.plain_run is None:
            kept = tempfile.TemporaryDirectory(prefix="twoview_cli_plain_")
            out = Path(kept.name) / "out"
            Reconstruct.plain_run = (kept, out, self.reconstruct(out=out))
        _, out, done = Reconstruct.plain_run
        shutil.copytree(out, self.out)
        return done

    def test_a_pair_that_is_ok_is_left_at_rung_0(self):
        self.succeed(self.plain())
        result = self.result()
        self.assertEqual((result["verdict"], result["effort"]), ("ok", 0))
        self.assertEqual(len(result["timings_ms"]["rungs"]), 1)
        self.assertEqual(result["options"]["effort"], "auto")

    def test_effort_runs_the_rung_that_it_names(self):
        for name, rung in (("fixed", 0), ("0", 0), ("1", 1), ("2", 2), ("3", 3)):
            self.succeed(self.reconstruct("--effort", name))
            result = self.result()
            self.assertEqual(result["effort"], rung)
            self.assertEqual(len(result["timings_ms"]["rungs"]), 1)
            self.assertGreater(result["timings_ms"]["rungs"][0], 0)
            self.assertEqual(max(result["num_keypoints"]) > 2048, rung > 0)

    def test_effort_is_advised_where_it_was_held_back(self):
        """The second picture is of another texture: nothing matches."""
        other = self.write("other.png", cli.png(WIDTH, HEIGHT, cli.stereo_pair(seed=8)[1]))
        for name, advised in (("fixed", True), ("2", True), ("auto", False), ("3", False)):
            done = self.run_program("reconstruct", self.a, other, "--camera", self.camera, "-o",
                                    self.out, "--effort", name)
            self.assertEqual(done.returncode, 3, done.stderr)
            advice = json.loads((self.out / "result.json").read_text())["advice"]
            self.assertEqual(any("--effort auto" in line for line in advice), advised)

    def test_an_unknown_effort_is_refused(self):
        for name in ("4", "-1", "max", ""):
            done = self.reconstruct("--effort", name)
            self.assertEqual(done.returncode, 2)
            self.assertIn(b"--effort", done.stderr)

    def test_a_sideways_flight_gives_a_full_pose_and_every_file(self):
        done = self.succeed(self.plain())
        self.assertEqual(done.stderr, b"")
        self.assertEqual(self.listing(), cli.RESULT_FILES)
        result = self.result()
        for key in RESULT_KEYS:
            self.assertIn(key, result)
        for key in STAGES:
            self.assertGreaterEqual(result["timings_ms"][key], 0)
        self.assertEqual((result["image0"], result["image1"]), ("a.png", "b.png"))
        self.assertEqual(result["config"], "calibrated")
        self.assertEqual(result["scale"], "unit")
        self.assertIsNone(result["truth"])
        self.assertEqual(len(result["covariance"]), 25)
        self.assertTrue(0 < result["noise_px"] < 1)
        self.assertIsNone(result["alternative"])
        self.assertAlmostEqual(result["t"][0], -1, delta=1e-3)
        self.assertAlmostEqual(math.hypot(*result["t"]), 1, delta=1e-12)
        self.assertAlmostEqual(math.hypot(*result["E"]), 1, delta=1e-9)
        self.assertEqual(set(result["evidence"]),
                         {"essential", "fundamental", "homography", "rotation", "coverage"})

    def test_a_plane_flown_at_has_a_second_pose_with_its_covariance(self):
        # The wall fills the image. Two motions explain the pair: towards this wall and sideways, or
        # straight towards a tilted wall.
        rows = cli.texture(WIDTH, HEIGHT)
        xs = [
            min(max(round(WIDTH / 2 + (x - WIDTH / 2) / 1.1 + 12), 0), WIDTH - 1)
            for x in range(WIDTH)
        ]
        ys = [round(HEIGHT / 2 + (y - HEIGHT / 2) / 1.1) for y in range(HEIGHT)]
        a = self.write("wall0.png", cli.png(WIDTH, HEIGHT, b"".join(map(bytes, rows))))
        nearer = b"".join(bytes(rows[y][x] for x in xs) for y in ys)
        b = self.write("wall1.png", cli.png(WIDTH, HEIGHT, nearer))
        done = self.succeed(self.reconstruct(a=a, b=b))
        result = self.result()
        self.assertEqual(result["config"], "planar")
        self.assertIn("two_planar_solutions", result["reasons"])
        self.assertEqual(set(result["alternative"]), {"R", "t", "covariance"})
        self.assertEqual(len(result["alternative"]["covariance"]), 25)
        self.assertNotEqual(result["alternative"]["covariance"], result["covariance"])
        # What to do about each reason is in the file, in the summary and in the report.
        self.assertEqual(len(result["advice"]), len(result["reasons"]))
        self.assertIn("show something off the plane, or give the direction of gravity",
                      result["advice"])
        page = (self.out / "report.html").read_text()
        for advice in result["advice"]:
            self.assertRegex(done.stdout.decode(), rf"(?m)^advice +{re.escape(advice)}$")
            self.assertIn(f"<li>{advice}</li>", page)

    def test_E_is_t_cross_R_with_its_sign(self):
        self.succeed(self.plain())
        result = self.result()
        R, t = result["R"], result["t"]
        skew = [0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0]
        E = [
            sum(skew[3 * i + k] * R[3 * k + j] for k in range(3))
            for i in range(3)
            for j in range(3)
        ]
        for ours, expected in zip(result["E"], E):
            self.assertAlmostEqual(ours, expected / math.sqrt(2), delta=1e-9)

    def test_errors_against_the_truth_are_told(self):
        self.write("depth.pfm", cli.pfm(WIDTH, HEIGHT, lambda x, y: 0.5 * cli.true_depth(x, y)))
        truth = self.write("truth.yaml", TRUTH)
        done = self.succeed(self.reconstruct("--truth", truth))
        errors = self.result()["truth"]
        self.assertLess(errors["rotation_error_deg"], 0.1)
        self.assertLess(errors["translation_error_deg"], 0.5)
        self.assertLess(errors["depth_error_median_percent"], 1)
        self.assertGreaterEqual(
            errors["depth_error_p95_percent"], errors["depth_error_median_percent"]
        )
        self.assertIn("truth", done.stdout.decode())
        # A truth whose numbers are a rotation to 8e-3 is made one.
        self.write("truth.yaml", TRUTH.replace("R: [1, 0, 0, 0, 1", "R: [1.008, 0, 0, 0, 0.995"))
        self.succeed(self.reconstruct("--truth", truth))
        self.assertAlmostEqual(self.result()["truth"]["rotation_error_deg"],
                               errors["rotation_error_deg"], delta=1e-6)

    def test_a_dense_cloud_is_dense_and_right(self):
        self.write("depth.pfm", cli.pfm(WIDTH, HEIGHT, lambda x, y: 0.5 * cli.true_depth(x, y)))
        truth = self.write("truth.yaml", TRUTH)
        done = self.reconstruct("--truth", truth, "--dense", "4000")
        if b"--dense" in done.stderr:
            self.skipTest("the program was built without TWOVIEW_DENSE")
        self.succeed(done)
        self.assertIn("dense ", done.stdout.decode())
        result = self.result()
        self.assertEqual(result["options"]["dense"], 4000)
        self.assertTrue(2000 < result["num_dense_points"] <= 4000)
        self.assertTrue(0 < result["dense_sigma_median_percent"] < 3)
        self.assertGreater(result["timings_ms"]["dense"], 0)
        errors = result["truth"]
        self.assertGreater(errors["num_dense_depths"], 1500)
        self.assertLess(errors["dense_depth_error_median_percent"], 1)
        _, properties, count, points = read_ply(self.out / "cloud.ply")
        self.assertEqual(properties[-2:], [("float", "sigma"), ("float", "sigma_pose")])
        self.assertTrue(0 < result["dense_pose_sigma_median_percent"] < 3)
        self.assertEqual(count, result["num_points"] + result["num_dense_points"])
        self.assertEqual(len(points), count)
        within = 0
        for x, y, z, red, green, blue, angle, error, sigma, sigma_pose in points:
            self.assertTrue(sigma > 0 and sigma_pose > 0 and error >= 0 and 0 < angle < 30)
            self.assertLess(sigma, 0.2 * z)
            self.assertEqual((green, blue), (red, red))  # of a grey image
            row = round(FOCAL * y / z + (HEIGHT - 1) / 2)
            known = cli.true_depth(0, min(max(row, 0), HEIGHT - 1))
            within += abs(z - known) < 4 * sigma + 0.01 * z
        self.assertGreater(within, 0.95 * count)

    def test_a_dense_cloud_needs_a_pose_and_a_sensible_number(self):
        for wrong in ("-1", "nan", "many", "4000001", ""):
            self.one_line(self.succeed(self.reconstruct("--dense", wrong), 2), "--dense")
        if b"--dense" in self.reconstruct("--dense", "0").stderr:
            self.skipTest("the program was built without TWOVIEW_DENSE")
        self.succeed(self.reconstruct("--dense", "0"))
        self.assertIsNone(self.result()["num_dense_points"])

    def test_unknown_depths_are_left_out(self):
        self.write(
            "depth.pfm", cli.pfm(WIDTH, HEIGHT, lambda x, y: (0, -1, math.inf, math.nan)[x % 4])
        )
        self.succeed(self.reconstruct("--truth", self.write("truth.yaml", TRUTH)))
        self.assertIsNone(self.result()["truth"]["depth_error_median_percent"])
        self.assertIsNotNone(self.result()["truth"]["rotation_error_deg"])

    def test_a_translation_told_backwards_has_no_sign_free_error(self):
        self.succeed(
            self.reconstruct(
                "--truth",
                self.write(
                    "truth.yaml", TRUTH.replace("-1", "1").replace("depth0: depth.pfm\n", "")
                ),
            )
        )
        errors = self.result()["truth"]
        self.assertLess(errors["translation_error_deg"], 0.5)
        self.assertGreater(errors["translation_error_signed_deg"], 179)
        self.assertIn("if it is cam0_from_cam1, the other direction", self.result()["notes"][0])

    def test_the_cloud_has_the_depths_and_the_colours_of_image_0(self):
        left, right = cli.stereo_pair()
        colour = [c for v in left for c in (v, v // 2, 255 - v)]
        a = self.write("colour.png", cli.png(WIDTH, HEIGHT, colour, channels=3))
        other = [c for v in right for c in (v, v // 2, 255 - v)]
        b = self.write("colour1.png", cli.png(WIDTH, HEIGHT, other, channels=3))
        # The shifts are whole pixels of level 0; coarser levels average over other pixels.
        self.succeed(self.reconstruct("--levels", "1", a=a, b=b))
        header, properties, count, points = read_ply(self.out / "cloud.ply")
        self.assertTrue(header.startswith("ply\nformat binary_little_endian 1.0\n"))
        self.assertEqual(
            properties,
            [
                ("float", "x"),
                ("float", "y"),
                ("float", "z"),
                ("uchar", "red"),
                ("uchar", "green"),
                ("uchar", "blue"),
                ("float", "angle_deg"),
                ("float", "error_px"),
            ],
        )
        self.assertEqual(len(points), count)
        self.assertEqual(count, self.result()["num_points"])
        near = 0
        for x, y, z, red, green, blue, angle, error in points:
            row = round(FOCAL * y / z + (HEIGHT - 1) / 2)
            near += abs(z / cli.true_depth(0, min(max(row, 0), HEIGHT - 1)) - 1) < 0.03
            self.assertEqual((green, blue), (red // 2, 255 - red))
            self.assertTrue(0 < angle < 10 and 0 <= error < 5)
        self.assertGreater(near, 0.9 * count)

    def test_json_prints_the_result_alone(self):
        done = self.succeed(self.reconstruct("--json"))
        self.assertEqual(done.stderr, b"")
        self.assertEqual(json.loads(done.stdout), self.result())

    def test_quiet_prints_nothing(self):
        done = self.succeed(self.reconstruct("--quiet"))
        self.assertEqual((done.stdout, done.stderr), (b"", b""))

    def test_the_summary_is_a_dozen_lines_without_colour_codes(self):
        text = self.succeed(self.plain()).stdout.decode()
        self.assertTrue(8 <= text.count("\n") <= 14, text)
        self.assertNotIn("advice", text)
        self.assertNotIn("\033", text)

    def test_equal_runs_give_equal_bytes(self):
        self.succeed(self.reconstruct())
        first = {name: (self.out / name).read_bytes() for name in self.listing()}
        self.succeed(self.reconstruct())
        for name in ("cloud.ply", "matches.png", "epipolar.png", "views.png"):
            self.assertEqual((self.out / name).read_bytes(), first[name], name)
        before, after = json.loads(first["result.json"]), self.result()
        del before["timings_ms"], after["timings_ms"]
        self.assertEqual(before, after)

    def test_swapped_images_give_the_inverse(self):
        self.succeed(self.plain())
        self.succeed(self.reconstruct(a=self.b, b=self.a, out=self.folder / "swapped"))
        one, two = self.result(), self.result(self.folder / "swapped")
        transposed = [one["R"][3 * j + i] for i in range(3) for j in range(3)]
        self.assertEqual(two["R"], transposed)
        for i in range(3):
            inverse = -sum(transposed[3 * i + k] * one["t"][k] for k in range(3))
            self.assertAlmostEqual(two["t"][i], inverse, delta=1e-12)

    def test_every_option_is_obeyed_and_echoed(self):
        self.succeed(self.plain())
        for key in OPTIONS:
            self.assertIn(key, self.result()["options"])
        chosen = {
            "max_keypoints": 300,
            "arc": 9,
            "threshold": 15,
            "levels": 2,
            "scale_factor": 1.5,
            "orientation": "upright",
            "descriptor": "sift",
            "ratio": 0.75,
            "method": "eight-point",
            "max_error_px": 1.5,
            "confidence": 0.99,
            "max_iterations": 500,
            "seed": 2**64 - 1,
            "kernels": "c",
            "triangulation": "midpoint",
            "guided_matching": 1,
            "align_matches": 0,
            "bundle_adjustment": 1,
            "sigma_by_size": 0.75,
            "principal_point_sigma": 0.02,
            "resize": 300,
        }
        flags = [f"--{key.replace('_', '-')}={value}" for key, value in chosen.items()]
        self.succeed(self.reconstruct(*flags))
        result = self.result()
        for key, value in chosen.items():
            self.assertEqual(result["options"][key], value, key)
        self.assertEqual(result["seed"], 2**64 - 1)
        self.assertEqual(result["kernels"], "c")
        self.assertLessEqual(max(result["num_keypoints"]), 300)
        self.assertEqual(result["image_size0"], [300, 225])

    def test_sigmas_by_size_change_the_pose_of_several_levels_only(self):
        noise = {}
        for levels in ("1", "3"):
            for power in ("0", "1"):
                self.succeed(self.reconstruct("--levels", levels, "--sigma-by-size", power,
                                              "--align-matches", "0"))
                noise[levels, power] = self.result()["noise_px"]
        self.assertEqual(noise["1", "0"], noise["1", "1"])
        self.assertNotEqual(noise["3", "0"], noise["3", "1"])

    def test_matches_are_aligned_unless_they_shall_not_be(self):
        noise = {}
        for flags in ((), ("--align-matches", "1"), ("--align-matches", "0")):
            self.succeed(self.reconstruct(*flags))
            noise[flags] = self.result()["noise_px"]
        self.assertEqual(noise[()], noise["--align-matches", "1"])
        self.assertNotEqual(noise[()], noise["--align-matches", "0"])

    def test_powers_of_a_size_out_of_range_are_refused(self):
        for text in ("-0.1", "2.1", "nan"):
            with self.subTest(text=text):
                self.assert_refused(self.reconstruct("--sigma-by-size", text), "--sigma-by-size")

    def test_fixed_iterations_draw_exactly_that_many_samples(self):
        self.succeed(self.reconstruct("--fixed-iterations", "77"))
        self.assertEqual(self.result()["num_iterations"], 77)

    def test_resized_images_keep_the_pose_and_never_grow(self):
        self.succeed(self.reconstruct("--resize", "5000"))
        self.assertEqual(self.result()["image_size0"], [WIDTH, HEIGHT])
        self.succeed(self.reconstruct("--resize", "256"))
        self.assertEqual(self.result()["image_size0"], [256, 192])
        self.assertAlmostEqual(self.result()["t"][0], -1, delta=2e-3)

    def test_two_cameras_serve_their_own_images(self):
        # Image 1 and its principal point are moved by 12 pixels, so the rays stay the same.
        shifted = cli.camera_yaml(cx=(WIDTH - 1) / 2 + 12)
        rows = []
        right = cli.stereo_pair()[1]
        for y in range(HEIGHT):
            row = right[y * WIDTH : (y + 1) * WIDTH]
            rows.append(bytes([row[0]]) * 12 + row[:-12])
        b = self.write("shifted.png", cli.png(WIDTH, HEIGHT, b"".join(rows)))
        self.succeed(self.reconstruct("--camera0", self.camera, "--camera1",
                                      self.write("cam1.yaml", shifted), b=b, camera=False))
        self.assertAlmostEqual(self.result()["t"][0], -1, delta=1e-3)
        self.assertAlmostEqual(self.result()["R"][0], 1, delta=1e-4)

    def test_without_cameras_F_is_found_and_no_pose(self):
        done = self.reconstruct("--method", "eight-point", camera=False)
        result = self.assert_no_pose(done)
        self.assertIn(result["config"], ("uncalibrated", "planar_or_panoramic"))
        self.assertIsNotNone(result["F"] or result["H"])
        self.assertIsNone(result["median_parallax_deg"])
        self.assertIsNone(result["options"]["camera0"])
        self.assertIn("matches.png", self.listing())
        note = "no camera, so no pose: give --camera or --focal-35mm"
        self.assertIn(f"note         {note}\n", done.stdout.decode())
        page = (self.out / "report.html").read_text()
        self.assertIn(f"<li>{note}</li>", page)
        self.assertIn("<tr><th>verdict</th><td>matches ok, no pose</td></tr>", page)
        self.assertIn(b"matches ok, no pose: fundamental matrix only", done.stdout)
        self.assertEqual(result["verdict"], "ok")

    def test_without_a_camera_the_focal_length_is_estimated_and_doubtful(self):
        for more in ((), ("--focal-35mm", "auto")):
            done = self.succeed(self.reconstruct(*more, camera=False))
            result = self.result()
            self.assertEqual(result["verdict"], "doubtful")
            self.assertIn("low_parallax", result["reasons"])
            focal = result["focal_length"]
            self.assertTrue(focal["uncertain"])
            self.assertEqual([focal[key] for key in ("source", "k1", "k2", "k3")],
                             ["estimated", None, None, None])
            self.assertGreater(focal["sigma_percent"], 5)
            diagonal = math.hypot(WIDTH, HEIGHT) / math.hypot(36, 24)
            self.assertAlmostEqual(focal["pixels"], focal["focal_35mm"] * diagonal, delta=1e-6)
            self.assertEqual([c["source"] for c in result["cameras"]], ["estimated"] * 2)
            self.assertEqual(result["options"]["focal_35mm"], more[1] if more else None)
            text = " ".join(done.stdout.decode().split())
            self.assertIn("note no camera is known (a.png" if not more else
                          "note the focal length is estimated", text)
            self.assertIn("the focal length is too uncertain for this pose", text)
            self.assertIn("advice the focal length is doubtful: give --focal-35mm", text)
        self.assert_refused(self.reconstruct("--focal-35mm", "auto", "--method", "seven-point",
                                             camera=False, out=self.folder / "other"),
                            "--method seven-point does not find", out=self.folder / "other")

    def test_a_focal_length_of_35mm_film_is_a_pinhole_with_the_same_diagonal(self):
        focal_35mm = FOCAL * math.hypot(36, 24) / math.hypot(WIDTH, HEIGHT)
        self.succeed(self.plain())
        known = self.result()
        self.succeed(self.reconstruct("--focal-35mm", repr(focal_35mm), camera=False))
        result = self.result()
        self.assertEqual(result["options"]["focal_35mm"], focal_35mm)
        self.assertIsNone(result["options"]["camera0"])
        self.assertEqual(result["num_inliers"], known["num_inliers"])
        for a, b in zip(result["R"] + result["t"], known["R"] + known["t"]):
            self.assertAlmostEqual(a, b, delta=1e-9)
        other = self.folder / "other"
        self.assert_refused(self.reconstruct("--focal-35mm", "26", out=other), "--focal-35mm",
                            "without a camera file", out=other)

    def test_an_uncertain_focal_length_is_told_with_what_helps(self):
        for sigma in ("0.1", "0"):
            done = self.succeed(self.reconstruct("--focal-sigma", sigma))
            result, text = self.result(), done.stdout.decode()
            with self.subTest(sigma=sigma):
                uncertain = sigma != "0"
                self.assertEqual("focal length uncertain" in text, uncertain)
                self.assertEqual(result["focal_length"] is not None, uncertain)

    def test_a_camera_files_sigmas_are_read_and_refused_out_of_range(self):
        plain = self.camera.read_text()
        self.camera.write_text(plain + "focal_sigma: 0.004\ncenter_sigma: 0\n")
        self.succeed(self.reconstruct())
        self.assertEqual(self.result()["focal_length"]["sigma"], 0.004)
        for entry in ("focal_sigma: 0.6", "center_sigma: -0.1", "focal_sigma: .nan"):
            self.camera.write_text(plain + entry + "\n")
            self.assert_refused(self.reconstruct(out=self.folder / "other"), "cam.yaml",
                                entry.split(":")[0], out=self.folder / "other")

    def test_files_of_an_earlier_pair_do_not_stay_beside_new_ones(self):
        self.succeed(self.plain())
        (self.out / "mine.txt").write_text("kept")
        self.reconstruct(b=self.a)
        self.assertNotIn("cloud.ply", self.listing())
        self.assertNotIn("views.png", self.listing())
        self.assertIn("mine.txt", self.listing())

    def test_pictures_are_whole_and_of_a_size_to_look_at(self):
        self.succeed(self.plain())
        for name in ("matches.png", "epipolar.png", "views.png"):
            width, height = cli.png_size((self.out / name).read_bytes())
            self.assertTrue(400 <= width <= 2400 and 300 <= height <= 2400, (name, width, height))

    def test_the_report_holds_all_that_it_shows(self):
        a = self.write("x<b>&.png", self.a.read_bytes())
        self.succeed(self.reconstruct(a=a))
        page = (self.out / "report.html").read_text()
        self.assertTrue(page.startswith("<!doctype html>") and page.rstrip().endswith("</html>"))
        self.assertIsNone(re.search(r"(src|href)=\"(?!data:)", page))
        self.assertNotIn("http:", page)
        self.assertNotIn("https:", page)
        self.assertNotIn("{{", re.sub(r"<script.*?</script>", "", page, flags=re.S))
        self.assertEqual(page.count("data:image/"), 3)
        self.assertIn("x&lt;b&gt;&amp;.png", page)
        self.assertNotIn("<b>&", page)
        c = self.result()["covariance"]
        for name, variance in (("rotation", c[0] + c[6] + c[12]), ("direction", c[18] + c[24])):
            sigma = math.degrees(math.sqrt(variance))
            self.assertIn(f"<b>{sigma:.3f}<i>deg</i></b><span>1 sigma of the {name}", page)
        self.assertNotIn('class="advice"', page)
        R, t = self.result()["R"], self.result()["t"]
        stands = [-sum(R[3 * k + i] * t[k] for k in range(3)) for i in range(3)]
        words = [f"{abs(distance):.2f} {names[distance < 0]}" for distance, names in zip(
            stands, (("right", "left"), ("down", "up"), ("forward", "back")), strict=True)]
        self.assertIn(f"<b>{', '.join(words)}</b><span>where camera 1 stands", page)
        data = json.loads(re.search(r'id="cloud-data">(.*?)</script>', page, re.S).group(1))
        self.assertEqual(len(data["cameras"]), 2)

    def test_the_report_has_six_digits_of_each_number_of_F(self):
        self.succeed(self.plain())
        page = (self.out / "report.html").read_text()
        text = re.search(r"<figcaption>F</figcaption><pre>(.*?)</pre>", page, re.S).group(1)
        shown = [float(number) for number in text.split()]
        for number, exact in zip(shown, self.result()["F"], strict=True):
            self.assertAlmostEqual(number, exact, delta=1e-6 * abs(exact))

    def test_on_a_phone_a_matrix_scrolls_in_its_own_box(self):
        self.succeed(self.plain())
        page = (self.out / "report.html").read_text()
        self.assertRegex(page, r"\.matrices figure \{ min-width: 0; max-width: 100%; \}")
        self.assertIn("minmax(min(330px, 100%), 1fr)", page)

    def test_a_missing_image_is_named_and_the_help_too(self):
        self.assert_refused(self.run_program("reconstruct", self.a, "-o", self.out),
                            "B is required (see twoview reconstruct --help)")

    def test_the_summary_says_what_the_belief_is_of(self):
        done = self.succeed(self.plain())
        self.assertRegex(done.stdout.decode(), r"(?m)^belief +rotation off by more than 5 deg with "
                                               r"probability [\d.e-]+ %$")
        self.assertIn("probability that the rotation is off by more than 5 deg",
                      (self.out / "report.html").read_text())

    def test_the_report_says_in_words_on_which_side_the_other_camera_stands(self):
        for a, b, side in ((self.a, self.b, "right"), (self.b, self.a, "left")):
            self.succeed(self.reconstruct(a=a, b=b))
            self.assertRegex((self.out / "report.html").read_text(),
                             rf"<b>1\.00 {side}, 0\.0\d (up|down), 0\.0\d (back|forward)")

    def test_a_matrix_without_a_pose_is_not_called_ok(self):
        done = self.reconstruct("--method", "eight-point", camera=False)
        self.assertEqual(done.returncode, 3)
        self.assertNotRegex(done.stdout, rb"verdict +ok")
        if self.result()["verdict"] == "ok":
            self.assertRegex(done.stdout, rb"verdict +matches ok, no pose: ")

    def test_a_ROS_camera_reads_as_the_same_camera(self):
        self.succeed(self.plain())
        expected = self.result()
        ros = f"""image_width: {WIDTH}
image_height: {HEIGHT}
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [{FOCAL}, 0, {(WIDTH - 1) / 2}, 0, {FOCAL}, {(HEIGHT - 1) / 2}, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0, 0, 0, 0, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
"""
        self.camera.write_text(ros)
        self.succeed(self.reconstruct())
        for key in ("R", "t", "covariance", "num_inliers"):
            self.assertEqual(self.result()[key], expected[key], key)

    def test_lenses_with_eight_and_with_four_equidistant_coefficients_are_read(self):
        tiny = (1e-9,) * 8
        self.camera.write_text(cli.camera_yaml(k=tiny))
        self.succeed(self.reconstruct())
        self.assertAlmostEqual(self.result()["t"][0], -1, delta=1e-3)
        self.camera.write_text(cli.camera_yaml(k=(0, 0, 0, 0)) + "distortion_model: equidistant\n")
        done = self.reconstruct()
        self.assertIn(done.returncode, (0, 2, 3))
        if done.returncode == 2:
            self.one_line(done)

    def test_help_and_version_are_no_failures(self):
        for arguments in (["--help"], ["reconstruct", "--help"], ["--version"]):
            done = self.succeed(self.run_program(*arguments))
            self.assertEqual(done.stderr, b"")
            self.assertGreater(len(done.stdout), 10)
        self.assertIn("--max-error-px", self.run_program("reconstruct", "--help").stdout.decode())

    def test_a_reader_that_goes_away_is_no_failure(self):
        read, write = os.pipe()
        os.close(read)
        with os.fdopen(write, "w") as closed:
            import subprocess

            done = subprocess.run(
                [
                    cli.program(),
                    "reconstruct",
                    self.a,
                    self.b,
                    "--camera",
                    self.camera,
                    "-o",
                    self.out,
                ],
                stdout=closed,
                stderr=subprocess.PIPE,
            )
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.listing(), cli.RESULT_FILES)


if __name__ == "__main__":
    cli.main()
