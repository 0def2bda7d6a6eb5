"""Sizes: bytes of the library, of the shared libraries that the peers load, and of a context."""

import os
import re
import subprocess

from rows import Row

CONTEXT_SIZES = [(320, 240), (640, 360), (640, 480), (1280, 720)]
# For each peer, the libraries to which a program with the same stages links. They and all libraries
# that they load are counted.
PEERS = [("OpenCV features2d + calib3d", ["libopencv_features2d.so", "libopencv_calib3d.so"]),
         ("OpenGV", ["libopengv.so"]), ("COLMAP", ["/usr/bin/colmap"])]


def _run(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def text_and_data(root, library):
    """KiB of text and data as `size` counts them, and the most that they may have grown to."""
    told = subprocess.run([os.path.join(root, "scripts", "footprint"), "--built", library],
                          # The exit status only says whether the size is above its limit.
                          capture_output=True, text=True).stdout
    text, data = re.search(r"text (\d+)  data (\d+)", told).groups()
    most = sum(map(int, re.findall(r"\(at most (\d+)\)", told)))
    return (int(text) + int(data)) / 1024, most // 1024


def closure(path):
    """Every shared library that the loader loads for this one, including itself."""
    files = {os.path.realpath(path)}
    for line in _run("ldd", path).splitlines():
        found = re.search(r"(/\S+) \(0x", line)
        if found:
            files.add(os.path.realpath(found[1]))
    return files


def _find(name):
    if name.startswith("/"):
        return name if os.path.exists(name) else None
    for line in _run("/sbin/ldconfig", "-p").splitlines():
        if line.strip().startswith(name):
            return line.split("=> ")[1]
    return None


def _closure_row(ours, name, wanted):
    row = Row("footprint", "closure: library and all it loads", ours, None, name, None, "KiB")
    paths = [_find(w) for w in wanted]
    if None in paths:
        row.note = "peer missing"
        return row
    files = set().union(*(closure(p) for p in paths))
    row.peer = sum(os.path.getsize(f) for f in files) / 1024
    row.ratio = row.peer / row.ours
    row.note = f"{len(files)} files"
    return row


def context_kib(library, width, height):
    from twoview_tools.accuracy import twoview_ctypes
    context = twoview_ctypes.Context(twoview_ctypes.Library(library), max_width=width,
                                     max_height=height, max_keypoints=2048)
    return context.size_bytes / 1024


def _at_most(case, value, most):
    return Row(
        "footprint",
        case,
        value,
        None,
        "",
        None,
        "KiB",
        target=f"<= {most} KiB" if most else "",
        reached=value <= most if most else None,
    )


def rows(build, root):
    library = os.path.join(build, "lib", "libtwoview.so")
    found = [_at_most(f"text + data of libtwoview.so, {os.uname().machine}",
                      *text_and_data(root, library))]
    for width, height in CONTEXT_SIZES:
        most = 8 * 1024 if (width, height) == (640, 480) else None
        found.append(_at_most(f"context {width}x{height}, 2048 keypoints",
                              context_kib(library, width, height), most))
    ours = sum(os.path.getsize(f) for f in closure(library)) / 1024
    return found + [_closure_row(ours, *peer) for peer in PEERS]
