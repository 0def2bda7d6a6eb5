"""ctest's way into every Python test: runs one file, as `python FILE ARGUMENTS` or pytest would.

usage: run_python.py FILE [ARGUMENT...]             a unittest file that ends in unittest.main()
       run_python.py --pytest PACKAGE,... FILE      a pytest file, and the packages that it needs

The exit status is 1 where a test failed. It is 77 (TWOVIEW_SKIP_CODE), for which ctest says
"Skipped", where none failed and one or more were skipped: their names and reasons are the last
lines printed. It is 0 only where at least one test ran and every test passed."""
import importlib.util
import os
import runpy
import sys
import unittest

SKIP_CODE = 77


def finish(run, failed, skipped):
    """Ends the program with the exit status above. skipped: (name, reason) of each skipped test."""
    if failed:
        sys.exit(1)
    if skipped:
        sys.stderr.flush()
        print(f"skipped {len(skipped)} of {run} tests:")
        for name, reason in skipped:
            print(f"  {name}: {reason}")
        sys.exit(SKIP_CODE)
    if not run:
        print("no test ran")
        sys.exit(1)
    sys.exit(0)


class Program(unittest.TestProgram):
    """unittest.main with the exit status that this file's first lines describe."""

    def runTests(self):
        wanted, self.exit = self.exit, False
        super().runTests()
        self.exit = wanted
        result = self.result
        # A class or module that is skipped as a whole has one entry here, though none of its tests
        # ran.
        finish(max(result.testsRun, len(result.skipped)), not result.wasSuccessful(),
               [(test.id(), reason) for test, reason in result.skipped])


def run_unittest(path, arguments):
    sys.argv = [path, *arguments]
    sys.path[0] = os.path.dirname(os.path.abspath(path))
    unittest.main = Program
    runpy.run_path(path, run_name="__main__")
    print(f"{path} does not call unittest.main()")
    sys.exit(1)


class Report:
    """A pytest plugin that records the result of each test."""

    def __init__(self):
        self.run, self.skipped = 0, []

    def add(self, report):
        if report.skipped:
            reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
            self.skipped.append((report.nodeid, reason))

    def pytest_runtest_logreport(self, report):
        self.run += report.when == "setup"
        self.add(report)

    def pytest_collectreport(self, report):
        self.run += report.skipped
        self.add(report)


def run_pytest(packages, path):
    for package in ("pytest", *packages):
        if importlib.util.find_spec(package) is None:
            print(f"no {package}: run scripts/bootstrap test")
            sys.exit(SKIP_CODE)
    import pytest

    sys.path[0] = os.path.dirname(os.path.abspath(path))
    report = Report()
    status = pytest.main(["-q", "-p", "no:cacheprovider", path], plugins=[report])
    # A file that was skipped as a whole collects no tests; that is no failure.
    skipped_whole = status == pytest.ExitCode.NO_TESTS_COLLECTED and report.skipped
    finish(report.run, status != 0 and not skipped_whole, report.skipped)


def main():
    if sys.argv[1] == "--pytest":
        run_pytest(sys.argv[2].split(","), sys.argv[3])
    run_unittest(sys.argv[1], sys.argv[2:])


main()
