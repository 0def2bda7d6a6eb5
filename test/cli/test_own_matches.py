#!/usr/bin/env python3
"""Tests of matches and poses by other programs: --matches of reconstruct and evaluate, --poses of
evaluate. The matches are exact pixels of the rendered pair, written as the common matchers write
them, with Python's standard library alone."""
import csv
import io
import json
import random
import shutil
import struct
import unittest
import zipfile

import cli_support as cli
from cli_support import HEIGHT, WIDTH
from test_evaluate import SIDEWAYS, pair_line

COUNT, NUM_WRONG = 120, 20


def matched():
    """[(x0, y0, x1, y1)] of the pair that the tests render, of which the first NUM_WRONG are
    wrong."""
    rng = random.Random(5)
    rows = []
    for i in range(COUNT):
        x, y = rng.uniform(60, WIDTH - 5), rng.uniform(5, HEIGHT - 5)
        shift = cli.FOCAL / cli.true_depth(x, y)
        wrong = rng.uniform(8, 25) if i < NUM_WRONG else 0
        rows.append((x, y, x - shift, min(max(y + wrong, 0), HEIGHT - 1)))
    return rows


def npy(values, shape, kind="f4", fortran=False, order="<"):
    """A .npy file's bytes."""
    letter = {"f2": "e", "f4": "f", "f8": "d", "i4": "i", "i8": "q", "u1": "B", "b1": "?"}[kind]
    header = (f"{{'descr': '{'|' if kind[1] == '1' else order}{kind}', "
              f"'fortran_order': {fortran}, 'shape': ({', '.join(map(str, shape))},), }}")
    header = header.ljust(117) + "\n"
    data = struct.pack(f"{order}{len(values)}{letter}", *values)
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data


def npz(compression=zipfile.ZIP_STORED, ending=".npy", **arrays):
    """A .npz file's bytes, as numpy.savez and savez_compressed write them."""
    text = io.BytesIO()
    with zipfile.ZipFile(text, "w", compression) as archive:
        for name, data in arrays.items():
            with archive.open(name + ending, "w", force_zip64=True) as member:
                member.write(data)
    return text.getvalue()


def points(rows, image, **options):
    values = [value for row in rows for value in row[2 * image:2 * image + 2]]
    return npy(values, (len(rows), 2), **options)


