"""Runs the programs in docs/python.md and docs/python_odometry.md."""

import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT, needs
from test_odometry import FOCAL, flown_frames

PAIR = [ROOT / ".cache" / "motorcycle" / f"motorcycle_{side}.png" for side in ("left", "right")]


def run_program_of(page, folder, *arguments):
    """What the program of docs/PAGE prints, run in this folder."""
    program = re.search(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.S)[1]
    (folder / "a.py").write_text(program)
    environment = dict(os.environ, PYTHONPATH=str(ROOT / "python"), PYTHONDONTWRITEBYTECODE="1")
    run = subprocess.run([sys.executable, folder / "a.py", *map(str, arguments)], env=environment,
                         check=False, capture_output=True, text=True, cwd=folder)
    assert run.returncode == 0, run.stderr
    return run


def test_the_documented_program_runs(tmp_path):
    pytest.importorskip("imageio")
    if not PAIR[0].is_file():
        pytest.skip("no Motorcycle pair: run scripts/bootstrap")
    run = run_program_of("python.md", tmp_path, *PAIR)
    assert run.stdout.startswith("calibrated, ok: ")
    assert re.search(r"t +\(-(1\.000|0\.99\d), ", run.stdout), "the true t is (-1, 0, 0)"


@needs("tv_odometry_track")
def test_the_program_that_follows_a_film_runs(tmp_path):
    imageio = pytest.importorskip("imageio.v3")
    frames = tmp_path / "frames"
    frames.mkdir()
    for i, frame in enumerate(flown_frames()):
        imageio.imwrite(frames / f"{i:05d}.png", frame)
    run = run_program_of("python_odometry.md", tmp_path, frames, 30, FOCAL)
    assert re.search(r"00019.png: \([+-]\d", run.stdout), run.stdout
    assert re.search(r"\d+ points, \d+ keyframes, 1 segments, unit UNIT, \d+ bytes\n$", run.stdout)
    rows = np.loadtxt(tmp_path / "trajectory.txt")
    assert len(rows) >= 15 and np.all(np.diff(rows[:, 0]) > 0)
    assert np.abs(rows[:, 7] - 1).max() < 1e-3  # no turn
    assert rows[-1, 1] - rows[0, 1] > 20 * np.abs(rows[-1, 2:4] - rows[0, 2:4]).max()
