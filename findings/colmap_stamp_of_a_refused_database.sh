#!/bin/sh
# pycolmap 3.13 refuses a database of COLMAP 4, and leaves its own version number in it.
#
# Packages: pycolmap 4.2.1, then 3.13.0 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# 4.2.1 makes a database (PRAGMA user_version 4020100). 3.13.0 opens it. Expected: an error, and
# the file as it was. Seen: RuntimeError ("No registered database factory succeeded"), and the
# user_version is 3900 afterwards: the number of 3.9, which 3.13.0 gives its own databases, too. A
# reader that goes by the number takes the tables of version 4 for those of 3.9.
# What helps: look at the tables, not at the number; opening it with 4.2.1 puts the number back.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for version in 4.2.1 3.13.0; do
  python3 -m venv "$work/$version"
  "$work/$version/bin/pip" install --quiet --disable-pip-version-check pycolmap==$version
done
cd "$work"
cat > run.py <<'EOF'
import sqlite3

import pycolmap

pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
try:
    pycolmap.Database.open("x.db").close()
    words = "opened"
except RuntimeError:
    words = "refused"
version = sqlite3.connect("x.db").execute("PRAGMA user_version").fetchone()[0]
print(pycolmap.__version__.split(".")[0], words, version)
EOF
for version in 4.2.1 3.13.0 4.2.1; do
  "$work/$version/bin/python" run.py
done > seen
cat > expected <<'EOF'
4 opened 4020100
3 refused 3900
4 opened 4020100
EOF
cat seen
diff expected seen
