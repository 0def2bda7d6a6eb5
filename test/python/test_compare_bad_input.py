"""Tests of compare_colmap: broken lists, missing images, and systems that die."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import compare_support as support


def setUpModule():
    support.skip_without()


class BadInputTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.out = os.path.join(self.folder.name, "report")

    def list_of(self, *lines):
        return support.write(self.folder.name, "pairs.txt", "\n".join(lines) + "\n")

    def compare(self, pairs, *words, **keywords):
        return support.run(pairs, "--images", support.MOTORCYCLE, "-o", self.out, *words,
                           **keywords)

    def report(self):
        with open(os.path.join(self.out, "report.json"), encoding="utf-8") as f:
            return json.load(f)

    def refused(self, done, *words):
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)
        self.assertFalse(os.path.exists(os.path.join(self.out, "report.json")))


class TestLists(BadInputTest):
    def test_a_broken_line_is_named_by_its_number(self):
        good = f"{support.LINE} {support.TRUTH}"
        for broken, what in ((good.rsplit(" ", 1)[0], "37 fields"),
                             (good.replace("994.978", "994,978", 1), "'994,978'"),
                             (good.replace("1 0 0 -1", "2 0 0 -1"), "rotation"),
                             (good.replace(" 0 0 994", " 0 1 994", 1), "turned"),
                             (good.replace("994.978", "-5", 1), "K0")):
            with self.subTest(what=what):
                pairs = self.list_of("# a comment", good, "", broken)
                self.refused(self.compare(pairs), f"{pairs}: line 4: ", what)

    def test_no_list_and_no_pair(self):
        self.refused(self.compare(os.path.join(self.folder.name, "none.txt")), "none.txt")
        self.refused(self.compare(self.list_of("# nothing")), "no pair in it")

    def test_a_mask_leaves_keypoints_out_of_every_pipeline(self):
        import cv2
        import numpy as np
        shape = cv2.imread(os.path.join(support.MOTORCYCLE, support.IMAGES[0])).shape[:2]
        half = np.full(shape, 255, np.uint8)
        half[:, :shape[1] // 2] = 0
        masks = os.path.join(self.folder.name, "masks")
        os.mkdir(masks)
        for name in support.IMAGES:
            cv2.imwrite(os.path.join(masks, name + ".png"), half)
        pairs = self.list_of(f"{support.LINE} {support.TRUTH}")
        systems = ("--systems", "twoview,opencv_fast,opencv_sift", "--quiet")
        rows = []
        for words in ((), ("--mask", masks), ("--mask", f"{masks}/{support.IMAGES[0]}.png")):
            done = self.compare(pairs, *systems, *words)
            self.assertEqual(done.returncode, 0, done.stderr)
            report = self.report()
            self.assertEqual(report["options"]["mask"], words[-1] if words else None)
            rows.append(report["pairs"][0]["rows"]["pipeline"])
        for system, whole in rows[0].items():
            self.assertEqual(rows[1][system]["num_keypoints"], rows[2][system]["num_keypoints"])
            if system == "twoview":  # takes as many of what is left
                self.assertNotEqual(rows[1][system]["num_matches"], whole["num_matches"])
                continue
            for left, all_of_it in zip(rows[1][system]["num_keypoints"], whole["num_keypoints"]):
                self.assertTrue(0.2 < left / all_of_it < 0.9, (system, left, all_of_it))
        report = os.path.join(self.out, "report.json")
        os.remove(report)
        os.remove(os.path.join(self.out, "index.html"))
        os.remove(os.path.join(self.out, "pairs.csv"))
        cv2.imwrite(os.path.join(masks, support.IMAGES[1] + ".png"), half[1:])
        self.refused(self.compare(pairs, *systems, "--mask", masks), "--mask", support.IMAGES[1],
                     f"{shape[1]}x{shape[0] - 1}")
        os.remove(os.path.join(masks, support.IMAGES[1] + ".png"))
        self.refused(self.compare(pairs, *systems, "--mask", masks), "has no mask of",
                     support.IMAGES[1])
        self.refused(self.compare(pairs, *systems, "--mask", masks + "/none"), "no such file")

    def test_missing_images_are_named_and_counted(self):
        pairs = self.list_of(support.LINE.replace("left", "lost").replace("right", "gone"))
        self.refused(self.compare(pairs), "motorcycle_lost.png", "and 1 more")

    def test_a_file_that_is_no_image_is_named(self):
        support.write(self.folder.name, "a.png", "not a picture")
        pairs = self.list_of(support.LINE.replace(support.IMAGES[0], "a.png")
                             .replace(support.IMAGES[1], "a.png"))
        self.refused(support.run(pairs, "--images", self.folder.name, "-o", self.out), "a.png")
        self.assertFalse(os.path.exists(self.out))

    def test_a_picture_that_is_not_read_is_named_as_what_it_is(self):
        for name in ("p.heic", "q.heic"):
            support.write(self.folder.name, name, "\0\0\0\x18ftypheic" + 64 * "\0")
        for other, words in (("p.heic", ": it is a HEIC picture, which is not read"),
                             ("q.heic", ", and 1 more: the first is a HEIC picture")):
            pairs = self.list_of(support.LINE.replace(support.IMAGES[0], "p.heic")
                                 .replace(support.IMAGES[1], other))
            done = support.run(pairs, "--images", self.folder.name, "-o", self.out)
            self.refused(done, "p.heic" + words)

    def test_no_folder_of_images(self):
        pairs = self.list_of(support.LINE)
        self.refused(support.run(pairs, "-o", self.out), "images is not a folder")

    def test_options(self):
        pairs = self.list_of(support.LINE)
        self.refused(self.compare(pairs, "--systems", "vlfeat"), "no system 'vlfeat'", "twoview")
        self.refused(self.compare(pairs, "--jobs", 0), "--jobs")
        self.refused(self.compare(pairs, "--jobs", "many"), "--jobs", "--help")
        self.refused(support.run(pairs), "-o/--output", "--help")
        self.refused(self.compare(pairs, "--seed", -1), "--seed")
        support.write(self.folder.name, "report", "")
        done = self.compare(pairs)
        self.assertEqual(done.returncode, 2)
        self.assertIn("is a file", done.stderr)

    def test_an_existing_report_outlives_a_refusal(self):
        os.mkdir(self.out)
        kept = support.write(self.out, "index.html", "the last one")
        self.refused(self.compare(self.list_of("broken")), "line 1")
        with open(kept, encoding="utf-8") as f:
            self.assertEqual(f.read(), "the last one")

    def test_pairs_with_and_without_truth_are_told_apart(self):
        pairs = self.list_of(f"{support.LINE} {support.TRUTH}", support.LINE)
        done = self.compare(pairs, "--systems", "twoview")
        self.assertEqual(done.returncode, 0, done.stderr)
        report = self.report()
        self.assertIn("1 of 2 pairs have one", report["reference_words"])
        known, unknown = (p["rows"]["pipeline"]["twoview"] for p in report["pairs"])
        self.assertLess(known["pose_error_deg"], 1.0)
        self.assertIsNone(unknown["pose_error_deg"])
        self.assertEqual(unknown["status"], "ok")
        system = report["systems"][0]
        self.assertEqual((system["num_pairs"], system["num_scored"], system["failures"]), (2, 1, 0))
        self.assertGreater(system["auc"]["5"], 80.0)

    def test_no_truth_at_all_is_said(self):
        done = self.compare(self.list_of(support.LINE), "--systems", "twoview")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("--reference colmap", done.stderr)
        self.assertIsNone(self.report()["systems"][0]["auc"]["5"])


class TestSystemsThatFail(BadInputTest):
    """A fake COLMAP and a fake PoseLib, which are found before the real ones."""

    def rows(self, systems, *words, **environment):
        pairs = self.list_of(f"{support.LINE} {support.TRUTH}", f"{support.LINE} {support.TRUTH}")
        done = self.compare(pairs, "--systems", systems, *words, environment=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        report = self.report()
        for pair in report["pairs"]:
            self.assertLess(pair["rows"]["pipeline"]["twoview"]["pose_error_deg"], 1.0)
        return report, [p["rows"] for p in report["pairs"]]

    def fake_colmap(self, body):
        support.write(self.folder.name, "colmap", f"#!/bin/sh\n[ $1 = help ] && echo COLMAP 3.8 "
                      f"&& exit 0\n{body}\n", 0o755)
        return f"{self.folder.name}:{os.environ['PATH']}"

    def test_a_program_that_crashes_is_a_row(self):
        report, rows = self.rows("twoview,colmap", PATH=self.fake_colmap("kill -SEGV $$"))
        for row in rows:
            self.assertEqual(row["pipeline"]["colmap"]["status"], "failed")
            self.assertIn("signal 11", row["pipeline"]["colmap"]["message"])
        failures = {s["id"]: s["failures"] for s in report["systems"] if s["kind"] == "pipeline"}
        self.assertEqual(failures, {"twoview": 0, "colmap": 2})

    def test_a_program_that_hangs_is_a_row_and_leaves_no_process(self):
        mark = "0.31" + str(os.getpid())
        _, rows = self.rows("twoview,colmap", "--timeout", 4,
                            PATH=self.fake_colmap(f"while :; do sleep {mark}; done"))
        for row in rows:
            self.assertEqual(row["pipeline"]["colmap"]["status"], "timed_out")
        time.sleep(0.5)
        listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True)
        self.assertNotIn(f"sleep {mark}", listed.stdout)

    def test_a_program_that_is_missing_is_a_row(self):
        report, rows = self.rows("twoview,colmap", PATH=self.folder.name)
        self.assertEqual(rows[0]["pipeline"]["colmap"]["status"], "missing")
        told = next(s for s in report["systems"] if s["id"] == "colmap")
        self.assertIn("no program colmap", told["missing"])
        with open(os.path.join(self.out, "index.html"), encoding="utf-8") as f:
            self.assertIn("missing: no program colmap", f.read())

    def test_a_library_that_takes_its_process_along_is_a_row(self):
        support.write(self.folder.name, "poselib.py", "import os, signal\n"
                      "def estimate_relative_pose(*_):\n"
                      "    print('about to fall', flush=True)\n"
                      "    os.kill(os.getpid(), signal.SIGSEGV)\n")
        _, rows = self.rows("twoview,poselib_solver,magsac_solver", PYTHONPATH=self.folder.name)
        for row in rows:
            poselib = row["solver"]["poselib_solver"]
            self.assertEqual(poselib["status"], "crashed")
            self.assertIn("SIGSEGV", poselib["message"])
            self.assertIn("about to fall", poselib["message"])
            self.assertEqual(row["solver"]["magsac_solver"]["status"], "ok")


class TestInterrupted(BadInputTest):
    def test_an_interrupted_run_leaves_no_report_and_goes_on(self):
        slow = support.write(self.folder.name, "colmap", "#!/bin/sh\n[ $1 = help ] && echo COLMAP "
                             "3.8 && exit 0\nsleep 3\nexit 1\n", 0o755)
        lines = [f"{support.LINE} {support.TRUTH}".replace("994.978", f"994.97{i}")
                 for i in range(4)]
        words = [sys.executable, support.PROGRAM, self.list_of(*lines), "--images",
                 support.MOTORCYCLE, "-o", self.out, "--systems", "twoview,colmap"]
        environment = {**os.environ, "PATH": f"{os.path.dirname(slow)}:{os.environ['PATH']}"}
        unfinished = os.path.join(self.out, "unfinished")
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              env=environment) as process:
            deadline = time.monotonic() + 120
            while time.monotonic() < deadline and process.poll() is None:
                if os.path.isdir(unfinished) and any(n.endswith(".json")
                                                     for n in os.listdir(unfinished)):
                    break
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, errors)
        self.assertIn("goes on where it stopped", errors)
        self.assertEqual(os.listdir(self.out), ["unfinished"])
        done_before = sum(n.endswith(".json") for n in os.listdir(unfinished))
        self.assertGreaterEqual(done_before, 1)
        done = subprocess.run(words, capture_output=True, text=True, env=environment, check=False,
                              timeout=300)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"going on: {done_before} of 4 pairs are done", done.stderr)
        self.assertEqual(len(self.report()["pairs"]), 4)
        self.assertFalse(os.path.exists(unfinished))


if __name__ == "__main__":
    unittest.main()
