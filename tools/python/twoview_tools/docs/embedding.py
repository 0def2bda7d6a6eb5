"""Writes the tables of docs/embedding.md: what firmware has to give the library.

usage: scripts/python -m twoview_tools.docs.embedding [--check] [--footprint FILE]

The tables of memory are what the built library says (tv_context_size, tv_odometry_size), and equal
on every CPU; the test docs/embedding runs --check. FILE is what scripts/footprint printed: the
tables of code and of programs, which differ by compiler. Each table stands behind a line
<!-- made: NAME -->."""

import argparse
import os
import re
import sys

from .. import ROOT

PAGE = ROOT / "docs" / "embedding.md"
CONTEXTS = ((320, 240), (640, 360), (640, 480), (1280, 720))
# width, height, max_keypoints, max_keyframes, max_points
ODOMETRIES = ((320, 240, 300, 20, 2000), (320, 240, 500, 50, 5000), (640, 480, 500, 50, 5000),
              (640, 480, 1000, 50, 5000), (640, 480, 1000, 200, 20000),
              (1280, 720, 1000, 200, 20000), (640, 480, 2000, 200, 20000),
              (640, 480, 1000, 1000, 100000))
CPUS = ("x86-64", "aarch64", "armv7")
PROGRAMS = {  # of scripts/footprint_programs.c
    "detect": "`tv_detect`",
    "match": "`tv_extract` and `tv_match`",
    "pose": "`tv_estimate_two_view`, with matches of the caller's",
    "reconstruct": "`tv_reconstruct`: everything about two images",
    "track": "`tv_odometry_track`"}


def _grouped(count):
    return f"{count:,}".replace(",", " ")


def _table(heads, rows):
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(map(str, line)) + " |\n" for line in lines)


def context_table():
    import twoview as tv
    rows = []
    for width, height in CONTEXTS:
        sizes = []
        for keypoints in (1000, 2048):
            with tv.Context(max_width=width, max_height=height,
                            max_keypoints=keypoints) as context:
                sizes.append(_grouped(context.size_bytes))
        rows.append([f"{width}x{height}", *sizes])
    return _table(["images up to", "1000 keypoints", "2048 keypoints"], rows)


def odometry_table():
    import twoview as tv
    rows = []
    for width, height, keypoints, keyframes, points in ODOMETRIES:
        camera = tv.Camera(fx=width, fy=width, cx=width / 2, cy=height / 2, width=width,
                           height=height)
        with tv.Odometry(camera, max_keypoints=keypoints, max_keyframes=keyframes,
                         max_points=points) as odometry:
            rows.append([f"{width}x{height}", keypoints, keyframes, points,
                         _grouped(odometry.size_bytes)])
    return _table(["image", "`max_keypoints`", "`max_keyframes`", "`max_points`", "bytes"], rows)


def _by_cpu(printed):
    """The CPUs of a text that scripts/footprint printed, and what it says of each."""
    parts = [(part.split("\n")[0].strip(), part)
             for part in re.split(r"^(?=\S)", printed, flags=re.M)]
    found = [(cpu, part) for cpu, part in parts if cpu in CPUS and "text" in part]
    if not found:
        raise SystemExit("no architecture of " + ", ".join(CPUS) + " in that text")
    return found


def code_table(printed):
    """printed: the text of scripts/footprint."""
    rows, cpus = {}, []
    for cpu, part in _by_cpu(printed):
        cpus.append(cpu)
        whole = re.search(r"text (\d+)  data (\d+)", part)
        parts = dict(re.findall(rf"^  {cpu}/(\w+) (\d+)", part, flags=re.M))
        stack = re.search(r"(\d+) bytes of stack at most", part)
        values = {"two images: keypoints, matches, pose, points": parts["rest"],
                  "odometry": parts["odometry"], "the dense cloud and depth maps": parts["dense"],
                  "the room": parts["room"], "all": int(whole[1]) + int(whole[2])}
        values["deepest stack"] = stack and stack[1]  # scripts/footprint --built LIBRARY has none
        for name, value in values.items():
            rows.setdefault(name, []).append(_grouped(int(value)) if value else "-")
    return _table(["bytes of text and data", *cpus], [[name, *row] for name, row in rows.items()])


def programs_table(printed):
    """printed: the text of scripts/footprint."""
    found = _by_cpu(printed)
    sizes = [dict(re.findall(r"^  program (\w+) (\d+)$", part, flags=re.M)) for _, part in found]
    return _table(["a program that calls", *(cpu for cpu, _ in found)],
                  [[calls, *(_grouped(int(of_cpu[name])) if name in of_cpu else "-"
                             for of_cpu in sizes)] for name, calls in PROGRAMS.items()])


def replaced(text, name, table):
    pattern = rf"(<!-- made: {name} -->\n)\n*(?:\|.*\n)*\n*"
    if not re.search(pattern, text):
        raise SystemExit(f"{PAGE}: no line <!-- made: {name} -->")
    return re.sub(pattern, lambda found: found[1] + "\n" + table + "\n", text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", action="store_true", help="only compare; status 1 if it differs")
    parser.add_argument("--footprint", metavar="FILE", help="what scripts/footprint printed")
    arguments = parser.parse_args()
    os.environ.setdefault("TWOVIEW_LIBRARY", str(ROOT / "build/release/lib/libtwoview.so"))
    before = PAGE.read_text()
    text = replaced(before, "context", context_table())
    text = replaced(text, "odometry", odometry_table())
    if arguments.footprint:
        with open(arguments.footprint, encoding="utf-8") as file:
            printed = file.read()
        text = replaced(text, "code", code_table(printed))
        text = replaced(text, "programs", programs_table(printed))
    if text == before:
        return 0
    if arguments.check:
        print(f"{PAGE} differs from what the library says: run "
              "scripts/python -m twoview_tools.docs.embedding")
        return 1
    PAGE.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
