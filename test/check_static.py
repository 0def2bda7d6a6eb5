#!/usr/bin/env python3
"""Checks that a program with the static library carries only the parts that it calls: of a program
that calls no odometry, dense cloud or room, no member of the archive that the linker took is one of
these parts.
usage: check_static.py --ar AR ARCHIVE MAP OBJECT...   MAP is the linker's map of the program, and
each OBJECT an object file of such a part"""
import argparse
import pathlib
import re
import subprocess
import sys


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--ar", default="ar")
    parser.add_argument("archive")
    parser.add_argument("map")
    parser.add_argument("objects", nargs="+")
    args = parser.parse_args()
    members = subprocess.run([args.ar, "t", args.archive], check=True, capture_output=True,
                             text=True).stdout.split()
    name = re.escape(pathlib.Path(args.archive).name)
    text = pathlib.Path(args.map).read_text(encoding="utf-8", errors="replace")
    taken = set(re.findall(name + r"\(([^)]+)\)", text))
    parts = {pathlib.Path(path).name for path in args.objects}
    if not taken or not parts <= set(members):
        sys.exit(f"{args.map}: the linker's map, or {args.archive}, is not understood")
    carried = sorted(taken & parts)
    if carried:
        sys.exit(f"a program without odometry, dense cloud and room carries {', '.join(carried)}")
    print(f"{len(taken)} of {len(members)} members, none of the {len(parts)} of odometry, dense "
          "cloud and room")


if __name__ == "__main__":
    main()
