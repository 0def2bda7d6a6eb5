#!/usr/bin/env python3
"""Checks a wheel by auditwheel: the tag in its name must not promise an older glibc than the
library inside runs with. Prints one line.

usage: wheel_verdict.py WHEEL
"""

import pathlib
import re
import subprocess
import sys


def main():
    wheel = pathlib.Path(sys.argv[1])
    tag = re.fullmatch(r"twoview-[^-]+-py3-none-manylinux_(\d+)_(\d+)_(\w+)\.whl", wheel.name)
    if not tag:
        sys.exit(f"wheel_verdict.py: {wheel.name} is not py3-none-manylinux")
    shown = subprocess.run([sys.executable, "-m", "auditwheel", "show", wheel], check=True,
                           capture_output=True, text=True).stdout
    text = " ".join(shown.split())
    verdict = re.search(r'constrains the platform tag to "manylinux_(\d+)_(\d+)_(\w+)"', text) or \
        re.search(r'platform tag: "manylinux_(\d+)_(\d+)_(\w+)"', text)
    if not verdict:
        sys.exit(f"wheel_verdict.py: no verdict on {wheel.name}: {text}")
    needed, promised = [(int(found[1]), int(found[2]), found[3]) for found in (verdict, tag)]
    if needed[2] != promised[2] or needed[:2] > promised[:2]:
        sys.exit(f"wheel_verdict.py: {wheel.name} is not what auditwheel says: {text}")
    print(f"{wheel.name}: auditwheel {verdict[0].split()[-1]}")


if __name__ == "__main__":
    main()
