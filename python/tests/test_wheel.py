"""Builds the wheel, installs it, and runs it with every Python on this machine that has numpy. Set
TWOVIEW_WHEEL_BUILD to a folder that keeps the build, so that the next run compiles only changed
files."""

import os
import shutil
import subprocess
import sys
import zipfile

import pytest
from conftest import ROOT


def pythons():
    """Interpreters with numpy: the present one, and each python3 and python3.x in the PATH."""
    names = ["python3"] + [f"python3.{minor}" for minor in range(9, 30)]
    found = {sys.executable}
    for name in names:
        path = shutil.which(name, path="/usr/bin:/usr/local/bin")
        if path and subprocess.run([path, "-c", "import numpy; assert numpy.__version__ >= '1.24'"],
                                   capture_output=True, check=False).returncode == 0:
            found.add(path)
    return sorted(found)


def test_the_wheel_installs_and_works(tmp_path):
    pytest.importorskip("scikit_build_core")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    kept = os.environ.get("TWOVIEW_WHEEL_BUILD")
    # The package is what is tested here, so its library is compiled as fast as it can be. The
    # optimised library has its own tests, and scripts/test_packages those of a release's wheels.
    settings = ["--config-settings", "cmake.build-type=Debug"]
    for language in ("C", "CXX"):
        settings += ["--config-settings", f"cmake.define.CMAKE_{language}_FLAGS_DEBUG=-O0 -DNDEBUG"]
    if kept:
        settings += ["--config-settings", f"build-dir={kept}"]
    build = subprocess.run(
        [
            *pip,
            "wheel",
            *settings,
            "--no-build-isolation",
            "--no-deps",
            "--no-index",
            "-w",
            tmp_path,
            ROOT / "python",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stdout[-3000:] + build.stderr[-3000:]
    wheel, = tmp_path.glob("twoview-*.whl")
    assert "-py3-none-" in wheel.name
    files = zipfile.ZipFile(wheel).namelist()
    assert {"twoview/libtwoview.so", "twoview/py.typed", "twoview/stages.py"} <= set(files)
    assert not [f for f in files if f.endswith((".h", ".a", ".cmake", ".pyc"))]
    venv, site = tmp_path / "venv", tmp_path / "site"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    subprocess.run([*pip, "--python", venv / "bin" / "python", "install", "--no-deps",
                    "--no-index", wheel], check=True)
    subprocess.run([*pip, "install", "--no-deps", "--no-index", "--target", site, wheel],
                   check=True)
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("TWOVIEW", "PYTHON"))}
    here = subprocess.run([venv / "bin" / "python", "-c",
                           "import importlib.util as u; print(u.find_spec('twoview').origin)"],
                          env=environment, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert str(venv) in here.stdout
    program = ("import numpy, sys, twoview as tv; c = tv.Context(); "
               "a = numpy.random.default_rng(1).integers(0, 60, (50, 128), dtype=numpy.uint8); "
               "assert len(tv.match(c, a, a)) == 50; "
               f"assert tv.default_library().path.startswith({str(site)!r}); "
               "print(sys.version.split()[0], numpy.__version__)")
    for python in pythons():
        run = subprocess.run([python, "-B", "-c", program], cwd=tmp_path, check=False,
                             capture_output=True, text=True,
                             env=dict(environment, PYTHONPATH=str(site)))
        assert run.returncode == 0, f"{python}: {run.stderr}"
        print(python, run.stdout.strip())
