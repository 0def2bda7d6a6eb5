#!/usr/bin/env python3
"""Text and data of the shared library, as `size` counts them, are within their limit; the stack, the
context and the other architectures are scripts/footprint's.
usage: check_size.py SIZE SO LIMIT_KIB"""
import subprocess
import sys


def main():
    size, shared, limit_kib = sys.argv[1], sys.argv[2], int(sys.argv[3])
    titles, values = subprocess.run([size, shared], check=True, capture_output=True,
                                    text=True).stdout.splitlines()[:2]
    of = dict(zip(titles.split(), values.split()))
    total, limit = int(of["text"]) + int(of["data"]), limit_kib * 1024
    print(f"text {of['text']} + data {of['data']} = {total} of {limit} bytes")
    sys.exit(total > limit)


if __name__ == "__main__":
    main()
