"""Tests of compare_colmap: COLMAP's reconstruction as reference, and a dask cluster for the
work."""

import json
import os
import tempfile
import unittest
import unittest.mock

import compare_support as support

HERZ_JESU = os.path.join(support.DATA, "strecha_Herz_Jesus_P8")
FIRST_IMAGES = {f"000{i}.jpg" for i in range(4)}
SYSTEMS = "twoview,poselib_solver"


def setUpModule():
    support.skip_without("pycolmap", "poselib", "distributed")
    if not os.path.isdir(HERZ_JESU):
        raise unittest.SkipTest(f"no {HERZ_JESU}: set TWOVIEW_DATA")


class ComparisonTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        with open(os.path.join(HERZ_JESU, "pairs.txt"), encoding="utf-8") as f:
            self.lines = [line.split() for line in f if not line.startswith("#")]
        self.lines = [line for line in self.lines if set(line[:2]) <= FIRST_IMAGES]

    def compare(self, name, lines, *words):
        pairs = support.write(self.folder.name, "pairs.txt",
                              "".join(" ".join(line) + "\n" for line in lines))
        out = os.path.join(self.folder.name, name)
        done = support.run(pairs, "--images", os.path.join(HERZ_JESU, "images"), "-o", out,
                           "--systems", SYSTEMS, *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        with open(os.path.join(out, "report.json"), encoding="utf-8") as f:
            report = json.load(f)
        with open(os.path.join(out, "index.html"), encoding="utf-8") as f:
            return report, f.read()


class TestReference(ComparisonTest):
    def test_colmaps_reconstruction_stands_in_for_the_truth_and_every_table_says_so(self):
        from twoview_tools import formats
        from twoview_tools.accuracy import metrics
        report, page = self.compare("report", [line[:22] for line in self.lines],
                                    "--reference", "colmap", "--jobs", 2)
        told, = report["reference_of_sets"].values()
        self.assertEqual(told["models"], [len(FIRST_IMAGES)])
        for line, pair in zip(self.lines, report["pairs"]):
            true = formats.parse_pair(" ".join(line))
            error = metrics.pose_error(pair["reference"]["R"], pair["reference"]["t"], true.R,
                                       true.t)
            self.assertLess(max(error["rotation_error_deg"],
                                error["translation_error_signed_deg"]), 1.0)
            self.assertLess(pair["rows"]["pipeline"]["twoview"]["pose_error_deg"], 1.0)
        for caption in page.split("<caption>")[1:]:
            self.assertIn("not ground truth", caption.split("</caption>")[0])


class TestCluster(ComparisonTest):
    def test_a_cluster_of_two_workers_gives_the_results_of_this_process(self):
        import distributed
        lines = self.lines[:4]
        here, _ = self.compare("here", lines)
        # The task names the library to the workers; their environment does not.
        with unittest.mock.patch.dict(os.environ):
            os.environ.pop("TWOVIEW_LIBRARY", None)
            cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1,
                                               dashboard_address=None)
        with cluster:
            there, _ = self.compare("there", lines, "--scheduler", cluster.scheduler_address)
        self.assertIn("2 workers", there["where"])
        for a, b in zip(here["pairs"], there["pairs"]):
            for kind, name in (("pipeline", "twoview"), ("solver", "poselib_solver")):
                for key in ("R", "t", "num_inliers", "pose_error_deg"):
                    self.assertEqual(a["rows"][kind][name][key], b["rows"][kind][name][key])

    def test_no_scheduler_at_the_address(self):
        pairs = support.write(self.folder.name, "one.txt", " ".join(self.lines[0]))
        done = support.run(pairs, "--images", os.path.join(HERZ_JESU, "images"), "-o",
                           os.path.join(self.folder.name, "none"), "--scheduler",
                           "tcp://127.0.0.1:9")
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertIn("--scheduler: tcp://127.0.0.1:9", done.stderr)


if __name__ == "__main__":
    unittest.main()
