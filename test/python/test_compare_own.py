"""A user's own matches and poses in compare_colmap: readers of the files, rows of the report,
tables and figures for a paper."""

import importlib.util
import json
import os
import tempfile
import unittest

import compare_support as support

try:
    import numpy as np
except ImportError as missing:
    raise unittest.SkipTest(f"{missing}: run scripts/bootstrap test")

from twoview_tools import own_matches as own

N = 30
RANDOM = np.random.default_rng(4)
A = RANDOM.uniform(20, 300, (N, 2))
B = A - [9, 0]
SIZES = [(320, 320)] * 2


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        path = os.path.join(self.folder, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        return path

    def saved(self, compressed=False, **arrays):
        path = self.path("own.npz")
        (np.savez_compressed if compressed else np.savez)(path, **arrays)
        return path

    def write(self, name, text):
        with open(self.path(name), "w", encoding="utf-8") as file:
            file.write(text)
        return self.path(name)

    def refused(self, path, *words):
        with self.assertRaises(own.Refused) as caught:
            own.require_pixels(own.read_matches(path), SIZES, path)
        for word in (os.path.basename(path), *words):
            self.assertIn(word, str(caught.exception))

    def test_arrays_of_the_common_matchers(self):
        order = RANDOM.permutation(N)
        keypoints1 = np.concatenate([B[order], [[1, 1], [2, 2]]])
        index = np.append(np.argsort(order), [-1, -1])
        keypoints0 = np.concatenate([A, [[5, 5], [6, 6]]])
        pairs = np.column_stack([np.arange(N), index[:N]])
        for arrays in (
                {"mkpts0": A, "mkpts1": B}, {"mkpts0_f": A, "mkpts1_f": B, "mkpts0_c": B},
                {"pts1": A, "pts2": B}, {"matches": np.hstack([A, B])},
                {"mkpts0": A[None], "mkpts1": B[None]},
                {"keypoints0": A, "keypoints1": B, "batch_indexes": np.zeros(N)},
                {"keypoints0": keypoints0, "keypoints1": keypoints1, "matches": index,
                 "match_confidence": np.ones(N + 2)},
                {"keypoints0": keypoints0, "keypoints1": keypoints1, "matches": pairs,
                 "scores": np.ones(N)},
                {"kpts0": keypoints0, "kpts1": keypoints1, "matches0": index[:, None]}):
            for compressed in (False, True):
                with self.subTest(arrays=list(arrays), compressed=compressed):
                    found = own.read_matches(self.saved(compressed, **arrays))
                    np.testing.assert_array_equal(found.pixels0, A)
                    np.testing.assert_array_equal(found.pixels1, B)
        self.assertEqual(own.read_matches(self.saved(mkpts0=A, mkpts1=B, d=A)).left_out, ["d"])

    def test_tables(self):
        rows = [*map(list, np.hstack([A, B]))]
        text = "".join(" ".join(map(repr, map(float, row))) + " 0.25\n" for row in rows)
        found = own.read_matches(self.write("a.txt", "# mine\n" + text))
        np.testing.assert_array_equal(found.pixels1, B)
        np.testing.assert_array_equal(found.ratios, np.full(N, 0.75, np.float32))
        named = "ratio,x1,y1,x0,y0,other\n0.5,3,4,1,2,z\n"
        found = own.read_matches(self.write("a.csv", named))
        self.assertEqual((found.pixels0.tolist(), found.ratios.tolist(), found.left_out),
                         ([[1, 2]], [0.5], ["other"]))
        found = own.read_matches(self.write("a.csv", "x1;y1;x2;y2\n1;2;3;4\n"))
        self.assertEqual((found.pixels0.tolist(), found.pixels1.tolist()), ([[1, 2]], [[3, 4]]))
        for words, text in ((("line 1", "y1"), "x0,y0,x1\n1,2,3\n"),
                            (("line 2", "x1"), "1 2 3 4\n1 2 x 4\n"),
                            (("no match",), "#\n")):
            self.refused(self.write("a.csv", text), *words)

    def test_what_is_not_understood_is_named(self):
        nan = B.copy()
        nan[3, 0] = np.nan
        far = B.copy()
        far[4] = 900, 1
        for words, arrays in (
                (("match 3", "not finite"), {"mkpts0": A, "mkpts1": nan}),
                (("match 4", "(900, 1)", "320x320"), {"mkpts0": A, "mkpts1": far}),
                (("normalised",), {"mkpts0": A / 320, "mkpts1": B / 320}),
                (("normalised", "image 1"), {"mkpts0": A, "mkpts1": B / 320}),
                (("matched smaller",), {"mkpts0": A / 2, "mkpts1": B / 2}),
                (("shapes",), {"mkpts0": A, "mkpts1": B[:3]}),
                (("mkpts0", "(n, 2)"), {"mkpts0": A.T, "mkpts1": B}),
                (("without matches",), {"keypoints0": A, "keypoints1": B}),
                (("index 30",), {"keypoints0": A, "keypoints1": B, "matches": [[0, N]]}),
                (("scores", "(3,)"), {"mkpts0": A, "mkpts1": B, "scores": np.ones(3)}),
                (("score of match 0",), {"mkpts0": A, "mkpts1": B, "conf": np.full(N, np.nan)}),
                (("pickled",), {"mkpts0": np.array([None]), "mkpts1": B}),
                (("docs/formats.md",), {"descriptors": A})):
            with self.subTest(words=words):
                self.refused(self.saved(**arrays), *words)
        path = self.path("own.h5")
        for words, data in ((("HDF5",), b"\x89HDF\r\n"), (("pickled",), b"\x80\x04"),
                            (("damaged",), b"PK\x03\x04 no archive")):
            with open(path, "wb") as file:
                file.write(data)
            self.refused(path, *words)

    def test_exchanged_sides_are_refused_where_the_pictures_tell(self):
        picture = np.random.default_rng(1).integers(0, 256, (320, 340))
        images = [picture[:, :320], picture[:, 9:329]]  # what is at x is at x - 9 in the second
        own.require_order(A, B, images, "a.npz")
        with self.assertRaisesRegex(own.Refused, "a.npz: .* sides are exchanged"):
            own.require_order(B, A, images, "a.npz")
        own.require_order(B, A, [np.zeros((320, 320))] * 2, "plain pictures tell nothing")

    def test_a_folder_of_files(self):
        for name in ("m/a_b_matches.npz", "m/x-y-0.png_x-z-1.png.csv", "m/deep/c_d.txt",
                     "m/notes.md"):
            self.write(name, "1 2 3 4\n")
        folder = own.MatchFolder(self.path("m"))
        self.assertEqual(os.path.basename(folder.find("a.png", "b.png")[0]), "a_b_matches.npz")
        self.assertTrue(folder.find("b.png", "a.png")[1])
        self.assertTrue(folder.find("x/y-0.png", "x/z-1.png")[0])
        self.assertTrue(folder.find("deep/c.png", "deep/d.png")[0])
        self.assertEqual(folder.find("a.png", "q.png"), (None, False))
        with self.assertRaisesRegex(own.Refused, "as well as"):
            folder.find("a.jpg", "b.jpg")
        self.write("m/a-b.npz", "1 2 3 4\n")
        with self.assertRaisesRegex(own.Refused, "both fit"):
            own.MatchFolder(self.path("m")).find("a.png", "b.png")

    def test_poses(self):
        poses = own.read_poses(self.write("p.txt", "a b 1 0 0 -1 0 1 0 0 0 0 1 2\nc d\n"))
        R, t = own.pose_of_pair(poses, "b", "a")
        self.assertEqual((R.tolist(), t.tolist()), (np.eye(3).tolist(), [1, 0, -2]))
        self.assertIsNone(own.pose_of_pair(poses, "c", "d"))
        for words, text in (("3 numbers", "a b 1 2 3\n"),
                            ("reflection", "a b 1 0 0 0 0 1 0 0 0 0 -1 0\n"),
                            ("already", "a b\nb a\n"), ("no finite", "a b " + "nan " * 12)):
            with self.assertRaisesRegex(own.Refused, f"line [12].*{words}"):
                own.read_poses(self.write("p.txt", text))


class Report(unittest.TestCase):
    def test_own_systems_are_rows_and_tables_and_figures_are_files(self):
        support.skip_without("poselib")
        draws = importlib.util.find_spec("matplotlib") is not None
        with tempfile.TemporaryDirectory() as folder:
            pairs = support.write(folder, "pairs.txt", f"{support.LINE} {support.TRUTH}\n")
            os.mkdir(os.path.join(folder, "net"))
            # Exact matches of the rectified pair: one row of pixels for each disparity.
            x, y = RANDOM.uniform(120, 700, 200), RANDOM.uniform(10, 480, 200)
            depth = RANDOM.uniform(15, 60, 200)
            left = np.column_stack([x, y])
            right = np.column_stack([x - 994.978 / depth + 31.086, y])
            half = [(pixels + 0.5) / 2 - 0.5 for pixels in (left, right)]
            np.savez(os.path.join(folder, "net", "motorcycle_left_motorcycle_right.npz"),
                     mkpts0=half[0], mkpts1=half[1], descriptors0=left)
            own_file = support.write(
                folder, "mine.txt", " ".join([*support.IMAGES, "1 0 0 -1 0 1 0 0 0 0 1 0\n"]))
            out = os.path.join(folder, "report")
            words = (pairs, "--images", support.MOTORCYCLE, "-o", out, "--quiet", "--systems",
                     "twoview,twoview_five_point,poselib_solver,twoview_linear_ls")
            for bad, message in ((("--matches", "nothing"), "is no folder"),
                                 (("--poses", "twoview=" + own_file), "another name"),
                                 (("--matches-resize", "640"), "with a folder"),
                                 (("--figures", "bmp"), "svg, pdf, png"),
                                 (("--tables", "csv", "--figures", "svg" if not draws else "x"),
                                  "matplotlib" if not draws else "svg, pdf, png")):
                done = support.run(*words, *bad)
                self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
                self.assertIn(message, done.stderr)
            done = support.run(*words, "--matches", os.path.join(folder, "net"), "--poses",
                               "hand=" + own_file, "--matches-resize", 741 // 2 + 1,
                               "--tables", "csv,tex",
                               *(("--figures", "svg,pdf") if draws else ()))
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(os.path.join(out, "report.json"), encoding="utf-8") as f:
                report = json.load(f)
            rows = report["pairs"][0]["rows"]
            self.assertEqual(set(rows["pipeline"]), {"twoview", "net", "hand"})
            self.assertEqual(rows["pipeline"]["hand"]["pose_error_deg"], 0)
            self.assertIsNone(rows["pipeline"]["hand"]["time_ms"])
            self.assertEqual(rows["pipeline"]["net"]["num_matches"], 200)
            self.assertEqual(rows["pipeline"]["net"]["message"], "not used: descriptors0")
            for row in (rows["pipeline"]["net"], *rows["solver"].values()):
                self.assertLess(row["pose_error_deg"], 0.5, row)
                self.assertEqual(row["num_matches"], 200)
            self.assertEqual(rows["triangulation"]["twoview_linear_ls"]["status"], "ok")
            # A mask leaves out your matches on its black pixels, too.
            import cv2
            mask = np.full((500, 741), 255, np.uint8)
            mask[:, :400] = 0
            cv2.imwrite(os.path.join(folder, "mask.png"), mask)
            masked = support.run(*words[:3], "-o", os.path.join(folder, "masked"), "--quiet",
                                 "--systems", "twoview_five_point", "--matches",
                                 os.path.join(folder, "net"), "--matches-resize", 741 // 2 + 1,
                                 "--mask", os.path.join(folder, "mask.png"))
            self.assertEqual(masked.returncode, 0, masked.stderr)
            with open(os.path.join(folder, "masked", "report.json"), encoding="utf-8") as f:
                row = json.load(f)["pairs"][0]["rows"]["pipeline"]["net"]
            self.assertEqual(row["num_matches"],
                             int(((left[:, 0] > 399.5) & (right[:, 0] > 399.5)).sum()))
            with open(os.path.join(out, "index.html"), encoding="utf-8") as f:
                page = f.read()
            self.assertIn("Solvers on identical matches, those of net", page)
            with open(os.path.join(out, "systems.csv"), encoding="utf-8") as f:
                lines = f.read().splitlines()
            count = len(report["systems"])
            self.assertEqual(len(lines), 1 + count)
            self.assertTrue(lines[0].startswith("system,name,version,kind,set,pairs,auc_5,"))
            with open(os.path.join(out, "systems.tex"), encoding="utf-8") as f:
                tex = f.read()
            self.assertEqual(tex.count(r"\begin{tabular}"), 2)
            self.assertEqual(tex.count(r" \\"), 2 + count)
            self.assertIn(r"\textbf{100.0}", tex)
            if not draws:
                return
            figures = os.listdir(os.path.join(out, "figures"))
            self.assertIn("recall_of_the_pipelines.svg", figures)
            self.assertEqual(sum(f.endswith(".pdf") for f in figures), len(figures) // 2)

    def test_exchanged_sides_are_a_failure_with_a_reason(self):
        support.skip_without()
        import cv2
        sift = cv2.SIFT_create(300)
        images = [cv2.imread(os.path.join(support.MOTORCYCLE, name), 0) for name in support.IMAGES]
        (k0, d0), (k1, d1) = (sift.detectAndCompute(image, None) for image in images)
        matches = cv2.BFMatcher(crossCheck=True).match(d0, d1)
        with tempfile.TemporaryDirectory() as folder:
            np.savez(os.path.join(folder, "motorcycle_left_motorcycle_right.npz"),
                     mkpts0=[k1[m.trainIdx].pt for m in matches],
                     mkpts1=[k0[m.queryIdx].pt for m in matches])
            pairs = support.write(folder, "pairs.txt", f"{support.LINE} {support.TRUTH}\n")
            done = support.run(pairs, "--images", support.MOTORCYCLE, "-o",
                               os.path.join(folder, "out"), "--quiet", "--systems",
                               "twoview_five_point", "--matches", "net=" + folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(os.path.join(folder, "out", "report.json"), encoding="utf-8") as f:
                row = json.load(f)["pairs"][0]["rows"]["pipeline"]["net"]
            self.assertEqual(row["status"], "failed")
            self.assertIn("sides are exchanged", row["message"])


if __name__ == "__main__":
    unittest.main()
