#!/usr/bin/env python3
"""Tests of photographs as people have them: EXIF's focal length, large ones, resized ones in every
verb that takes a camera, and formats that are not read."""
import json
import math
import struct
import unittest

import cli_support as cli
from cli_support import FOCAL, HEIGHT, WIDTH, camera_yaml, png, png_chunk
from test_bad_input import JPEG

FOCAL_35MM = 32  # a whole number, as EXIF has it
FOCAL_PX = FOCAL_35MM * math.hypot(WIDTH, HEIGHT) / math.hypot(36, 24)
ASCII, SHORT, LONG, RATIONAL, SRATIONAL, FLOAT, DOUBLE = 2, 3, 4, 5, 10, 11, 12


def exif(order="<", orientation=None, **tags):
    """EXIF data with these tags of its own directory, name=(tag, type, value), and Orientation."""
    head = b"II*\0" if order == "<" else b"MM\0*"
    entries, extra = b"", b""
    of_image = b""
    if orientation is not None:
        of_image = struct.pack(order + "HHIHH", 0x0112, SHORT, 1, orientation, 0)
    first = 8 + 18 + len(of_image)  # behind the header and the image's directory
    data_at = first + 2 + 12 * len(tags) + 4
    for tag, kind, value in sorted(tags.values()):
        if kind == RATIONAL:
            field = struct.pack(order + "I", data_at + len(extra))
            extra += struct.pack(order + "II", *value)
        elif kind == SRATIONAL:
            field = struct.pack(order + "I", data_at + len(extra))
            extra += struct.pack(order + "ii", *value)
        elif kind == DOUBLE:
            field = struct.pack(order + "I", data_at + len(extra))
            extra += struct.pack(order + "d", value)
        elif kind == FLOAT:
            field = struct.pack(order + "f", value)
        elif kind == SHORT:
            field = struct.pack(order + "HH", value, 0)
        elif kind == ASCII:
            field = struct.pack(order + "I", data_at + len(extra))
            extra += value.encode() + b"\0"
        else:
            field = struct.pack(order + "I", value)
        count = len(value) + 1 if kind == ASCII else 1
        entries += struct.pack(order + "HHI", tag, kind, count) + field
    return (head + struct.pack(order + "I", 8)
            + struct.pack(order + "H", 1 + bool(of_image)) + of_image
            + struct.pack(order + "HHIII", 0x8769, LONG, 1, first, 0)
            + struct.pack(order + "H", len(tags)) + entries + struct.pack(order + "I", 0) + extra)


def film(mm):
    return {"film": (0xA405, SHORT, mm)}


def zoom(ratio):
    return {"zoom": (0xA404, RATIONAL, (round(100 * ratio), 100))}


def sensor(mm, width=36, height=24):
    """A lens of `mm` on a sensor of this size, of 3200 x 2400 pixels."""
    return {"f": (0x920A, RATIONAL, (round(10 * mm), 10)), "unit": (0xA210, SHORT, 4),
            "x": (0xA20E, RATIONAL, (round(1000 * 3200 / width), 1000)),
            "y": (0xA20F, RATIONAL, (round(1000 * 2400 / height), 1000)), **size(3200, 2400)}


def size(width, height):
    return {"width": (0xA002, LONG, width), "height": (0xA003, LONG, height)}


