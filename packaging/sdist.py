#!/usr/bin/env python3
"""Writes Python's source distribution, twoview-VERSION.tar.gz: the library's sources beside the
package, so that pip builds it without anything from the folder above. Equal sources and equal
SOURCE_DATE_EPOCH give equal bytes.

usage: sdist.py SOURCE_FOLDER OUTPUT_FOLDER
"""

import gzip
import io
import os
import pathlib
import re
import sys
import tarfile
import tomllib

FILES = ("CMakeLists.txt", "LICENSE", "README.md")
FOLDERS = ("cmake", "lib", "python/twoview")
# python/pyproject.toml is written for its own folder; the distribution has it at its root.
PATHS = (('cmake.source-dir = ".."', 'cmake.source-dir = "."'),
         ('wheel.packages = ["twoview"]', 'wheel.packages = ["python/twoview"]'),
         ('input = "../lib/', 'input = "lib/'))


def metadata(project, version, readme):
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {version}",
             f"Summary: {project['description']}", "License: BSD-3-Clause",
             f"Requires-Python: {project['requires-python']}"]
    lines += [f"Requires-Dist: {needed}" for needed in project.get("dependencies", [])]
    return "\n".join(lines) + "\nDescription-Content-Type: text/markdown\n\n" + readme


def main():
    source, folder = map(pathlib.Path, sys.argv[1:])
    version = re.search(r'TV_VERSION_STRING "([^"]+)"',
                        (source / "lib/include/twoview/version.h").read_text()).group(1)
    pyproject = (source / "python/pyproject.toml").read_text()
    for old, new in PATHS:
        if pyproject.count(old) != 1:
            sys.exit(f"sdist.py: python/pyproject.toml has not one line {old}")
        pyproject = pyproject.replace(old, new)
    contents = {name: (source / name).read_bytes() for name in FILES}
    for top in FOLDERS:
        for path in sorted((source / top).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                contents[str(path.relative_to(source))] = path.read_bytes()
    contents["pyproject.toml"] = pyproject.encode()
    contents["PKG-INFO"] = metadata(tomllib.loads(pyproject)["project"], version,
                                    contents["README.md"].decode()).encode()
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", 0))
    name = f"twoview-{version}"
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for path in sorted(contents):
            entry = tarfile.TarInfo(f"{name}/{path}")
            entry.size, entry.mtime, entry.mode = len(contents[path]), epoch, 0o644
            archive.addfile(entry, io.BytesIO(contents[path]))
    packed = io.BytesIO()
    with gzip.GzipFile(filename="", mode="wb", fileobj=packed, compresslevel=9, mtime=epoch) as gz:
        gz.write(plain.getvalue())
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.tar.gz").write_bytes(packed.getvalue())


if __name__ == "__main__":
    main()
