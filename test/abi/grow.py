"""Copies the public headers and adds fields at the end of every struct that has struct_size, as a
later release may. test/abi builds a library and callers with the copies.

usage: grow.py INCLUDE OUTPUT"""

import pathlib
import re
import sys

FIELDS = """  /* Fields of a later release. */
  int32_t grown_number, grown_other;
  double grown_more[2];
"""

# Matches a struct without nested braces; structs that may grow have none.
STRUCT = re.compile(
    r"(typedef struct (\w+) \{\n(?:(?!\n\} ).)*?uint32_t struct_size;.*?)(\} \2;)", re.S)


def growing(text):
    """The names of those structs of a header that may grow."""
    return [match.group(2) for match in STRUCT.finditer(text)]


def main():
    source, output = map(pathlib.Path, sys.argv[1:])
    count = 0
    for header in sorted(source.rglob("*.h")):
        text, found = STRUCT.subn(
            lambda match: match.group(1) + FIELDS + match.group(3), header.read_text()
        )
        count += found
        copy = output / header.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        # An unchanged header is not written: its time stays, and make compiles nothing again.
        if not copy.exists() or copy.read_text() != text:
            copy.write_text(text)
    if count < 13:
        sys.exit(f"grow.py: {count} structs found: the headers are not understood")


if __name__ == "__main__":
    main()