class OwnMatches(cli.CliTest):
    rows = matched()

    def pose(self, data, *more, name="own.npz", status=0):
        path = self.write(name, data)
        done = self.succeed(self.reconstruct("--matches", path, *more), status)
        return self.result(), done

    def assert_right(self, result, count=COUNT):
        self.assertEqual(result["num_matches"], count)
        self.assertGreaterEqual(result["num_inliers"], 0.75 * count)
        self.assertLessEqual(result["num_inliers"], count - NUM_WRONG + 8)
        self.assertLess(result["t"][0], -0.99)

    def assert_equal_poses(self, found):
        """Equal but for the order in which matches of equal scores, or without any, are taken."""
        for pose in found:
            for one, other in zip(pose, found[0]):
                self.assertAlmostEqual(one, other, delta=1e-6)

    def refused(self, data, *words, more=(), name="own.npz"):
        path = self.write(name, data)
        self.assert_refused(self.reconstruct("--matches", path, *more), name, *words)

    def indexed(self):
        """Keypoints in another order than the matches, and some without one; the index of the
        keypoint in image 1 of each in image 0, or -1."""
        rng = random.Random(6)
        order = [list(range(COUNT)), list(range(COUNT))]
        for indices in order:
            rng.shuffle(indices)
        extra = [(10.0, 10.0, 20.0, 20.0)] * 7
        views = [[self.rows[i] for i in indices] + extra for indices in order]
        place = {match: at for at, match in enumerate(order[1])}
        return views, [place[match] for match in order[0]] + [-1] * len(extra)

    def test_matched_pixels_of_the_common_matchers(self):
        a, b = points(self.rows, 0), points(self.rows, 1)
        score = npy([0.5] * COUNT, (COUNT,))
        deflated = zipfile.ZIP_DEFLATED
        found = []
        for what, data in (
                ("mkpts", npz(mkpts0=a, mkpts1=b)),
                ("LoFTR", npz(deflated, mkpts0_f=a, mkpts1_f=b, mconf=score, mkpts0_c=a)),
                ("kornia", npz(keypoints0=a, keypoints1=b, confidence=score,
                               batch_indexes=npy([0] * COUNT, (COUNT,), "i8"))),
                ("from 1", npz(pts1=a, pts2=b)),
                ("batch", npz(mkpts0=npy([v for r in self.rows for v in r[:2]], (1, COUNT, 2)),
                              mkpts1=b, scores=npy([0.5] * COUNT, (1, COUNT)))),
                ("vismatch", npz(matched_kpts0=a, matched_kpts1=b, inlier_kpts0=a)),
                ("rows", npz(matches=npy([v for r in self.rows for v in r], (COUNT, 4)))),
                ("npy", npy([v for r in self.rows for v in (*r, 0.5)], (COUNT, 5)))):
            with self.subTest(what=what):
                result, done = self.pose(data)
                self.assert_right(result)
                found.append(result["R"] + result["t"])
                unused = {"LoFTR": b"mkpts0_c", "vismatch": b"inlier_kpts0"}.get(what)
                self.assertEqual(b"not used" in done.stdout, unused is not None)
                self.assertIn(unused or b"", done.stdout)
        self.assert_equal_poses(found)

    def test_keypoints_with_indices(self):
        (view0, view1), index = self.indexed()
        k0, k1 = points(view0, 0), points(view1, 1)
        pairs = [v for i, j in enumerate(index) if j >= 0 for v in (i, j)]
        n = len(view0)
        found = []
        for what, data in (
                ("SuperGlue", npz(keypoints0=k0, keypoints1=k1, matches=npy(index, (n,), "i8"),
                                  match_confidence=npy([0.5] * n, (n,)))),
                ("LightGlue", npz(keypoints0=k0, keypoints1=k1,
                                  matches=npy(pairs, (COUNT, 2), "i8"),
                                  scores=npy([0.5] * COUNT, (COUNT,)))),
                ("matches0", npz(zipfile.ZIP_DEFLATED, keypoints0=k0, keypoints1=k1,
                                 matches0=npy(index, (n,), "i4"),
                                 matching_scores0=npy([0.5] * n, (n,), "f2"))),
                ("kpts", npz(kpts0=k0, kpts1=k1, matches=npy(pairs, (COUNT, 2), "i4", order=">")))):
            with self.subTest(what=what):
                result, _ = self.pose(data)
                self.assert_right(result)
                found.append(result["R"] + result["t"])
        self.assert_equal_poses(found)

    def test_types_and_orders_of_arrays(self):
        flat = [v for row in self.rows for v in row]
        columns = [row[i] for i in range(4) for row in self.rows]
        whole = [round(v) for v in flat]
        for data in (npy(flat, (COUNT, 4), "f8"), npy(flat, (COUNT, 4), "f8", order=">"),
                     npy(columns, (COUNT, 4), "f8", fortran=True)):
            result, _ = self.pose(data, name="own.npy")
            self.assert_right(result)
        self.assertEqual(self.pose(npy(whole, (COUNT, 4), "i8"))[0]["num_matches"], COUNT)

    def test_tables(self):
        lines = ["x0,y0,x1,y1,score"] + [",".join(map(repr, (*row, 0.5))) for row in self.rows]
        exact, _ = self.pose("\n".join(lines), name="own.csv")
        self.assert_right(exact)
        from_one = "\n".join([lines[0].replace("x1", "x2").replace("y1", "y2")
                              .replace("x0", "x1").replace("y0", "y1"), *lines[1:]])
        plain = "\n".join(["# by hand", *lines[1:]]).replace(",", " ")
        for text in (from_one, plain):
            result, _ = self.pose(text, name="own.txt")
            self.assertEqual((result["R"], result["t"]), (exact["R"], exact["t"]))
        self.assertEqual(exact["options"]["matches"], str(self.folder / "own.csv"))
        self.assertEqual(self.listing(), cli.RESULT_FILES)

    def test_scores_say_which_matches_are_sampled_first(self):
        """With one sample, right matches alone are sampled where their scores are higher."""
        scores = [0.1] * NUM_WRONG + [0.9] * (COUNT - NUM_WRONG)
        flat = lambda values: npy([v for r, s in zip(self.rows, values) for v in (*r, s)],
                                  (COUNT, 5), "f8")
        result, _ = self.pose(flat(scores), "--fixed-iterations", "3", name="own.npy")
        self.assert_right(result)
        result, _ = self.pose(flat([7 * s - 3 for s in scores]), "--fixed-iterations", "3",
                              name="own.npy")
        self.assert_right(result)

    def test_what_is_not_understood_is_named(self):
        a, b = points(self.rows, 0), points(self.rows, 1)
        moved = lambda i, value: points([(*r[:2], value, r[3]) if k == i else r
                                         for k, r in enumerate(self.rows)], 1)
        n = COUNT
        scores = npy([0.5] * (n - 1), (n - 1,))
        for words, data in (
                (("match 7", "not finite", "image 1"),
                 npz(mkpts0=a, mkpts1=moved(7, float("nan")))),
                (("match 9", "(900, ", f"{WIDTH}x{HEIGHT}"), npz(mkpts0=a, mkpts1=moved(9, 900))),
                (("mkpts0 and mkpts1", f"({n}, 2)", "(3, 2)"),
                 npz(mkpts0=a, mkpts1=points(self.rows[:3], 1))),
                (("mkpts1", "(2, 120)"), npz(mkpts0=a, mkpts1=npy([1] * 240, (2, 120)))),
                (("scores", f"({n - 1},)"), npz(mkpts0=a, mkpts1=b, scores=scores)),
                (("score of match 3", "not finite"),
                 npz(mkpts0=a, mkpts1=b,
                     scores=npy([1, 1, 1, float("inf")] + [1] * (n - 4), (n,)))),
                (("without matches",), npz(keypoints0=a, keypoints1=b)),
                (("index 120", f"{n} keypoints"),
                 npz(keypoints0=a, keypoints1=b, matches=npy([0, n], (1, 2), "i8"))),
                (("index -2",), npz(keypoints0=a, keypoints1=b,
                                    matches0=npy([-2] * n, (n,), "i8"))),
                (("index 0.5",), npz(keypoints0=a, keypoints1=b,
                                     matches=npy([0, 0.5], (1, 2)))),
                (("no match",),
                 npz(keypoints0=a, keypoints1=b, matches0=npy([-1] * n, (n,), "i8"))),
                (("descriptors, keypoints", "docs/formats.md"), npz(descriptors=a, keypoints=b)),
                (("(120, 3)",), npy([1] * 360, (n, 3))),
                (("damaged",), npz(mkpts0=a, mkpts1=b)[:-40]),
                (("damaged", "mkpts0"), npz(mkpts0=a, mkpts1=b).replace(a[200:220], b"x" * 20)),
                (("HDF5", "numpy.savez"), b"\x89HDF\r\n\x1a\n" + bytes(80)),
                (("torch.save",), npz(ending="", **{"archive/data.pkl": b"x"})),
                (("pickled",), b"\x80\x04\x95" + bytes(80)),
                (("pickled objects",), npz(mkpts0=a.replace(b"<f4", b"|O8"), mkpts1=b))):
            with self.subTest(words=words):
                self.refused(data, *words)
        self.refused("x0 y0 x1\n1 2 3\n", "line 1", "y1", name="own.csv")
        self.refused("1 2 3 4\n1 2 x 4\n", "line 2", "x1", name="own.csv")
        self.refused("x0 y0 x1 y1 score\n1 2 3 4 -\n", "line 2", "score", name="own.csv")

    def test_exchanged_sides_are_refused_since_the_pictures_do_not_agree(self):
        a, b = points(self.rows, 0), points(self.rows, 1)
        self.refused(npz(mkpts0=b, mkpts1=a), "look alike", "sides are exchanged")

    def test_pixels_that_were_meant_in_another_way_are_refused_by_that(self):
        inside = [r for r in self.rows if max(r) < HEIGHT]
        below = HEIGHT - 1
        for words, rows in (
                (("row and column", "in both"), [(r[1], r[0], r[3], r[2]) for r in inside]),
                (("row and column", "image 1"), [(r[0], r[1], r[3], r[2]) for r in inside]),
                (("lower edge", "in both"),
                 [(r[0], below - r[1], r[2], below - r[3]) for r in self.rows]),
                (("smaller pictures in both", "--matches-resize"),
                 [tuple(0.8 * v for v in r) for r in self.rows]),
                (("smaller pictures in image 0",), [(0.9 * r[0], 0.9 * r[1], *r[2:])
                                                    for r in self.rows])):
            with self.subTest(words=words):
                self.refused(npz(mkpts0=points(rows, 0), mkpts1=points(rows, 1)), "look alike",
                             *words)

    def test_pixels_of_pictures_that_were_cut_or_framed_are_refused_by_that(self):
        zoom, middle = 1.15, (100, 20)  # a wall that comes nearer, which the camera does not face
        small = cli.texture(WIDTH // 2, HEIGHT // 2)
        wall = [bytes(small[y // 2][x // 2] for x in range(WIDTH)) for y in range(HEIGHT)]

        def from_near(at, k):
            return round(middle[k] + (at - middle[k]) / zoom)

        near = [bytes(wall[from_near(y, 1)][from_near(x, 0)] for x in range(WIDTH))
                for y in range(HEIGHT)]
        for name, rows in (("a.png", wall), ("b.png", near)):
            self.write(name, cli.png(WIDTH, HEIGHT, b"".join(rows)))
        rng = random.Random(2)
        places = [(rng.uniform(40, WIDTH - 60), rng.uniform(30, HEIGHT - 45)) for _ in range(150)]
        given = [(x, y, middle[0] + zoom * (x - middle[0]), middle[1] + zoom * (y - middle[1]))
                 for x, y in places]
        for words, rows in (
                (("cut or framed",),  # bars above and below, which move this wall as a shift does
                 [(r[0], 0.75 * r[1] + HEIGHT / 8, r[2], 0.75 * r[3] + HEIGHT / 8)
                  for r in given]),
                (("cut or framed", "(24, 16) pixels"),  # by steps of 4 pixels
                 [r for r in ((r[0] - 28, r[1] - 16, r[2] - 28, r[3] - 16) for r in given)
                  if min(r) >= 0])):
            with self.subTest(words=words):
                self.refused(npz(mkpts0=points(rows, 0), mkpts1=points(rows, 1)), "look alike",
                             *words)

    def test_pixels_at_which_the_pictures_are_not_alike_are_noted(self):
        for cut, noted in ((0, False), (30, True)):
            rows = [(r[0] - cut, *r[1:]) for r in self.rows]
            path = self.write("own.npz", npz(mkpts0=points(rows, 0), mkpts1=points(rows, 1)))
            done = self.reconstruct("--matches", path)
            self.assertIn(done.returncode, (0, 3))
            self.assertEqual(b"alike at few of the matches" in b" ".join(done.stdout.split()),
                             noted)

    def test_normalised_coordinates_are_refused(self):
        for scale in (1 / WIDTH, 1 / cli.FOCAL, 2 / WIDTH):
            rows = [tuple(scale * v for v in row) for row in self.rows]
            self.refused(npz(mkpts0=points(rows, 0), mkpts1=points(rows, 1)), "normalised")
            self.refused(npz(mkpts0=points(self.rows, 0), mkpts1=points(rows, 1)), "normalised",
                         "image 1")

    def test_matches_of_smaller_pictures(self):
        half = [tuple((v + 0.5) / 2 - 0.5 for v in row) for row in self.rows]
        data = npz(mkpts0=points(half, 0, kind="f8"), mkpts1=points(half, 1, kind="f8"))
        self.refused(data, "right or the lower half", "--matches-resize")
        exact, _ = self.pose(npz(mkpts0=points(self.rows, 0, kind="f8"),
                                 mkpts1=points(self.rows, 1, kind="f8")))
        result, _ = self.pose(data, "--matches-resize", WIDTH // 2)
        for mine, other in zip(result["R"] + result["t"], exact["R"] + exact["t"]):
            self.assertAlmostEqual(mine, other, delta=1e-5)
        self.assertEqual(result["options"]["matches_resize"], WIDTH // 2)
        self.assertNotEqual(self.reconstruct("--matches", "own.npz", "--matches-resize", "0")
                            .returncode, 2)

    def test_options_of_our_own_matching_are_refused(self):
        path = self.write("own.npz", npz(mkpts0=points(self.rows, 0), mkpts1=points(self.rows, 1)))
        for more in (("--ratio", "0.8"), ("--max-keypoints", "100"), ("--guided-matching", "1"),
                     ("--bundle-adjustment", "1"), ("--mask", self.a)):
            self.assert_refused(self.reconstruct("--matches", path, *more), more[0], "--matches")
        self.assert_refused(self.reconstruct("--matches-resize", "9"), "--matches")
        self.assert_refused(self.reconstruct("--matches", "none.npz"), "none.npz")

    def test_without_cameras_there_is_a_fundamental_matrix(self):
        path = self.write("own.npz", npz(mkpts0=points(self.rows, 0), mkpts1=points(self.rows, 1)))
        self.succeed(self.reconstruct("--matches", path, "--method", "eight-point",
                                      camera=False), 3)
        self.assertIsNotNone(self.result()["F"])


class Evaluate(cli.CliTest):
    rows = matched()

    def evaluate(self, *more, text=None):
        pairs = self.write("set/pairs.txt", text or pair_line() + pair_line("b.png", "a.png",
                                                                            T=self.back()))
        return self.run_program("evaluate", pairs, "--images", self.folder, "-o", self.out, *more)

    @staticmethod
    def back():
        backwards = list(SIDEWAYS)
        backwards[3] = 1
        return backwards

    def report(self):
        return json.loads((self.out / "report.json").read_text())

    def save(self, name, rows=None):
        rows = rows or self.rows
        self.write(name, npz(mkpts0=points(rows, 0), mkpts1=points(rows, 1)))

    def test_a_file_a_pair_of_either_order(self):
        for name in ("a_b_matches.npz", "a-b.npz", "deep/a.png_b.png.npz", "b_a.npz"):
            with self.subTest(name=name):
                shutil.rmtree(self.folder / "m", ignore_errors=True)
                exchanged = name.startswith("b")
                self.save("m/" + name, [(*r[2:], *r[:2]) for r in self.rows] if exchanged else None)
                if name.startswith("deep"):
                    self.assertEqual(self.evaluate("--matches", "m").returncode, 2)
                    continue
                self.succeed(self.evaluate("--matches", "m"))
                for pair in self.report()["pairs"]:
                    self.assertEqual(pair["num_matches"], COUNT)
                    self.assertLess(pair["translation_error_signed_deg"], 0.5)
                    self.assertAlmostEqual(pair["precision"], 1 - NUM_WRONG / COUNT, delta=0.08)
        self.assertEqual(self.report()["options"]["matches"], "m")

    def test_a_pair_without_a_file_has_failed(self):
        self.save("m/a_b.npz")
        line = pair_line() + pair_line("a.png", "a.png")
        self.succeed(self.evaluate("--matches", "m", text=line))
        pairs = self.report()["pairs"]
        self.assertIn("no file of matches for a.png and a.png", pairs[1]["error"])
        self.assertNotIn("error", pairs[0])

    def test_bad_folders_and_files_are_named(self):
        self.assert_refused(self.evaluate("--matches", self.a), "is not a folder")
        (self.folder / "empty").mkdir()
        self.assert_refused(self.evaluate("--matches", "empty"), "no file of matches")
        self.save("two/a_b.npz")
        self.save("two/a-b.npz")
        self.assert_refused(self.evaluate("--matches", "two"), "a-b.npz and a_b.npz both fit")
        self.write("bad/a_b.csv", "1 2 3\n")
        self.assert_refused(self.evaluate("--matches", "bad"), "a_b.csv", "line 1")

    def test_own_poses_are_a_row(self):
        self.write("good.txt", "# mine\na.png b.png 1 0 0 -1  0 1 0 0  0 0 1 0\n")
        self.write("other.csv", "a.png,b.png\nb.png,a.png,"
                                "1,0,0,0,0,1,0,0,0,0,1,1,0,0,0,1\n")
        text = pair_line() + pair_line("b.png", "b.png")
        self.assert_refused(self.evaluate("--poses", "other.csv"), "line 2", "already")
        self.write("other.csv", "a.png,b.png\nb.png,b.png,1,0,0,0,0,1,0,0,0,0,1,1,0,0,0,1\n")
        done = self.succeed(self.evaluate("--poses", "good.txt", "--poses", "net=other.csv",
                                          text=text))
        report = self.report()
        good, net = report["systems"]
        self.assertEqual((good["name"], good["num_without_pose"], good["num_pairs"]),
                         ("good", 1, 2))
        self.assertEqual((net["name"], net["num_without_pose"]), ("net", 1))
        self.assertAlmostEqual(good["auc"]["5"], 50, delta=1e-9)
        self.assertEqual(report["pairs"][0]["systems"]["good"]["pose_error_deg"], 0)
        self.assertIsNone(report["pairs"][0]["systems"]["net"]["pose_error_deg"])
        self.assertEqual(report["pairs"][1]["systems"]["net"]["translation_error_deg"], 90)
        self.assertIn(b"good        at 5, 10, 20 deg:  50.0  50.0  50.0 %", done.stdout)
        # The inverse serves the pair in the other order.
        self.succeed(self.evaluate("--poses", "good.txt"))
        self.assertEqual(self.report()["systems"][0]["auc_signed"]["5"], 100)

    def test_tables_for_a_paper(self):
        self.write("a_1.txt", "a.png b.png 1 0 0 -1  0 1 0 0  0 0 1 0\n")
        text = pair_line() + pair_line(name1="none.png")
        self.succeed(self.evaluate("--poses", "a_1.txt", "--tables", text=text))
        self.assertEqual(self.listing(), ["pairs.csv", "report.json", "systems.csv", "systems.tex"])
        rows = list(csv.DictReader((self.out / "pairs.csv").read_text().splitlines()))
        pairs = self.report()["pairs"]
        self.assertEqual(float(rows[0]["pose_error_deg"]), pairs[0]["pose_error_deg"])
        self.assertEqual(rows[0]["pose_error_deg a_1"], "0.0")
        self.assertEqual((rows[1]["pose_error_deg"], rows[1]["error"]), ("", pairs[1]["error"]))
        systems = list(csv.DictReader((self.out / "systems.csv").read_text().splitlines()))
        self.assertEqual([s["system"] for s in systems], ["twoview", "a_1"])
        self.assertEqual([s["num_without_pose"] for s in systems], ["1", "1"])
        self.assertEqual(float(systems[1]["auc_20"]), 50)
        tex = (self.out / "systems.tex").read_text()
        best = "\\textbf{50.0} & " * 3
        self.assertIn("a\\_1 & " + best + "-- & 1 \\\\\n", tex)

    def test_bad_poses_are_named(self):
        for text, *words in (
                ("a.png b.png 1 2 3\n", "line 1", "3 numbers"),
                ("a.png b.png 1.1 0 0 0 0 1 0 0 0 0 1 1\n", "line 1", "no rotation"),
                ("\na.png b.png 1 0 0 0 0 1 0 0 0 0 -1 1\n", "line 2", "reflection"),
                ("a.png b.png 1 0 0 nan 0 1 0 0 0 0 1 1\n", "line 1", "nan"),
                ("a.png\n", "line 1", "two names"),
                ("# nothing\n", "no pair in it"),
                ("x.png y.png\n", "no pair of")):
            with self.subTest(text=text):
                self.write("p.txt", text)
                self.assert_refused(self.evaluate("--poses", "p.txt"), "p.txt", *words)
        self.write("p.txt", "a.png b.png\n")
        self.assert_refused(self.evaluate("--poses", "p.txt", "--poses", "p.txt"), "two systems")


if __name__ == "__main__":
    cli.main()
