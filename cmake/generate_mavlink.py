#!/usr/bin/env python3
"""Writes MAVLink's C headers with pymavlink's generator.
usage: generate_mavlink.py PYMAVLINK OUTPUT
PYMAVLINK is a folder that holds the package pymavlink; where it is missing, the one that Python
finds is used. Does nothing where OUTPUT holds the headers of the same version already. Exit status
1: there is no pymavlink."""
import os
import shutil
import sys
from pathlib import Path


def main():
    own, output = Path(sys.argv[1]), Path(sys.argv[2])
    if (own / "pymavlink").is_dir():
        sys.path.insert(0, str(own))
    try:
        import pymavlink
        from pymavlink.generator import mavgen
    except ImportError as error:
        sys.exit(f"no pymavlink: {error}")
    package = Path(pymavlink.__file__).parent
    dialect = package / "dialects/v20/ardupilotmega.xml"
    if not dialect.is_file():
        sys.exit(f"no {dialect}")
    stamp = f"{package} {getattr(pymavlink, '__version__', '')} {dialect.stat().st_size}\n"
    done = output / "generated.txt"
    if done.is_file() and done.read_text() == stamp:
        return
    shutil.rmtree(output, ignore_errors=True)
    partial = output.with_name(output.name + f".{os.getpid()}")
    options = mavgen.Opts(str(partial), wire_protocol="2.0", language="C", validate=False)
    if not mavgen.mavgen(options, [str(dialect)]):
        sys.exit("the generator failed")
    (partial / "generated.txt").write_text(stamp)
    partial.rename(output)


main()
