"""The tables of memory in docs/embedding.md are what the built library says."""

import os
import subprocess
import sys
import unittest

from twoview_tools import ROOT


class TestEmbedding(unittest.TestCase):
    def test_the_tables_of_memory_are_what_the_library_says(self):
        done = subprocess.run(
            [sys.executable, "-B", "-m", "twoview_tools.docs.embedding", "--check"],
            env=dict(os.environ, PYTHONPATH=f"{ROOT}/tools/python:{ROOT}/python"),
            capture_output=True, text=True)
        if "built without odometry" in done.stderr or "No module named 'numpy'" in done.stderr:
            self.skipTest(done.stderr.strip().splitlines()[-1])
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


if __name__ == "__main__":
    unittest.main()
