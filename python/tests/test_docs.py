"""Runs the program in docs/python.md."""

import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT

PAIR = [ROOT / ".cache" / "motorcycle" / f"motorcycle_{side}.png" for side in ("left", "right")]


def test_the_documented_program_runs(tmp_path):
    pytest.importorskip("imageio")
    if not PAIR[0].is_file():
        pytest.skip("no Motorcycle pair: run scripts/bootstrap")
    program = re.search(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.S)[1]
    (tmp_path / "a.py").write_text(program)
    environment = dict(os.environ, PYTHONPATH=str(ROOT / "python"), PYTHONDONTWRITEBYTECODE="1")
    run = subprocess.run([sys.executable, tmp_path / "a.py", *PAIR], env=environment, check=False,
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("calibrated, ok: ")
    assert re.search(r"t +\(-(1\.000|0\.99\d), ", run.stdout), "the true t is (-1, 0, 0)"
