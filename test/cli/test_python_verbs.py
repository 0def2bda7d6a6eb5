#!/usr/bin/env python3
"""Tests of the verbs that are Python programs: how twoview starts them, from the source tree and
installed."""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import unittest
from pathlib import Path

import cli_support as cli

SOURCE = pathlib.Path(__file__).resolve().parents[2]

# Stands in for either program: prints the arguments that it was started with.
SCRIPT = """import json, os, signal, sys
json.dump({"argv": sys.argv[1:], "python": sys.executable, "library":
os.environ.get("TWOVIEW_LIBRARY"), "verb": os.environ.get("TWOVIEW_VERB"),
           "blocked": [int(s) for s in signal.pthread_sigmask(signal.SIG_BLOCK, [])]}, sys.stdout)
sys.exit(3)
"""


class HandOver(cli.CliTest):
    def setUp(self):
        super().setUp()
        self.tree = self.folder / "a tree"
        tools = self.tree / "tools" / "compare_colmap"
        tools.mkdir(parents=True)
        for script in ("compare_colmap", "twoview_colmap", "twoview_bags", "twoview_rerun"):
            (tools / script).write_text(SCRIPT)
        bin_dir, lib_dir = self.tree / "build" / "x" / "bin", self.tree / "build" / "x" / "lib"
        bin_dir.mkdir(parents=True)
        lib_dir.mkdir()
        (lib_dir / "libtwoview.so").touch()
        self.library = str(lib_dir / "libtwoview.so")
        self.program = shutil.copy(cli.program(), bin_dir / "twoview")

    def start(self, *arguments, **environment):
        kept = {
            k: v for k, v in os.environ.items() if k not in ("TWOVIEW_PYTHON", "TWOVIEW_LIBRARY")
        }
        return subprocess.run([self.program, *arguments], env={**kept, **environment},
                              capture_output=True, timeout=60)

    def report(self, done):
        self.assertEqual((done.returncode, done.stderr), (3, b""))
        return json.loads(done.stdout)

    def test_all_get_the_arguments_and_this_library_and_their_status_comes_back(self):
        for verb in ("compare", "colmap", "import", "export", "rerun"):
            got = self.report(self.start(verb, "--help", "a b", "", TWOVIEW_PYTHON=sys.executable))
            self.assertEqual(got["argv"], ["--help", "a b", ""])
            self.assertEqual((got["library"], got["blocked"]), (self.library, []))
            self.assertEqual(got["verb"], f"twoview {verb}")

    def test_a_library_that_is_named_stays(self):
        got = self.report(
            self.start("colmap", TWOVIEW_PYTHON=sys.executable, TWOVIEW_LIBRARY="/x.so")
        )
        self.assertEqual(got["library"], "/x.so")

    def test_the_python_of_bootstrap_comes_before_that_of_the_path(self):
        on_path = self.folder / "path"
        venv = self.tree / ".cache" / "venv" / "bin"
        for folder, name in ((on_path, "python3"), (venv, "python")):
            folder.mkdir(parents=True)
            (folder / name).write_text(f"#!/bin/sh\necho {folder}\n")
            (folder / name).chmod(0o755)
        path = f"{on_path}:{os.environ['PATH']}"
        self.assertEqual(self.start("colmap", PATH=path).stdout, f"{venv}\n".encode())
        (venv / "python").unlink()
        self.assertEqual(self.start("colmap", PATH=path).stdout, f"{on_path}\n".encode())

    def test_an_installed_program_takes_those_of_its_share_folder(self):
        share = self.tree / "share" / "twoview"
        share.mkdir(parents=True)
        (self.tree / "tools").rename(share / "tools")
        (self.tree / "bin").mkdir()
        (self.tree / "lib").mkdir()
        library = self.tree / "lib" / "libtwoview.so"
        library.touch()
        self.program = shutil.copy(self.program, self.tree / "bin" / "twoview")
        got = self.report(self.start("compare", "x", TWOVIEW_PYTHON=sys.executable))
        self.assertEqual((got["argv"], got["library"]), (["x"], str(library)))

    def test_without_the_headers_package_it_is_the_library_with_a_version(self):
        library = pathlib.Path(self.library)
        version = re.search(r"(?m)^#define TV_VERSION_STRING \"(\d+\.\d+)",
                            (SOURCE / "lib/include/twoview/version.h").read_text()).group(1)
        library = library.rename(library.with_name(f"libtwoview.so.{version}"))
        got = self.report(self.start("colmap", TWOVIEW_PYTHON=sys.executable))
        self.assertEqual(got["library"], str(library))

    def test_what_is_missing_is_one_line(self):
        self.assert_refused(self.start("colmap", TWOVIEW_PYTHON="/no/python"), "/no/python")
        shutil.rmtree(self.tree / "tools")
        self.assert_refused(self.start("compare", TWOVIEW_PYTHON=sys.executable),
                            "needs the package python3-twoview",
                            "tools/compare_colmap/compare_colmap")

    def test_help_lists_them(self):
        listed = self.start("--help").stdout.decode()
        self.assertRegex(listed, "".join(
            rf"\n  {verb}  .*" for verb in ("compare", "colmap", "import", "export", "rerun")))

    def test_compare_has_its_help_without_packages_and_under_its_own_name(self):
        root = Path(__file__).resolve().parents[2]
        environment = {"PATH": os.environ["PATH"], "COMPARE_COLMAP_IN_VENV": "1"}
        script = [sys.executable, "-B", "-S", root / "tools/compare_colmap/compare_colmap"]
        for name, verb in (("twoview compare", {"TWOVIEW_VERB": "twoview compare"}),
                           ("compare_colmap", {})):
            done = subprocess.run([*script, "--help"], env={**environment, **verb},
                                  capture_output=True, timeout=60)
            self.assertEqual((done.returncode, done.stderr), (0, b""))
            self.assertTrue(done.stdout.startswith(f"usage: {name} [-h]".encode()), done.stdout)
            for system in (b"opencv_sift", b"twoview_five_point", b"opengv_triangulate2"):
                self.assertIn(system, done.stdout)
            done = subprocess.run([*script, "x"], env={**environment, **verb}, capture_output=True,
                                  timeout=60)
            self.assertEqual(done.returncode, 2)
            self.assertTrue(done.stderr.startswith(f"{name}: this Python has no".encode()))


if __name__ == "__main__":
    cli.main()
