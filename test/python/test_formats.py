"""The readers of twoview_tools.formats on the cases of test/formats, which test/cli/test_formats.cc
runs for the program's readers."""

import json
import pathlib
import unittest

try:
    import numpy as np
    import yaml  # noqa: F401  (twoview_tools.formats needs yaml)
except ImportError as missing:
    raise unittest.SkipTest(f"{missing}: run scripts/bootstrap test")

from twoview_tools import formats
from twoview_tools.colmap.errors import BadInput
from twoview_tools.colmap.masks import Masks
from twoview_tools.folders import copy_name, natural_key

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "formats"


def cases(name):
    """Yields the cases of formats/NAME.json, each with its text."""
    content = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    for case in content["cases"]:
        text = "".join(line + "\n" for line in case.get("text", ()))
        for word, value in content.get("given", {}).items():
            text = text.replace("$" + word, value)
        yield case, text


def listed(array):
    return None if array is None else np.ravel(array).tolist()


def pair_values(pair):
    return {"name0": pair.name0, "name1": pair.name1, "turns": list(pair.turns),
            "K0": listed(pair.K0), "K1": listed(pair.K1), 
            # Made a rotation by iterations, whose last digits are not the format's.
            "R": None if pair.R is None else listed(np.round(pair.R, 12)), "t": listed(pair.t)}


def camera_values(camera):
    k = list(camera.k)
    while k and k[-1] == 0:
        k.pop()
    return {"width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy,
            "cx": camera.cx, "cy": camera.cy, "model": camera.model, "k": k}


class TestReaders(unittest.TestCase):
    def run_cases(self, name, read):
        count = 0
        for case, text in cases(name):
            count += 1
            with self.subTest(file=name, case=case["name"]):
                if "expect" in case:
                    self.assertEqual(read(text), case["expect"])
                    continue
                with self.assertRaises(formats.FormatError) as refusal:
                    read(text)
                message = str(refusal.exception)
                self.assertEqual(message.count("\n"), 0)
                for word in ["the file", *case["refused"]]:
                    self.assertIn(word, message)
        self.assertGreater(count, 20)

    def test_pairs(self):
        self.run_cases("pairs", lambda text: [pair_values(p) for p in
                                              formats.parse_pairs(text, "the file")])

    def test_camera_files(self):
        self.run_cases("camera", lambda text: camera_values(formats.parse_camera(text, "the file")))

    def test_camera_sets(self):
        self.run_cases("cameras", lambda text: [
            {"name": name, **camera_values(camera)}
            for name, camera in formats.parse_camera_set(text, "the file").items()])


    def test_camera_files_of_any_format(self):
        self.run_cases("camera_formats", lambda text: [
            {"name": name, **camera_values(camera)}
            for name, camera in formats.parse_cameras(text, "the file").items()])


class TestChoice(unittest.TestCase):
    def chosen(self, cameras, image, K):
        try:
            return formats.choose_entry(cameras, image, K) or "none"
        except formats.FormatError:
            return "ambiguous"

    def test_the_entry_that_serves_an_image(self):
        for case, _ in cases("choice"):
            cameras = {name: formats.Camera(8, 8, fx, fx, cx, 1, "brown_conrady", (k1, 0, 0, 0, 0))
                       for name, (fx, cx, k1) in case["cameras"].items()}
            for row in case["chosen"]:
                K = row["fx"] and [[row["fx"], 0, row["cx"]], [0, row["fx"], 1], [0, 0, 1]]
                with self.subTest(case=case["name"], image=row["image"]):
                    self.assertEqual(self.chosen(cameras, row["image"], K), row["entry"])

    def test_an_image_that_no_entry_serves_is_refused(self):
        cameras = {name: formats.Camera(8, 8, 1, 1, 1, 1) for name in "ab"}
        with self.assertRaisesRegex(formats.FormatError, "x.png"):
            formats.choose_camera(cameras, "x.png")
        self.assertIsNone(formats.choose_camera({}, "x.png"))


class TestRotations(unittest.TestCase):
    def test_poses_of_a_kitti_file_are_made_rotations(self):
        import tempfile
        from twoview_tools.odometry import poses
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
            def read(line):
                file.seek(0)
                file.truncate()
                file.write("1 0 0 0 0 1 0 0 0 0 1 0\n" + line)
                file.flush()
                return poses.read_kitti(file.name, [0.0, 1.0])
            R = read("0.87 -0.5 0 1 0.5 0.87 0 2 0 0 0.999 3\n").rotations[1]
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
            for line, word in (("1.03 0 0 0 0 1 0 0 0 0 1 0\n", "0.03"),
                               ("1 0 0 0 0 1 0 0 0 0 -1 0\n", "reflection")):
                with self.assertRaisesRegex(poses.PoseError, f"line 2.*{word}"):
                    read(line)


class TestNames(unittest.TestCase):
    def test_names_are_in_the_cases_order(self):
        for case, _ in cases("names"):
            with self.subTest(case=case["name"]):
                for names in (case["names"][::-1], sorted(case["names"])):
                    self.assertEqual(sorted(names, key=natural_key), case["names"])


class TestCopies(unittest.TestCase):
    def test_names_of_copies_are_those_of_the_cases(self):
        for case, _ in cases("copies"):
            with self.subTest(name=case["name"]):
                self.assertEqual(copy_name(case["name"]), (case["mark"], case["original"]))


class TestMasks(unittest.TestCase):
    def test_masks_are_read_as_the_cases_say(self):
        import tempfile
        for case, _ in cases("masks"):
            with self.subTest(case=case["name"]), tempfile.TemporaryDirectory() as folder:
                for name, lines in case["files"].items():
                    path = pathlib.Path(folder, name)
                    path.parent.mkdir(exist_ok=True)
                    path.write_text("".join(line + "\n" for line in lines))
                given = str(pathlib.Path(folder, case["given"]))
                luma = np.zeros(case["size"][::-1], np.uint8)
                if "used" in case:
                    used = Masks(given).of(case["picture"], luma)
                    self.assertEqual(["".join("01"[int(v)] for v in row) for row in used],
                                     case["used"])
                    continue
                with self.assertRaises(BadInput) as refusal:
                    Masks(given).of(case["picture"], luma)
                for word in ["--mask: ", *case["refused"]]:
                    self.assertIn(word, str(refusal.exception))


class TestFiles(unittest.TestCase):
    def test_names_that_are_not_utf8_come_back_as_the_file_has_them(self):
        import os
        import tempfile
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "pairs.txt")
            with open(path, "wb") as f:
                f.write(b"\xe4.png b.png\n")
            pair, = formats.read_pairs(path)
            self.assertEqual(os.fsencode(pair.name0), b"\xe4.png")


if __name__ == "__main__":
    unittest.main()
