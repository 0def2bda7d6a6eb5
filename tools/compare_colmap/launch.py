"""Makes twoview_tools and twoview importable for the programs of this folder.

This is the only file that sets Python's path. twoview_tools lies in ../python, in the source tree
(tools/python) as in an installation (share/twoview/python), and knows where the package twoview is.
"""

import os
import sys

sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), "python")
)
import twoview_tools  # noqa: E402

sys.path[1:1] = [folder for folder in twoview_tools.FOLDERS if folder not in sys.path]
