"""Instructions a frame on ARM: examples/13_odometry.c, linked with the library that the presets
aarch64 and armv7 build, under qemu-user with the plugin bench/qemu_count.c. The count of a frame is
the difference of two runs of different length, so that the start of the program does not count; the
reading of a frame from its file does."""

import os
import re
import shutil
import subprocess

from .. import ROOT, formats
from .sets import read_set

ARCHITECTURES = (("aarch64", "aarch64-linux-gnu-gcc", "qemu-aarch64"),
                 ("armv7", "arm-linux-gnueabihf-gcc", "qemu-arm"))
NUM_FRAMES = (30, 60)  # of two runs, whose difference is measured
EXAMPLE = os.path.join(ROOT, "examples", "13_odometry.c")


def _run(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):  # 3: of the example, when the last frame has no pose
        raise RuntimeError(f"{command[0]}: status {done.returncode}: "
                           f"{(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return done


def _frames(source, folder, num):
    """Writes the first frames as PGM. Returns their paths."""
    import cv2
    paths = []
    for k, name in enumerate(source.names[:num]):
        paths.append(os.path.join(folder, f"{k:05d}.pgm"))
        cv2.imwrite(paths[-1], cv2.imread(os.path.join(source.path, name), cv2.IMREAD_GRAYSCALE))
    return paths


def measure(source_path, scratch):
    """[(architecture, instructions a frame or None, why not)] over a set folder whose camera is a
    pinhole."""
    source = read_set(source_path)
    camera = next(iter(formats.read_camera_set(source.file("cameras.yaml")).values()))
    os.makedirs(scratch, exist_ok=True)
    frames = _frames(source, scratch, max(NUM_FRAMES))
    plugin = os.path.join(scratch, "count.so")
    _run("gcc", "-O2", "-shared", "-fPIC", os.path.join(ROOT, "bench", "qemu_count.c"), "-o",
         plugin)
    found = []
    for preset, compiler, qemu in ARCHITECTURES:
        missing = [tool for tool in (compiler, qemu) if not shutil.which(tool)]
        if missing:
            found.append((preset, None, f"no {' and no '.join(missing)} here"))
            continue
        build = os.path.join(ROOT, "build", f"instructions-{preset}")
        _run("cmake", "--preset", preset, "-S", ROOT, "-DTWOVIEW_TOOLS=OFF", "-DBUILD_TESTING=OFF",
             "-B", build)
        _run("cmake", "--build", build, "--target", "twoview_static")
        program = os.path.join(scratch, "odometry-" + preset)
        _run(compiler, "-std=c11", "-O2", "-static", EXAMPLE, "-I",
             os.path.join(ROOT, "lib", "include"), os.path.join(build, "lib", "libtwoview.a"),
             "-lm", "-o", program)
        lens = [repr(float(value)) for value in (camera.fx, camera.fy, camera.cx, camera.cy)]
        counts = [int(re.search(r"instructions: (\d+)", _run(
            qemu, "-plugin", plugin, program, *lens, *frames[:num]).stderr)[1])
            for num in NUM_FRAMES]
        found.append((preset, (counts[1] - counts[0]) / (NUM_FRAMES[1] - NUM_FRAMES[0]), None))
    return found


def sentences(found, name):
    """A line for each architecture: the figure is reported, and has no limit."""
    for preset, count, problem in found:
        yield None, (f"instructions a frame on {preset}, {name}, frames {NUM_FRAMES[0]} to "
                     f"{NUM_FRAMES[1]}: " + (f"{count / 1e6:.1f} million" if count else problem))
