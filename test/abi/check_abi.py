"""Compares the ABI that the public headers declare with its soname's frozen dump, by libabigail,
and fails on any change but growth: a field at the end of a struct that has struct_size, a new
enumerator at the end, a new function. The library must export what the headers declare. A self-test
comes first: it changes copies of the headers and requires that each break is found.

The comparison uses a library of empty functions that is compiled from the headers. It has the
symbols, signatures and types of the true library, whose own files are compiled with the same
headers, and none of the types of its internals.

usage: check_abi.py --cc CC --headers INCLUDE --work FOLDER
                    [--abidiff ABIDIFF --dump DUMP --nm NM --library LIBRARY]
       without --abidiff: only makes FOLDER/libtwoview.so, for test/abi/freeze"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys

import grow

SUPPRESSIONS = """[suppress_type]
  type_kind = struct
  name_regexp = ^({structs})$
  has_data_member_inserted_at = end
"""

# The changes that the self-test makes to the headers: (what, file, from, to, whether it breaks the
# ABI).
CHANGES = [
    ("a removed field", "two_view.h", "  double noise_px;\n", "", True),
    ("a field of another name", "two_view.h", "double noise_px;", "double noise;", True),
    ("a field of another type", "context.h", "int32_t kernels;", "int64_t kernels;", True),
    (
        "a field in the middle of a growing struct",
        "match.h",
        "  float ratio;\n  /* Only keypoints",
        "  float more;\n  float ratio;\n  /* Only keypoints",
        True,
    ),
    (
        "a field at the end of an array's element",
        "triangulate.h",
        "  int32_t reserved;\n",
        "  int32_t reserved;\n  int32_t more;\n",
        True,
    ),
    (
        "an enumerator of another value",
        "two_view.h",
        "TV_KIND_PANORAMIC = 4",
        "TV_KIND_PANORAMIC = 14",
        True,
    ),
    (
        "a new enumerator",
        "two_view.h",
        "TV_KIND_NO_MOTION = 6",
        "TV_KIND_NO_MOTION = 6, TV_KIND_MORE = 7",
        False,
    ),
    (
        "another parameter",
        "context.h",
        "void *memory,\n                                 size_t size_bytes)",
        "void *memory)",
        True,
    ),
    ("a removed function", "status.h", "TV_API const char *tv_version_string(void);", "", True),
    (
        "a new function",
        "status.h",
        "TV_API const char *tv_version_string(void);",
        "TV_API const char *tv_version_string(void);\nTV_API int tv_more(void);",
        False,
    ),
    (
        "a field at the end of a growing struct",
        "two_view.h",
        "double camera_direction_rad;",
        "double camera_direction_rad;\n  double more;",
        False,
    ),
]


def declarations(headers):
    text = "".join(path.read_text() for path in sorted(headers.glob("*.h")))
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    return re.findall(r"^TV_API [^;{]*\)(?=;)", text, re.M)


def members(include):
    """{struct or enum: its fields or enumerators as the header writes them, without comments}"""
    text = "".join(path.read_text() for path in sorted((include / "twoview").glob("*.h")))
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    return {
        name: [
            " ".join(part.split())
            for part in re.split("[;,]" if kind == "enum" else ";", body)
            if part.strip()
        ]
        for kind, name, body in re.findall(r"typedef (struct|enum) (\w+)\s*\{(.*?)\}", text, re.S)
    }


def broken_members(old, new, growing):
    """Yields the structs and enums whose new members are not compatible with those of the release
    (old). abidiff does not report these when its option allows growth. The release's members must
    come first and unchanged; only structs that may grow and enums may have further ones."""
    before, after = members(old), members(new)
    for name, parts in before.items():
        found = after.get(name, [])
        may_grow = name in growing or "=" in parts[0]
        if (found[:len(parts)] if may_grow else found) != parts:
            yield f"{name}: {parts} in the release, {found} now"


def compile_headers(cc, include, work, soname):
    """Compiles a library of empty functions, with debug information."""
    work.mkdir(parents=True, exist_ok=True)
    source, library = work / "declared.c", work / "libtwoview.so"
    source.write_text(
        '#include "twoview/twoview.h"\n'
        + "\n".join(d + " { __builtin_trap(); }" for d in declarations(include / "twoview"))
        + "\n"
    )
    subprocess.run(
        [
            cc,
            "-std=c99",
            "-g",
            "-O0",
            "-shared",
            "-fPIC",
            "-fvisibility=hidden",
            "-w",
            f"-Wl,-soname,{soname}",
            "-I",
            include.resolve(),
            source.name,
            "-o",
            library.name,
        ],
        check=True,
        cwd=work,
    )
    return library


def soname_of(include):
    text = (include / "twoview" / "version.h").read_text()
    major, minor = (
        re.search(rf"TV_VERSION_{part} (\d+)", text).group(1) for part in ("MAJOR", "MINOR")
    )
    return f"libtwoview.so.{major}" + (f".{minor}" if major == "0" else "")


def changed_headers(include, copy, name, before, after):
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(include, copy)
    path = copy / "twoview" / name
    text = path.read_text()
    if text.count(before) != 1:
        sys.exit(f"self-test: {name} does not hold {before!r} once")
    path.write_text(text.replace(before, after))
    return copy


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cc", required=True)
    parser.add_argument("--headers", required=True, type=pathlib.Path)
    parser.add_argument("--work", required=True, type=pathlib.Path)
    for name in ("abidiff", "dump", "nm", "library"):
        parser.add_argument("--" + name, type=pathlib.Path)
    arguments = parser.parse_args()
    headers, work = arguments.headers, arguments.work
    soname = soname_of(headers)
    present = compile_headers(arguments.cc, headers, work, soname)
    if not arguments.abidiff:
        return

    def exported(library):
        text = subprocess.run(
            [arguments.nm, "-D", "--defined-only", library],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        return {line.split()[-1] for line in text.splitlines() if " T " in line}

    if exported(present) != exported(arguments.library):
        sys.exit(f"{arguments.library} does not export what the headers declare: "
                 f"{sorted(exported(present) ^ exported(arguments.library))}")

    structs = sorted(
        {name for header in headers.rglob("*.h") for name in grow.growing(header.read_text())}
    )
    suppressions = work / "growth.suppr"
    suppressions.write_text(SUPPRESSIONS.format(structs="|".join(structs)))

    def differs(old_headers, old, new_headers, new):
        broken = list(broken_members(old_headers, new_headers, structs))
        done = subprocess.run(
            [arguments.abidiff, "--no-added-syms", "--suppressions", suppressions, old, new],
            capture_output=True,
            text=True,
        )
        if done.returncode & 3:
            sys.exit(f"abidiff: {done.stderr or done.stdout}")
        return bool(broken) or done.returncode != 0, "\n".join(broken) + done.stdout

    failed = False
    for what, name, before, after, is_break in CHANGES:
        copy = changed_headers(headers, work / "changed" / "include", name, before, after)
        found, report = differs(headers, present, copy,
                                compile_headers(arguments.cc, copy, work / "changed", soname))
        if found != is_break:
            failed = True
            print(f"self-test: {what} is {'' if found else 'not '}reported\n{report}")
    if failed:
        sys.exit(1)
    found, report = differs(arguments.dump.parent / "include", arguments.dump, headers, present)
    if found:
        sys.exit(
            f"{report}\nThe headers break the ABI of {arguments.dump}: mend it, or give it another "
            f"soname "
            "(lib/include/twoview/version.h) and freeze that (test/abi/freeze)."
        )
    print(
        f"compatible with {arguments.dump.parent.name}; each of {len(CHANGES)} changes judged as "
        f"it should be"
    )


if __name__ == "__main__":
    main()
