#!/usr/bin/env python3
"""Checks the symbols of the built library: it needs no heap, no printing and no libstdc++, at run
time only libc and libm, and it exports tv_* only. Its object files hold no static constructor and
no writable data.
usage: check_symbols.py --nm NM --readelf READELF SO ARCHIVE"""
import argparse
import re
import subprocess
import sys

# All symbols that the library may need from other libraries. Whoever adds a name says why.
ALLOWED = {
    "memcpy", "memmove", "memset", "memcmp",  # the compiler inserts these calls by itself
    "sqrt", "sqrtf",  # the only libm functions: IEEE 754 fixes their every bit
    "getauxval",  # libc on ARM: reports the CPU's features
    # needed by compilers that protect the stack by default
    "__stack_chk_fail", "__stack_chk_guard",
    "_GLOBAL_OFFSET_TABLE_",
    "__popcountdi2",  # in libgcc, which is linked statically: counts bits
    # ARM's names of memcpy, memmove and memset
    "__aeabi_memcpy", "__aeabi_memmove", "__aeabi_memset", "__aeabi_memclr",
}
# Weak references that the compiler's start files put into every shared object.
STARTUP = {"__cxa_finalize", "__gmon_start__", "_ITM_deregisterTMCloneTable",
           "_ITM_registerTMCloneTable", "__deregister_frame_info", "__register_frame_info"}
# Sections that must be empty in the object files. The .so is not checked for these: the compiler's
# start files have constructors there.
CONSTRUCTORS = re.compile(r"\.(init_array|fini_array|ctors|dtors)\b")
# Sections that stay writable. .data.rel.ro does not: the loader makes it read-only.
WRITABLE = re.compile(r"\.(data|bss|tdata|tbss)\b(?!\.rel\.ro)")
SECTION = re.compile(
    r"^\s*\[\s*\d+\]\s+(\.\S+)\s+\S+\s+[0-9a-f]+\s+[0-9a-f]+\s+([0-9a-f]+)\s", re.M
)
NEEDED = re.compile(r"^(libc|libm|ld-linux[\w-]*)\.so\.\d+$")


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def names(nm_output):
    """The symbol names in the output of `nm --format=posix`, without version suffixes."""
    return {line.split()[0].split("@")[0] for line in nm_output.splitlines()
            if line.strip() and not line.endswith(":")}


def sections_that_run_or_change(readelf, archive):
    """The names of the constructor sections and writable sections that are not empty, over all
    members."""
    text = run(readelf, "--section-headers", "--wide", archive)
    sections = SECTION.findall(text)
    if len(sections) < 100:
        sys.exit(f"{archive}: {len(sections)} sections read: readelf's output is not understood")
    return sorted({name for name, size in sections if int(size, 16) > 0 and
                   (CONSTRUCTORS.match(name) or WRITABLE.match(name))})


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--nm", default="nm")
    parser.add_argument("--readelf", default="readelf")
    parser.add_argument("shared")
    parser.add_argument("archive")
    args = parser.parse_args()
    nm = (args.nm, "--format=posix")
    found = []

    imported = names(run(*nm, "--dynamic", "--undefined-only", args.shared))
    found += [f"{args.shared} needs {name}" for name in sorted(imported - ALLOWED - STARTUP)]
    exported = names(run(*nm, "--dynamic", "--defined-only", args.shared))
    found += [f"{args.shared} exports {name}" for name in sorted(exported)
              if not name.startswith("tv_")]
    if "tv_context_size" not in exported:
        found.append(f"{args.shared} does not export tv_context_size")
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", run(args.readelf, "-d", args.shared))
    found += [f"{args.shared} loads {name}" for name in needed if not NEEDED.match(name)]

    wanted = names(run(*nm, "--undefined-only", args.archive))
    own = names(run(*nm, "--defined-only", "--extern-only", args.archive))
    found += [f"{args.archive} needs {name}" for name in sorted(wanted - own - ALLOWED)]

    found += [f"{args.archive} has a section {name}"
              for name in sections_that_run_or_change(args.readelf, args.archive)]

    for line in found:
        print(line)
    print(f"{len(exported)} functions exported; {len(imported)} symbols and {len(needed)} libraries"
          f" needed; {len(found)} offences")
    sys.exit(1 if found else 0)


main()
