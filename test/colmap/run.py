"""ctest's way in: runs pytest on one file; without a package that it needs the test is skipped."""

import importlib.util
import sys

for package in ("pytest", "numpy", "cv2", "scipy", "yaml"):
    if importlib.util.find_spec(package) is None:
        print(f"no {package}: run scripts/bootstrap test")
        sys.exit(77)

import pytest  # noqa: E402

sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-rs", *sys.argv[1:]]))
