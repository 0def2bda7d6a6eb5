"""Tests of compare_colmap: a whole report, in which every system is within a degree of the truth on
an easy pair."""

import contextlib
import csv
import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import unittest

import compare_support as support

FOUNTAIN = os.path.join(support.DATA, "strecha_fountain_P11")
EASY = ("0000.jpg 0002.jpg ", "0003.jpg 0005.jpg ")
# OpenGV seeds its samples by the clock, and the pose of one sample is wrong by 0.1 to 5 degrees on
# these pairs; about every third run is within a degree. With a wrong convention no run ever is, so
# the test repeats OpenGV's runs.
OPENGV_RUNS = 10
TRIANGULATIONS_AGREE_PX = 0.1


def setUpModule():
    support.skip_without(*support.PEERS)


def read_terminal(master):
    """All that was written to a terminal whose other side is closed."""
    shown = b""
    with contextlib.suppress(OSError):  # what is read after the end
        while block := master.read(4096):
            shown += block
    return shown


class TestReport(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if not os.path.isdir(FOUNTAIN):
            raise unittest.SkipTest(f"no {FOUNTAIN}: set TWOVIEW_DATA")
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = os.path.join(cls.folder.name, "report")
        with open(os.path.join(FOUNTAIN, "pairs.txt"), encoding="utf-8") as f:
            lines = [line for line in f if line.startswith(EASY)]
        cls.pairs = support.write(cls.folder.name, "pairs.txt", "".join(lines))
        cls.done = cls.compare(cls.out)
        if cls.done.returncode == 0:
            with open(os.path.join(cls.out, "report.json"), encoding="utf-8") as f:
                cls.report = json.load(f)

    @classmethod
    def compare(cls, out, *words):
        return support.run(cls.pairs, "--images", os.path.join(FOUNTAIN, "images"), "-o", out,
                           "--jobs", 2, "--timeout", 200, *words)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def setUp(self):
        self.assertEqual(self.done.returncode, 0, self.done.stderr)

    def test_holds_the_three_files_and_nothing_else(self):
        self.assertEqual(sorted(os.listdir(self.out)), ["index.html", "pairs.csv", "report.json"])

    def test_large_images_are_said_once_to_be_compared_smaller(self):
        said = "are compared at 640 pixels a side where the first of their list is above 1241"
        self.assertEqual(self.done.stderr.count(said), 1, self.done.stderr)
        out = os.path.join(self.folder.name, "sized")
        for words in (("--resize", 640), ("--quiet",)):
            done = self.compare(out, "--systems", "twoview", *words)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertNotIn(said, done.stderr)

    def test_a_terminal_gets_a_line_of_progress_and_a_dumb_one_none(self):
        for terminal, shown in (("xterm", True), ("dumb", False)):
            with self.subTest(terminal=terminal):
                master, slave = pty.openpty()
                fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 24, 120, 0, 0))
                out = os.path.join(self.folder.name, terminal)
                done = subprocess.run(
                    [sys.executable, support.PROGRAM, self.pairs, "--images",
                     os.path.join(FOUNTAIN, "images"), "-o", out, "--systems", "twoview"],
                    stdout=subprocess.DEVNULL, stderr=slave, env={**os.environ, "TERM": terminal},
                    timeout=200, check=False)
                os.close(slave)
                with open(master, "rb", buffering=0) as other_side:
                    text = read_terminal(other_side).decode()
                self.assertEqual(done.returncode, 0, text)
                self.assertEqual("pair/s" in text or "s/pair" in text, shown, text)

    def test_every_system_is_within_a_degree_of_the_truth_on_an_easy_pair(self):
        from twoview_tools.compare import systems
        for system in systems.SYSTEMS:
            if system.kind == "triangulation":
                continue
            rows = [p["rows"][system.kind][system.id] for p in self.report["pairs"]]
            with self.subTest(system=system.id):
                told = [(r["status"], r["message"], r["pose_error_deg"]) for r in rows]
                errors = [r["pose_error_deg"] for r in rows if r["pose_error_deg"] is not None]
                self.assertTrue(errors, told)
                # A wrong convention fails on both pairs, so one failure is allowed: COLMAP's
                # program draws other samples in each run (COLMAP 3.8 had 1.04 degrees on one of the
                # two).
                if system.module == "pyopengv":
                    continue  # another test checks OpenGV
                if system.id == "twoview":
                    self.assertLess(max(errors), 1.0, told)
                else:
                    self.assertLess(min(errors), 1.0, told)

    def test_opengv_comes_within_a_degree_on_an_easy_pair(self):
        from twoview_tools.compare import systems
        left = {s.id for s in systems.of_kind("solver") if s.module == "pyopengv"}
        report = self.report
        for run in range(OPENGV_RUNS):
            for pair in report["pairs"]:
                rows = pair["rows"]["solver"]
                left = {i for i in left
                        if rows[i]["pose_error_deg"] is None or rows[i]["pose_error_deg"] > 1.0}
            if not left:
                return
            out = os.path.join(self.folder.name, f"again{run}")
            again = self.compare(out, "--systems", ",".join(["twoview", *left]))
            self.assertEqual(again.returncode, 0, again.stderr)
            with open(os.path.join(out, "report.json"), encoding="utf-8") as f:
                report = json.load(f)
        self.fail(f"{sorted(left)}: never within a degree in {OPENGV_RUNS} runs")

    def test_triangulations_agree(self):
        rows = [p["rows"]["triangulation"] for p in self.report["pairs"]]
        for row in rows:
            for name, points in row.items():
                with self.subTest(method=name):
                    self.assertEqual(points["status"], "ok", points["message"])
                    self.assertGreater(points["num_in_front"], 0.99 * points["num_points"])
                    self.assertAlmostEqual(points["median_error_px"],
                                           row["twoview_poly"]["median_error_px"],
                                           delta=TRIANGULATIONS_AGREE_PX)

    def test_report_json_has_the_keys_that_others_rely_on(self):
        self.assertEqual({s["kind"] for s in self.report["systems"]}, {"pipeline", "solver"})
        for system in self.report["systems"]:
            for key in ("name", "version", "kind", "auc", "median_error_deg", "time_ms",
                        "failures", "options", "seed"):
                self.assertIn(key, system)
            self.assertEqual(list(system["auc"]), ["5", "10", "20"])
            self.assertTrue(system["version"], system["id"])
        self.assertEqual(len(self.report["pairs"]), len(EASY))
        self.assertTrue(self.report["machine"]["cpu"])
        self.assertLess(self.report["seconds"]["twoview_share"], 0.02)

    def test_the_csv_has_a_row_a_pair_and_system(self):
        from twoview_tools.compare import systems
        with open(os.path.join(self.out, "pairs.csv"), encoding="utf-8") as f:
            rows = list(csv.DictReader(f))
        self.assertEqual(len(rows), len(EASY) * len(systems.SYSTEMS))
        stored = self.report["pairs"][0]["rows"]["pipeline"]["twoview"]
        row = next(r for r in rows if r["system"] == "twoview" and r["kind"] == "pipeline")
        self.assertEqual(float(row["pose_error_deg"]), stored["pose_error_deg"])

    def test_the_page_needs_no_other_file_and_every_table_names_the_reference(self):
        with open(os.path.join(self.out, "index.html"), encoding="utf-8") as f:
            page = f.read()
        page = page.replace(page[page.index("plotly.js v"):page.index('id="data"')], "")
        for outside in ('src="http', "src='http", "@import", '<link', "url(http"):
            self.assertNotIn(outside, page)
        self.assertEqual(page.count("<caption>"), page.count("<table class"))
        for caption in page.split("<caption>")[1:]:
            self.assertIn("Reference: the true poses", caption.split("</caption>")[0])


if __name__ == "__main__":
    unittest.main()
