"""The arguments of `twoview colmap`."""

import argparse
import json
import os
import signal
import sqlite3
import sys

from . import settings
from .errors import EXIT_BAD_INPUT, EXIT_DONE, EXIT_NO_POSE, BadInput


class Parser(argparse.ArgumentParser):
    """One line for bad arguments."""

    def error(self, message):
        raise BadInput(f"{message} (see {self.prog} --help)")


def _count(text):
    value = int(text)
    if value < 1:
        raise ValueError
    return value


def _choice_of_pairs(parser, required=False):
    which = parser.add_mutually_exclusive_group(required=required)
    which.add_argument("--pairs", default="", metavar="FILE", help="the pairs of a pairs file")
    which.add_argument("--exhaustive", action="store_true", help="all pairs (the default)")
    which.add_argument("--sequential", type=_count, default=0, metavar="N",
                       help="each image with the N next ones by name, for video")


def _add_export(verbs):
    parser = verbs.add_parser("export", help="images to a COLMAP database with verified pairs")
    parser.add_argument("--database", required=True, metavar="FILE")
    parser.add_argument("--images", required=True, metavar="DIR")
    _choice_of_pairs(parser)
    parser.add_argument("--camera", action="append", default=[], metavar="YAML",
                        help="one camera for all images, or several, each for the files whose names begin with its own")
    parser.add_argument("--schema", choices=("4", "3.8"), default="4",
                        help="COLMAP 4, or 3.8 as Debian has it (default: 4)")
    parser.add_argument("--append", action="store_true", help="add to a database that is there")
    settings.add_options(parser)
    parser.set_defaults(run=_export)


def _export(arguments):
    import twoview as tv

    from .exporter import Job, export
    job = Job(arguments.database, arguments.images, arguments.pairs, arguments.sequential,
              tuple(arguments.camera), arguments.schema, arguments.append, arguments.quiet or arguments.json)
    counts = export(job, *(settings.options_of(arguments, kind) for kind in
                           (tv.FeatureOptions, tv.MatchOptions, tv.EstimateOptions)))
    kinds = ", ".join(f"{n} {kind}" for kind, n in counts["configurations"].items())
    _say(arguments, counts, f"{arguments.database}: {counts['images']} images ({counts['new_images']} new), "
                            f"{counts['pairs']} pairs ({kinds or 'none new'})")
    if counts["pairs"] and not counts["pairs_verified"]:
        print("twoview: no pair has a geometry", file=sys.stderr)
        return EXIT_NO_POSE
    return EXIT_DONE


def _say(arguments, result, words):
    if arguments.json:
        print(json.dumps(result))
    elif not arguments.quiet:
        print(words)


def _parser():
    parser = Parser(prog="twoview colmap", description="COLMAP databases and models, in and out")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=Parser)
    _add_export(verbs)
    for verb in verbs.choices.values():
        verb.add_argument("--json", action="store_true", help="print the result alone, as JSON, on stdout")
        verb.add_argument("--quiet", action="store_true", help="print nothing on stdout")
    return parser


class _Ended(BaseException):
    """A signal that ends the program, after the cleaning up."""

    def __init__(self, number):
        super().__init__()
        self.number = number


def _end(number, _frame):
    raise _Ended(number)


def main(arguments=None):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _end)
    try:
        parsed = _parser().parse_args(arguments)
        return parsed.run(parsed)
    except (BadInput, OSError, sqlite3.Error, MemoryError) as error:
        print("twoview: " + " ".join(str(error).split()), file=sys.stderr)
        return EXIT_BAD_INPUT
    except _Ended as ended:  # ends as the signal would have
        signal.signal(ended.number, signal.SIG_DFL)
        os.kill(os.getpid(), ended.number)
        raise
