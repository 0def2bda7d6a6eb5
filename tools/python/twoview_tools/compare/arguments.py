"""compare_colmap's options, from the standard library alone, so that --help needs no package."""

import argparse
import os
import textwrap

from ..parser import Parser
from ..sizes import MAX_NATIVE_SIDE, RESIZE_LONG_SIDE

# The name under which the user started it: tools/twoview/verbs/python_verbs.cc sets TWOVIEW_VERB.
PROGRAM = os.environ.get("TWOVIEW_VERB") or "compare_colmap"
PIPELINES = ("twoview", "pycolmap", "pycolmap_defaults", "colmap", "opencv_fast", "opencv_sift")
SOLVERS = ("twoview_five_point", "twoview_eight_point", "twoview_upright", "magsac_solver",
           "usac_solver", "accurate_solver", "poselib_solver", "pycolmap_solver",
           "pycolmap_tvg_solver", "opengv_nister", "opengv_nister_nonlinear", "opengv_stewenius",
           "opengv_stewenius_nonlinear", "opengv_sevenpt", "opengv_sevenpt_nonlinear",
           "opengv_eightpt", "opengv_eightpt_nonlinear")
TRIANGULATIONS = ("twoview_poly", "twoview_poly_abs", "twoview_linear_eigen", "twoview_linear_ls",
                  "twoview_iterative_eigen", "twoview_iterative_ls", "twoview_midpoint",
                  "opencv_triangulate", "opencv_correct", "pycolmap_triangulate",
                  "opengv_triangulate", "opengv_triangulate2")
DESCRIPTION = """Runs twoview, COLMAP, OpenGV, OpenCV and PoseLib on the same image pairs and writes
a report: index.html, pairs.csv, report.json. See docs/compare.md."""


def _epilog():
    lists = {"pipelines": PIPELINES, "solvers": SOLVERS, "triangulations": TRIANGULATIONS}
    lines = [textwrap.fill(f"{kind}: {', '.join(ids)}", 78, initial_indent="  ",
                           subsequent_indent="    ", break_on_hyphens=False)
             for kind, ids in lists.items()]
    return "\n".join(["systems, for --systems:", *lines, "",
                      "exit status: 0 a report, whatever its rows say; 2 bad input; 130",
                      "interrupted (the same command goes on)"])


def make_parser():
    parser = Parser(
        prog=PROGRAM, description=DESCRIPTION, epilog=_epilog(),
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", nargs="+", metavar="PAIRS.txt",
                        help="lists of pairs: name0 name1 rot0 rot1 K0(9) K1(9) [T_0to1(16)]; "
                             "cameras.yaml beside one is read")
    parser.add_argument("--images", metavar="DIR",
                        help="folder of the images (default: images/ beside each list)")
    parser.add_argument("-o", "--output", required=True, metavar="REPORT_DIR")
    parser.add_argument("--reference", choices=("truth", "colmap"), default="truth",
                        help="errors are against the lists' true poses (default), or against "
                             "COLMAP's own reconstruction of the images")
    parser.add_argument("--systems", metavar="A,B,..",
                        help="only these: ids, families (opengv, opencv, ..), pipelines, solvers, "
                             "triangulations, all named below (default: all)")
    parser.add_argument("--matches", default="twoview", metavar="ID|[NAME=]DIR",
                        help="whose matches the solvers get: a pipeline's id (default twoview), or "
                             "a folder of your own with a file a pair, such as a_b_matches.npz "
                             "(docs/formats.md), which then is a pipeline, too: these matches and "
                             "twoview's estimate")
    parser.add_argument("--matches-resize", type=int, metavar="L",
                        help="the longer side to which your matcher made the pictures smaller; 0: "
                             "it matched them as they are")
    parser.add_argument("--poses", action="append", default=[], metavar="[NAME=]FILE",
                        help="poses of your own system, a pipeline of its own: name0 name1 and the "
                             "rows of [R t] a line; may be given several times")
    parser.add_argument("--tables", default="", metavar="csv,tex",
                        help="also write the tables of systems as systems.csv and systems.tex")
    parser.add_argument("--figures", default="", metavar="svg,pdf,png",
                        help="also write the plots as files, in REPORT_DIR/figures (needs "
                             "matplotlib)")
    parser.add_argument("--max-error-px", type=float, default=1.0, metavar="E",
                        help="inlier threshold of every system that takes one (default 1)")
    parser.add_argument("--resize", type=int, metavar="L",
                        help="long side of the images; 0: as they are (default: "
                             f"{RESIZE_LONG_SIDE} for those with a longer "
                             f"side than {MAX_NATIVE_SIDE})")
    parser.add_argument("--mask", default="", metavar="FILE|DIR",
                        help="which pixels show the scene: one image for all, black where a "
                             "picture is left out, or a folder of masks NAME.png; for every system")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument("--max-pairs", type=int, default=0, metavar="N",
                        help="at most N pairs of each list, evenly spaced")
    parser.add_argument("--jobs", type=int, default=1, metavar="N",
                        help="pairs at a time, each in processes of its own (default 1)")
    parser.add_argument("--scheduler", metavar="ADDRESS",
                        help="hand the pairs to this dask.distributed cluster, which sees the same "
                             "folders")
    parser.add_argument("--timeout", type=float, default=60.0, metavar="S",
                        help="seconds that a system may take for a pair (default 60)")
    parser.add_argument("--quiet", action="store_true", help="no progress and no table")
    return parser
