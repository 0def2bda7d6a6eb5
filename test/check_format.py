"""The format of what is written by hand: clang-format leaves every C and C++ file as it is
(.clang-format), no line of C, C++ or Python is longer than 100 columns, and shellcheck finds
nothing in the scripts of bash.

usage: check_format.py ROOT [--apply]     --apply: rewrite the C and C++ files instead of checking

There are no exceptions: no folder has a style of its own, and clang-format is turned off only
around includes whose order matters. Status 77 where a tool is missing (scripts/bootstrap test),
after the checks that can run have passed."""
import os
import shutil
import subprocess
import sys
from pathlib import Path

COLUMNS = 100
SKIP_CODE = 77
C_ENDINGS = (".c", ".cc", ".h")
CLANG_FORMAT_VERSION = "14"  # other versions of clang-format format differently
NOT_OURS = {"build", "out", "__pycache__"}


def files_of(root):
    """The files that git tracks or would track; without git, all files outside build folders."""
    if (root / ".git").exists() and shutil.which("git"):
        done = subprocess.run(["git", "-C", root, "ls-files", "-z", "--cached", "--others",
                               "--exclude-standard"], capture_output=True, check=False)
        if done.returncode == 0:
            names = sorted({name for name in done.stdout.decode().split("\0") if name})
            return [root / name for name in names if (root / name).is_file()]
    found = []
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders
                      if name not in NOT_OURS and not (name.startswith(".") and name != ".ci")]
        found += [Path(folder, name) for name in names]
    return sorted(found)


def first_line(path):
    with open(path, "rb") as file:
        return file.readline(80)


def is_bash(path):
    return not path.suffix and first_line(path).startswith((b"#!/bin/bash", b"#!/bin/sh")) or \
        path.suffix == ".sh"


def long_and_unformatted_lines(root, paths):
    for path in paths:
        formatted = True
        for number, line in enumerate(path.read_text().splitlines(), 1):
            place = f"{path.relative_to(root)}:{number}"
            if len(line) > COLUMNS:
                yield f"{place}: {len(line)} columns, {COLUMNS} allowed"
            if path.suffix not in C_ENDINGS:
                continue
            if "clang-format on" in line:
                formatted = True
            if not formatted and line and not line.startswith("#"):
                yield f"{place}: clang-format is turned off for more than includes"
                formatted = True
            if "clang-format off" in line:
                formatted = False


def clang_format():
    """The path of the clang-format of the project's version; None where it is not installed."""
    for name in (f"clang-format-{CLANG_FORMAT_VERSION}", "clang-format"):
        if shutil.which(name):
            said = subprocess.run([name, "--version"], capture_output=True, text=True, check=True)
            if f"version {CLANG_FORMAT_VERSION}." in said.stdout:
                return name
    return None


def main():
    root, apply = Path(sys.argv[1]).resolve(), sys.argv[2:] == ["--apply"]
    files = files_of(root)
    in_c = [path for path in files if path.suffix in C_ENDINGS]
    missing, wrong = [], []
    formatter = clang_format()
    if formatter is None:
        missing.append(f"clang-format {CLANG_FORMAT_VERSION}")
    elif apply:
        return subprocess.run([formatter, "-i", "--style=file", *in_c], check=False).returncode
    else:
        done = subprocess.run([formatter, "--dry-run", "-Werror", "--style=file", *in_c],
                              capture_output=True, text=True, check=False)
        places = [line.replace(f"{root}/", "") for line in done.stderr.splitlines()
                  if ": error: " in line]
        wrong += places or [done.stderr] * bool(done.returncode)
    if apply:
        print(f"missing: {missing[0]} (scripts/bootstrap test)")
        return 1
    wrong += long_and_unformatted_lines(root, [*in_c, *(p for p in files if p.suffix == ".py")])
    if shutil.which("shellcheck"):
        done = subprocess.run(["shellcheck", "-f", "gcc", *filter(is_bash, files)],
                              capture_output=True, text=True, cwd=root, check=False)
        wrong += done.stdout.replace(f"{root}/", "").splitlines()
    else:
        missing.append("shellcheck")
    for line in wrong:
        print(line)
    if wrong:
        print(f"{len(wrong)} places; scripts/format rewrites the C and C++ files")
        return 1
    if missing:
        print(f"skipped: missing {', '.join(missing)} (scripts/bootstrap test)")
        return SKIP_CODE
    print(f"{len(files)} files")
    return 0


sys.exit(main())
