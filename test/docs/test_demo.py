"""Checks that the pages and the picture of the demo show what the program gives: the summary in
docs/start.md, the row of docs/paper.md and docs/images/demo_views.png are those of scripts/demo."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import cv2
except ImportError:
    cv2 = None

from twoview_tools import ROOT

PROGRAM = os.environ.get("TWOVIEW_PROGRAM", "")
PAIR = ROOT / ".cache" / "motorcycle"


@unittest.skipUnless(PROGRAM and os.path.exists(PROGRAM), "TWOVIEW_PROGRAM names no program")
@unittest.skipUnless(PAIR.is_dir(), "no Motorcycle pair: run scripts/bootstrap")
class TestDemo(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        known = subprocess.run([PROGRAM, "reconstruct", "--help"], capture_output=True, text=True)
        if "--dense" not in known.stdout:
            raise unittest.SkipTest("the program was built without TWOVIEW_DENSE")
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.out = pathlib.Path(folder.name)
        inputs = cls.out / "input"
        subprocess.run([sys.executable, "-B", ROOT / "scripts" / "demo_truth.py",
                        PAIR / "motorcycle_disp.npz", inputs], check=True)
        cls.summary = subprocess.run(
            [PROGRAM, "reconstruct", *(PAIR / f"motorcycle_{s}.png" for s in ("left", "right")),
             "--camera0", inputs / "camera0.yaml", "--camera1", inputs / "camera1.yaml",
             "--truth", inputs / "truth.yaml", "--readout-turn-sigma-rad", "0",
             "--dense", "30000", "-o", cls.out / "demo"],
            check=True, capture_output=True, text=True).stdout
        cls.agree = re.search(r"matches +(\d+), of which (\d+) agree", cls.summary)

    def test_the_summary_of_the_first_page(self):
        page = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
        block = re.search(r"```text\n(verdict.*?)```", page, re.S)[1]
        for line in block.splitlines():
            self.assertIn(line.removesuffix("..."), self.summary)

    def test_the_dense_cloud_is_dense_and_right(self):
        result = json.loads((self.out / "demo" / "result.json").read_text(encoding="utf-8"))
        truth = result["truth"]
        self.assertGreaterEqual(truth["num_dense_depths"], 20000)
        self.assertLessEqual(truth["dense_depth_error_median_percent"], 1.0)
        self.assertLess(truth["dense_depth_error_p95_percent"], 5.0)

    def test_the_row_of_the_papers_page(self):
        page = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
        self.assertIn(f"| Motorcycle, sideways | {self.agree[2]} of {self.agree[1]} |", page)

    def test_the_picture(self):
        if cv2 is None:
            self.skipTest("no OpenCV: run scripts/bootstrap test")
        shown, drawn = (cv2.imread(str(path)) for path in (
            ROOT / "docs" / "images" / "demo_views.png", self.out / "demo" / "views.png"))
        self.assertEqual(shown.shape, drawn.shape)
        # Another OpenCV may smooth edges otherwise; another cloud has its dots elsewhere.
        differs = (cv2.absdiff(shown, drawn).max(axis=2) > 64).mean()
        self.assertLess(differs, 0.001)


if __name__ == "__main__":
    unittest.main()