def with_exif(image, data):
    """A PNG or JPEG file with EXIF data in it."""
    if image.startswith(b"\xff\xd8"):
        segment = b"Exif\0\0" + data
        return image[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + image[2:]
    return image[:33] + png_chunk(b"eXIf", data) + image[33:]


def larger(image, factor):
    """The grey samples of a WIDTH x HEIGHT image, each repeated factor x factor times."""
    rows = []
    for y in range(HEIGHT):
        row = b"".join(bytes([v]) * factor for v in image[y * WIDTH : (y + 1) * WIDTH])
        rows += [row] * factor
    return png(WIDTH * factor, HEIGHT * factor, b"".join(rows))


class Panoramas(cli.CliTest):
    def test_pictures_of_360_degrees_are_refused(self):
        for xmp in (b'<x:d GPano:ProjectionType="equirectangular"/>',
                    b"<GPano:ProjectionType>equirectangular</GPano:ProjectionType>"):
            segment = b"http://ns.adobe.com/xap/1.0/\0" + xmp
            path = self.write("theta.jpg", b"\xff\xd8\xff\xe1"
                              + struct.pack(">H", len(segment) + 2) + segment
                              + b"\xff\xc0\0\x0b\x08\0\x10\0\x20\1\1\x11\0\xff\xda\0\2\xff\xd9")
            self.a = path
            self.assert_refused(self.reconstruct("--focal-35mm", "26", camera=False), "theta.jpg",
                                "panorama (equirectangular, by its XMP)")


class Exif(cli.CliTest):
    def photographs(self, *data):
        """The paths of both images with EXIF data of their own, or of one for both."""
        return [self.write(path.name, with_exif(path.read_bytes(), block))
                for path, block in zip((self.a, self.b), data * 2)]

    def test_its_focal_length_is_used_and_said_where_no_camera_is_given(self):
        for order in "<>":
            self.a, self.b = self.photographs(exif(order, **film(FOCAL_35MM)))
            done = self.succeed(self.reconstruct(camera=False))
            self.assertIn(b"note         focal length 32 mm (35 mm equivalent) from EXIF; --camera "
                          b"is better\n", done.stdout)
            found = self.result()
            self.assertEqual(found["cameras"],
                             [{"source": "exif", "file": None, "focal_35mm": FOCAL_35MM}] * 2)
            self.succeed(self.reconstruct("--focal-35mm", "32", camera=False))
            given = self.result()
            self.assertEqual(given["cameras"][0]["source"], "focal_35mm")
            self.assertRegex(done.stdout, rb"(?m)^belief .* %, if the focal length is right$")
            self.assertIn("off by more than 5 deg, if the focal length is right",
                          (self.out / "report.html").read_text())
            self.assertIn("<tr><th>camera 0</th><td>--focal-35mm: 32 mm as for 35 mm film</td>",
                          (self.out / "report.html").read_text())
            for key in ("R", "t", "covariance", "num_inliers", "verdict"):
                self.assertEqual(found[key], given[key], key)

    def test_the_report_says_which_camera_was_used_and_where_it_is_from(self):
        self.a, self.b = self.photographs(exif(**film(FOCAL_35MM)))
        self.succeed(self.reconstruct(camera=False))
        page = (self.out / "report.html").read_text()
        # With blanks, where a narrow page breaks the line, and not within a name.
        self.assertIn("<h1>a.png <small>and</small> b.png</h1>", page)
        self.assertIn("<li>focal length 32 mm (35 mm equivalent) from EXIF; "
                      "--camera is better</li>",
                      page.split("<main>")[0])
        self.assertIn("<tr><th>camera 1</th><td>EXIF data: 32 mm as for 35 mm film</td></tr>\n"
                      f"<tr><th>fx</th><td>{FOCAL_PX:.2f} px</td></tr>", page)
        self.succeed(self.reconstruct("--resize", "160"))
        page = (self.out / "report.html").read_text()
        self.assertIn(f"<tr><th>camera 0</th><td>file {self.camera}</td></tr>\n"
                      f"<tr><th>fx</th><td>{FOCAL / 2:.2f} px</td></tr>", page)

    def test_it_is_never_silent(self):
        self.a, self.b = self.photographs(exif(**film(FOCAL_35MM)))
        for flag in ("--json", "--quiet"):
            with self.subTest(flag=flag):
                done = self.succeed(self.reconstruct(flag, camera=False))
                self.one_line(done, "note: focal length 32 mm")

    def test_a_camera_that_is_given_comes_before_it(self):
        plain = self.succeed(self.reconstruct("--json"))
        self.a, self.b = self.photographs(exif(**film(80)))
        done = self.succeed(self.reconstruct("--json"))
        self.assertEqual(done.stderr, b"")
        self.assertEqual(json.loads(done.stdout)["R"], json.loads(plain.stdout)["R"])

    def test_two_photographs_have_each_their_own(self):
        self.a, self.b = self.photographs(exif(**film(32)), exif(**film(33)))
        done = self.succeed(self.reconstruct(camera=False))
        self.assertIn(b"focal lengths 32 and 33 mm", done.stdout)
        self.assertEqual([c["focal_35mm"] for c in self.result()["cameras"]], [32, 33])

    def test_the_size_of_the_sensor_serves_where_the_film_is_not_named(self):
        # 24 mm on a sensor of 22.5 x 15 mm, of 6000 x 4000 pixels: 36 / 22.5 times as on film. The
        # unit is an inch where no other is named.
        for unit, per_mm in ((3, 10), (2, 25.4)):
            data = exif(f=(0x920A, RATIONAL, (24, 1)), unit=(0xA210, SHORT, unit),
                        x=(0xA20E, RATIONAL, (round(6000 / 22.5 * per_mm * 1000), 1000)),
                        y=(0xA20F, RATIONAL, (round(4000 / 15 * per_mm * 1000), 1000)),
                        **size(6000, 4500))
            # 4:3, as the images are: the diagonal is of 22.5 x 16.875 mm.
            self.a, self.b = self.photographs(data)
            self.succeed(self.reconstruct(camera=False))
            expected = 24 * math.hypot(36, 24) / math.hypot(22.5, 16.875)
            self.assertAlmostEqual(self.result()["cameras"][0]["focal_35mm"], expected, delta=1e-3)

    def test_a_cropped_photographs_focal_length_is_not_used(self):
        self.a, self.b = self.photographs(exif(**film(32), **size(6000, 4000)))
        done = self.reconstruct(camera=False)
        words = b" ".join(done.stdout.split())
        self.assertIn(b"no camera is known (a.png was cropped or is of another shape", words)
        self.assertIn(b"): the focal length is estimated", words)
        self.assertEqual(self.result()["focal_length"]["source"], "estimated")
        self.a, self.b = self.photographs(exif(**film(32), **size(3000, 4000)))  # turned since
        self.succeed(self.reconstruct(camera=False))

    def test_what_a_digital_zoom_leaves_open_is_in_the_sigma_and_said(self):
        focal, middle = 20, 20 * math.sqrt(1.6)
        sigma = math.hypot(0.1, math.log(1.6) / 2)
        self.a, self.b = self.photographs(exif(**film(focal), **zoom(1.6)))
        done = self.succeed(self.reconstruct(camera=False))
        self.assertIn(b"25.3 mm (35 mm equivalent) from EXIF, known to 26 % only; --camera is "
                      b"better; a.png was taken with a digital zoom of 1.6, which the 20 mm in its "
                      b"EXIF data may or may not contain; b.png was", done.stdout)
        found = self.result()
        self.assertAlmostEqual(found["cameras"][0]["focal_35mm"], middle)
        self.assertGreater(found["focal_length"]["sigma"], 0.3 * sigma)
        self.assertTrue(found["focal_length"]["uncertain"])
        self.succeed(self.reconstruct("--focal-35mm", f"{middle:.17g}", "--focal-sigma",
                                      f"{sigma:.17g}", camera=False))
        given = self.result()
        for key in ("R", "t", "covariance", "verdict", "focal_length"):
            self.assertEqual(found[key], given[key], key)
        # --focal-sigma comes before what EXIF says.
        self.succeed(self.reconstruct("--focal-sigma", "0", camera=False))
        self.assertIsNone(self.result()["focal_length"])

    def test_a_digital_zoom_of_another_type_than_the_standards_counts_too(self):
        for order in "<>":  # Pillow writes a float as DOUBLE
            for kind, value in ((DOUBLE, 1.6), (FLOAT, 1.6), (SRATIONAL, (16, 10))):
                image = self.write("z.png", with_exif(self.a.read_bytes(), exif(
                    order, **film(20), zoom=(0xA404, kind, value))))
                with self.subTest(order=order, kind=kind):
                    done = self.run_program("undistort", image, "-o", self.out)
                    self.assert_refused(done, "--focal-35mm")
                    self.assertNotIn(b"20 (by EXIF)", done.stderr)  # it may be 20 mm, or 32

    def test_what_two_readings_of_the_focal_length_mean_together(self):
        of_film = math.hypot(36, 24) / math.hypot(36, 27)  # of 4:3, as the images are
        cases = {  # EXIF: focal length, words of the note
            "no zoom": (film(32) | zoom(1), 32, None),
            "not used": (film(32) | zoom(0), 32, None),
            "slight": (film(32) | zoom(1.04), 32, None),
            "wide": (film(32) | zoom(0.5), 32 * math.sqrt(0.5), "digital zoom of 0.5"),
            "agree": (film(32) | sensor(33, 36, 27), 32, None),
            "contained": (film(32) | sensor(20, 36, 27) | zoom(1.6), 32, None),
            "lens alone": (sensor(32, 36, 27) | zoom(1.5), 32 * of_film * math.sqrt(1.5),
                           "digital zoom of 1.5"),
            "contradict": (film(32) | sensor(50, 36, 27), math.sqrt(32 * 50 * of_film),
                           "contradict each other, 32 mm"),
            "both lack it": (film(32) | sensor(33, 36, 27) | zoom(1.5), 32 * math.sqrt(1.5),
                             "digital zoom of 1.5"),
            "rubbish": (film(65535) | sensor(33, 36, 27), 33 * of_film, None),
            "of the lens": (film(4) | sensor(33, 36, 27), 33 * of_film, None),
        }
        for case, (tags, focal, words) in cases.items():
            with self.subTest(case=case):
                self.a, self.b = self.photographs(exif(**tags))
                done = self.succeed(self.reconstruct(camera=False))
                self.assertEqual(b"known to" in done.stdout, words is not None)
                self.assertIn((words or "").encode(), done.stdout)
                found = self.result()["cameras"][0]["focal_35mm"]
                self.assertAlmostEqual(found, focal, delta=1e-3)
                self.a.write_bytes(png(WIDTH, HEIGHT, cli.stereo_pair()[0]))
                self.b.write_bytes(png(WIDTH, HEIGHT, cli.stereo_pair()[1]))

    def test_readings_that_are_too_far_apart_are_none(self):
        for tags, words in ((film(32) | zoom(4), "a.png was taken with a digital zoom of 4, which"),
                            (film(30) | sensor(100, 36, 27), "30 mm for 35 mm film and 96"),
                            (film(4), "none of 8 to 10000 mm"),
                            (film(65535), "none of 8 to 10000 mm")):
            with self.subTest(words=words):
                a, b = (self.write(p.name, with_exif(png(WIDTH, HEIGHT, image), exif(**tags)))
                        for p, image in zip((self.a, self.b), cli.stereo_pair()))
                done = self.reconstruct(a=a, b=b, camera=False)
                self.assertIn(words.encode(), b" ".join(done.stdout.split()))
                self.assertEqual(self.result()["focal_length"]["source"], "estimated")

    def test_another_size_than_exif_says_is_said_to_be_taken_as_a_resize(self):
        self.a, self.b = self.photographs(exif(**film(32), **size(4000, 3000)))
        done = self.succeed(self.reconstruct(camera=False))
        self.assertIn(b"a.png is taken as made smaller or larger, not as cropped: EXIF says "
                      b"4000x3000", done.stdout)
        self.assertEqual(self.result()["cameras"][0]["focal_35mm"], 32)

    def test_a_focal_length_without_the_size_of_the_sensor_is_said_to_lack_that(self):
        image = self.write("f.png", with_exif(self.a.read_bytes(),
                                              exif(f=(0x920A, RATIONAL, (42, 10)))))
        words = ["f.png has the focal length of its lens in EXIF data, but not the size of its "
                 "sensor", "--focal-35mm"]
        done = self.reconstruct(a=image, b=image, camera=False)
        self.assertIn(words[0].encode(), b" ".join(done.stdout.split()))
        self.out = self.folder / "refused"
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        done = self.run_program("triangulate", self.write("m.txt", "8 8 7 8\n"), "--pose", pose,
                                "--images", image, image, "-o", self.out)
        self.assert_refused(done, *words)

    def test_pixels_outside_the_image_name_the_camera_that_is_not_from_a_file(self):
        self.a, self.b = self.photographs(exif(**film(FOCAL_35MM)))
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        run = ["triangulate", self.write("m.txt", "8 8 400 8\n"), "--pose", pose, "--images",
               self.a, self.b, "-o", self.out]
        self.assert_refused(self.run_program(*run, "--focal-35mm", "25"),
                            "in image 1, but the camera of --focal-35mm 25 is for 320x240")
        done = self.run_program(*run, "--quiet")
        self.assertEqual(done.returncode, 2)
        self.assertIn(b"in image 1, but the camera of EXIF's focal length, 32 mm, is for 320x240",
                      done.stderr)

    def test_one_photograph_without_it_is_named(self):
        self.a = self.write("with.png", with_exif(self.a.read_bytes(), exif(**film(32))))
        self.assert_refused(self.reconstruct(camera=False), "b.png has no focal length in EXIF")

    def test_a_method_without_cameras_names_it_and_does_without(self):
        self.a, self.b = self.photographs(exif(**film(32)))
        done = self.reconstruct("--method", "eight-point", camera=False)
        self.assert_no_pose(done)
        self.assertIn(b"--focal-35mm 32 would use it", done.stdout)
        self.assertEqual(self.result()["cameras"][0]["source"], None)

    def test_pictures_that_a_viewer_turns_are_said_to_be_used_as_they_are_stored(self):
        for orientations, words in (((6, 6), b"as they are stored, lying on their side (EXIF)"),
                                    ((8, 8), b"as they are stored, lying on their side (EXIF)"),
                                    ((3, 3), b"as they are stored, upside down (EXIF)"),
                                    ((1, 6), b"held differently (EXIF): hold it the same way"),
                                    ((1, 1), None), ((None, 1), None), ((None, None), None)):
            for order in "<>":
                with self.subTest(orientations=orientations, order=order):
                    self.a, self.b = self.photographs(
                        *(exif(order, orientation=o, **film(FOCAL_35MM)) for o in orientations))
                    done = self.succeed(self.reconstruct(camera=False))
                    self.assertEqual(done.stdout.count(b"\nnote  "), 2 if words else 1)
                    self.assertIn(words or b"", done.stdout)

    def test_a_verb_that_does_not_use_it_names_it_in_the_error(self):
        self.photographs(exif(**film(FOCAL_35MM)))
        pairs = self.write("pairs.txt", "a.png b.png\n")
        for words in (("undistort", self.a),
                      ("evaluate", pairs, "--images", self.folder)):
            with self.subTest(verb=words[0]):
                done = self.run_program(*words, "-o", self.out)
                self.assert_refused(done, "--camera", "--focal-35mm 32 (by EXIF)")
        done = self.run_program("undistort", self.a, "--camera", self.camera, "--focal-35mm", "32",
                                "-o", self.out)
        self.assert_refused(done, "give either --camera or --focal-35mm\n")
        self.a.write_bytes(png(WIDTH, HEIGHT, cli.stereo_pair()[0]))
        done = self.run_program("undistort", self.a, "-o", self.out)
        self.assert_refused(done, "give either --camera or --focal-35mm\n")

    def test_broken_data_are_no_focal_length(self):
        whole = exif(**film(32), **size(WIDTH, HEIGHT))
        for case, data in (("empty", b""), ("cut", whole[:30]), ("zero", exif(**film(0))),
                           ("wild", whole.replace(b"\x69\x87", b"\x69\x88")),
                           ("far", whole[:18] + b"\xff\xff\xff\x7f" + whole[22:])):
            with self.subTest(case=case):
                a, b = (self.write(f"{p.name}", with_exif(p.read_bytes(), data))
                        for p in (self.a, self.b))
                self.succeed(self.reconstruct(a=a, b=b, camera=False))
                self.assertEqual(json.loads(
                    (self.out / "result.json").read_text())["focal_length"]["source"], "estimated")

    def test_a_jpegs_is_read_and_serves_triangulate(self):
        image = self.write("p.jpg", with_exif(JPEG, exif(**film(50))))
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        matches = self.write("m.txt", "8 8 7 8\n")
        done = self.run_program("triangulate", matches, "--pose", pose, "--images", image, image,
                                "-o", self.out, "--json")
        self.succeed(done)
        self.one_line(done, "focal length 50 mm")
        focal = 50 * math.hypot(16, 16) / math.hypot(36, 24)
        depth = json.loads(done.stdout)["points"][0]["position"][2]
        self.assertAlmostEqual(depth, focal, delta=1e-4)


class Sizes(cli.CliTest):
    """a.png and b.png, 320 x 240, stand for photographs; a factor of 8 makes them 2560 x 1920."""

    def large_pair(self, factor=8):
        self.a, self.b = (self.write(f"l{i}.png", larger(image, factor))
                          for i, image in enumerate(cli.stereo_pair()))

    def test_large_ones_are_used_at_a_sensible_size_and_one_line_says_so(self):
        self.large_pair()
        camera = self.write("c.yaml", camera_yaml(2560, 1920, 8 * FOCAL, 8 * FOCAL, 1279.5, 959.5))
        done = self.succeed(self.reconstruct("--camera", camera, camera=False))
        self.assertEqual(done.stdout.count(b"note  "), 1, done.stdout)
        self.assertIn(b"2560x1920 at 1600x1200 (--resize 0: as they are)", done.stdout)
        self.assertIn("2560x1920 at 1600x1200", (self.out / "report.html").read_text())
        found = self.result()
        self.assertEqual(found["image_size0"], [1600, 1200])
        self.assertEqual(found["options"]["resize"], 1600)
        self.succeed(self.reconstruct("--camera", camera, "--resize", "1600", camera=False))
        given = self.result()
        for key in ("R", "t", "covariance", "num_inliers"):
            self.assertEqual(found[key], given[key])
        done = self.succeed(self.reconstruct("--camera", camera, "--resize", "0", camera=False))
        self.assertNotIn(b"note  ", done.stdout)
        self.assertEqual(self.result()["image_size0"], [2560, 1920])
        for verb, images in (("detect", [self.a]), ("match", [self.a, self.b])):
            out = self.folder / verb
            done = self.succeed(self.run_program(verb, *images, "-o", out))
            self.assertRegex(done.stdout, rb"\Anote .*\n[0-9]+ (keypoints|matches)")
            done = self.succeed(self.run_program(verb, *images, "-o", out, "--json"))
            self.one_line(done, "2560x1920 at 1600x1200")
            self.assertEqual(json.loads(done.stdout)["options"]["resize"], 1600)

    def test_sizes_that_the_tables_measure_stay_as_they_are(self):
        image = self.write("n.png", png(2048, 16, bytes(2048 * 16)))
        done = self.succeed(self.run_program("detect", image, "-o", self.out, "--json"))
        self.assertEqual(done.stderr, b"")
        result = json.loads(done.stdout)
        self.assertEqual((result["image_size"], result["options"]["resize"]), ([2048, 16], 0))
        image = self.write("n.png", png(2049, 16, bytes(2049 * 16)))
        done = self.succeed(self.run_program("detect", image, "-o", self.out, "--json"))
        self.assertEqual(json.loads(done.stdout)["image_size"][0], 1600)

    def test_triangulate_resizes_as_match_does(self):
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        self.succeed(self.run_program("match", self.a, self.b, "--resize", "160", "-o", self.out))
        matches = self.out / "matches.csv"

        def triangulated(*more):
            done = self.run_program("triangulate", matches, "--pose", pose, "--camera", self.camera,
                                    "-o", self.folder / "t", "--json", *more)
            self.succeed(done)
            points = [p["position"] for p in json.loads(done.stdout)["points"]
                      if p["status"] == "ok" and p["error_px"] < 0.3]
            # What is between two walls is at neither's depth.
            near = [p for p in points if min(abs(p[2] * s / FOCAL - 1) for s in cli.SHIFTS) < 0.05]
            return len(near) / max(len(points), 1)

        self.assertGreater(triangulated("--resize", "160"), 0.8)
        self.assertGreater(triangulated("--resize", "160", "--images", self.a, self.b), 0.8)
        self.assertLess(triangulated("--resize", "0"), 0.5)
        done = self.run_program("triangulate", matches, "--pose", pose, "--camera", self.camera,
                                "-o", self.folder / "n")
        self.assert_refused(done, "camera is for 320x240", "--resize", out=self.folder / "n")

    def test_triangulate_refuses_images_of_another_size_than_their_camera(self):
        half = self.write("half.png", png(160, 120, bytes(160 * 120)))
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        done = self.run_program("triangulate", self.write("m.txt", "80 60 70 60\n"), "--pose", pose,
                                "--camera", self.camera, "--images", half, half, "-o", self.out)
        self.assert_refused(done, "160x120", "320x240", "half.png")

    def test_triangulate_takes_a_focal_length_with_the_size_of_the_pose_or_the_images(self):
        matches = self.write("m.txt", "160 120 130 120\n")
        pose = self.write("pose.yaml", "R: [1,0,0, 0,1,0, 0,0,1]\nt: [-1, 0, 0]\n")
        run = ["triangulate", matches, "--focal-35mm", "32", "-o", self.out, "--json", "--pose"]
        self.assert_refused(self.run_program(*run, pose), "--focal-35mm needs the size", "--images")
        pose.write_text(pose.read_text() + f"image_size0: [{WIDTH}, {HEIGHT}]\n"
                        f"image_size1: [{WIDTH}, {HEIGHT}]\n")
        for more in ([], ["--images", self.a, self.b]):
            done = self.succeed(self.run_program(*run, pose, *more))
            depth = json.loads(done.stdout)["points"][0]["position"][2]
            self.assertAlmostEqual(depth, FOCAL_PX / 30, delta=1e-5)

    def test_undistort_resizes_images_and_camera(self):
        lens = self.write("lens.yaml", camera_yaml(k=(-0.2, 0.05, 0, 0, 0)))
        done = self.run_program("undistort", self.a, "--camera", lens, "--resize", "160", "--json",
                                "-o", self.out)
        result = json.loads(self.succeed(done).stdout)
        self.assertEqual(result["image_size"], [160, 120])
        self.assertEqual(cli.png_size((self.out / "a.png").read_bytes()), (160, 120))
        K = result["camera_matrix"]
        self.assertEqual((K[0], K[2]), (FOCAL / 2, (WIDTH / 2 - 1) / 2))

    def test_undistort_takes_a_focal_length(self):
        done = self.run_program("undistort", self.a, "--focal-35mm", "32", "--json", "-o", self.out)
        K = json.loads(self.succeed(done).stdout)["camera_matrix"]
        self.assertAlmostEqual(K[0], FOCAL_PX, delta=1e-9)
        self.assertEqual(cli.png_samples((self.out / "a.png").read_bytes()),
                         cli.png_samples(self.a.read_bytes()))
        other = self.folder / "other"
        for more in ([], ["--focal-35mm", "32", "--camera", self.camera]):
            done = self.run_program("undistort", self.a, *more, "-o", other)
            self.assert_refused(done, "either --camera or --focal-35mm", out=other)

    def test_a_focal_length_that_is_no_number_is_refused_as_such(self):
        for text, *words in (("nan", "'nan' is not a number in [1, 10000]"),
                             ("32,34", "'32,34' is not a number", "decimal point"),
                             ("0", "'0' is not a number in [1, 10000]"),
                             ("wide", "'wide'"), ("", "''"), ("26mm", "'26mm'")):
            with self.subTest(text=text):
                done = self.reconstruct("--focal-35mm", text, camera=False)
                self.assert_refused(done, "--focal-35mm", *words)


class Scale(cli.CliTest):
    """How many times larger image 1 shows the scene, where most matches are wrong."""

    ZOOM = 3.5

    def zoomed_pair(self):
        """A picture, and its middle at ZOOM times the scale."""
        wide, high = int(self.ZOOM * WIDTH), int(self.ZOOM * HEIGHT)
        rows = cli.texture(wide, high, seed=3)
        edges = [int(self.ZOOM * i) for i in range(WIDTH + 1)]
        small = bytearray()
        for top, bottom in zip(edges[:HEIGHT], edges[1:]):
            sums = [sum(column) for column in zip(*rows[top:bottom])]
            for left, right in zip(edges, edges[1:]):
                small.append(sum(sums[left:right]) // ((right - left) * (bottom - top)))
        x, y = (wide - WIDTH) // 2, (high - HEIGHT) // 2
        middle = b"".join(bytes(row[x : x + WIDTH]) for row in rows[y : y + HEIGHT])
        return [self.write(f"{name}.png", png(WIDTH, HEIGHT, data))
                for name, data in (("small", bytes(small)), ("middle", middle))]

    def test_a_real_zoom_is_named_in_the_right_direction(self):
        small, middle = self.zoomed_pair()
        for a, b, scale in ((small, middle, self.ZOOM), (middle, small, 1 / self.ZOOM)):
            done = self.reconstruct("--ratio", "0.97", a=a, b=b)
            result = self.result()
            self.assertLess(result["num_inliers"], 0.5 * result["num_matches"])
            self.assertAlmostEqual(result["magnification"] / scale, 1, delta=0.05)
            said = f"image 1 shows the scene at {result['magnification']:.2f} times the scale"
            self.assertIn(said, done.stdout.decode())

    def test_pictures_without_a_common_scene_have_no_scale(self):
        images = [self.write(f"t{seed}.png", png(WIDTH, HEIGHT, b"".join(cli.texture(
            WIDTH, HEIGHT, seed)))) for seed in range(1, 7)]
        for a, b in zip(images[::2], images[1::2]):
            done = self.reconstruct("--ratio", "0.97", a=a, b=b)
            self.assertEqual(done.returncode, 3)
            result = self.result()
            self.assertGreater(result["num_matches"], 40)
            self.assertIsNone(result["magnification"])
            self.assertNotIn(b"times the scale", done.stdout)
            self.assertIn(b"that both show the scene from a similar distance", done.stdout)


def iso(brand):
    return struct.pack(">I", 24) + b"ftyp" + brand + b"\0\0\0\0mif1miaf" + bytes(64)


class Formats(cli.CliTest):
    def test_odometry_takes_the_focal_length_of_photographs(self):
        for k, data in enumerate(cli.stereo_pair()):
            picture = png(WIDTH, HEIGHT, data)
            self.write(f"photos/{k}.png", with_exif(picture, exif(**film(FOCAL_35MM))))
        done = self.run_program("odometry", "photos", "--fps", "10", "-o", self.out)
        self.assertIn(b"note         focal length 32 mm (35 mm equivalent) from EXIF", done.stdout)
        result = json.loads((self.out / "result.json").read_text())
        self.assertIsNone(result["focal_length"])

    def photographs_of(self, *focals):
        for k, mm in enumerate(focals):
            picture = png(WIDTH, HEIGHT, cli.stereo_pair()[k % 2])
            self.write(f"photos/{k}.png", with_exif(picture, exif(**film(mm))))
        return self.run_program("odometry", "photos", "--fps", "10", "-o", self.out)

    def test_odometry_takes_the_focal_length_of_most_photographs(self):
        done = self.photographs_of(64, 32, 32, 33, 32)
        text = b" ".join(done.stdout.split())
        self.assertIn(b"focal length 32 mm (35 mm equivalent) from EXIF", text)
        self.assertIn(b"1 of 5 pictures have another focal length in EXIF data than 32 mm, such as "
                      b"64 mm", text)

    def test_odometry_refuses_photographs_of_several_zooms(self):
        self.assert_refused(self.photographs_of(32, 32, 64, 64), "2 of 4 pictures",
                            "another focal length")

    def test_odometry_names_pictures_that_are_not_read(self):
        run = ("--fps", "10", "--focal-35mm", "26", "-o", self.out)
        heic = self.write("p.heic", iso(b"heic"))
        self.assert_refused(self.run_program("odometry", heic, *run), "p.heic is a HEIC picture",
                            "JPEG")
        self.write("photos/b.HEIC", iso(b"heix"))
        self.write("photos/c.avif", iso(b"avif"))
        self.write("photos/d.heic", b"something else")
        done = self.run_program("odometry", "photos", *run[2:])
        self.assert_refused(done, "2 pictures of photos are left out: b.HEIC is a HEIC "
                            "picture, which is not read", "; c.avif is an AVIF picture")
        for k, data in enumerate(cli.stereo_pair()):
            self.write(f"photos/{k}.png", png(WIDTH, HEIGHT, data))
        done = self.run_program("odometry", "photos", *run, "--json")
        self.assertIn(b"twoview: note: 2 pictures of photos are left out: b.HEIC is",
                      done.stderr)
        self.assertEqual(json.loads(done.stdout)["num_frames"], 2)

    def test_pictures_that_are_not_read_are_named_as_what_they_are(self):
        for name, data, *words in (
                ("p.heic", iso(b"heic"), "HEIC", "JPEG"), ("p.HEIF", iso(b"mif1"), "HEIC"),
                ("p.jpg", iso(b"heix"), "HEIC"), ("p.avif", iso(b"avif"), "AVIF", "PNG"),
                ("p.gif", b"GIF89a\x01\0\x01\0\0\0\0;", "GIF", "PNG"),
                ("p.mp4", iso(b"isom"), "is a film", "two of its frames", "twoview odometry"),
                ("p.mov", iso(b"qt  "), "is a film"),
                ("p.mkv", b"\x1a\x45\xdf\xa3" + bytes(60), "is a film"),
                ("p.avi", b"RIFF\x40\0\0\0AVI LIST" + bytes(60), "is a film"),
                ("p.wav", b"RIFF\x40\0\0\0WAVEfmt " + bytes(60), "no image")):
            with self.subTest(name=name):
                done = self.run_program("detect", self.write(name, data), "-o", self.out)
                self.assert_refused(done, name, *words)


if __name__ == "__main__":
    cli.main()
