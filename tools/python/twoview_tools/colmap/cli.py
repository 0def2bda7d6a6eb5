"""The command line of `twoview colmap`."""

import argparse
import dataclasses
import json
import os
import signal
import sqlite3
import sys

import numpy as np
import twoview as tv

from .. import advice
from . import settings
from .errors import ENDING_SIGNALS, EXIT_BAD_INPUT, EXIT_DONE, EXIT_NO_POSE, BadInput


class Parser(argparse.ArgumentParser):
    """An argument parser that reports bad arguments as one line."""

    def error(self, message):
        raise BadInput(f"{message} (see {self.prog} --help)")


def _count(text):
    value = int(text)
    if value < 1:
        raise ValueError
    return value


def _focal_35mm(text):
    value = float(text)
    if not 1 <= value <= 10000:
        raise ValueError
    return value


def _longer_side(text):
    value = int(text)
    if not 0 <= value <= 16384:
        raise ValueError
    return value


def _focal_sigma(text):
    value = float(text)
    if not 0 <= value <= 0.5:
        raise ValueError
    return value


# argparse names the function in its message: "invalid ... value".
_focal_35mm.__name__ = "millimetres (1 to 10000, with a decimal point)"
_focal_sigma.__name__ = "relative deviation (0 to 0.5, with a decimal point)"
_longer_side.__name__ = "pixels (0 to 16384)"


def _add_size_and_focal(parser):
    parser.add_argument("--focal-35mm", type=_focal_35mm, default=0.0, metavar="MM",
                        help="in place of a camera file: the focal length as for 35 mm film")
    parser.add_argument("--resize", type=_longer_side, metavar="L",
                        help="scale images and cameras down to this longer side, pixels; what is "
                             "written is of such images (default: 0, as they are)")


def _add_mask(parser):
    parser.add_argument("--mask", default="", metavar="FILE|DIR",
                        help="picture of the images' size, black where they are left out; or a "
                             "folder of masks NAME.png")


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
    parser.add_argument(
        "--camera",
        action="append",
        default=[],
        metavar="YAML",
        help="one camera for all images, or several, each for the files whose names begin with its "
             "own",
    )
    _add_size_and_focal(parser)
    _add_mask(parser)
    parser.add_argument("--schema", choices=("4", "3.8"), default="4",
                        help="COLMAP 4, or 3.8 as Debian has it (default: 4)")
    parser.add_argument("--append", action="store_true", help="add to a database that is there")
    parser.add_argument("--effort", choices=tuple(settings.EFFORTS), default="auto",
                        help="try pairs that are not ok with squeezed views, too (auto), or with "
                             "one rung alone; fixed: 0 (default: auto)")
    settings.add_options(parser, max_keypoints=settings.MAPPING_KEYPOINTS)
    parser.set_defaults(run=_export)


def _export(arguments):
    from .exporter import Job, export
    if arguments.camera and arguments.focal_35mm:
        raise BadInput("give either --camera or --focal-35mm")
    job = Job(
        arguments.database,
        arguments.images,
        arguments.pairs,
        arguments.sequential,
        tuple(arguments.camera),
        arguments.schema,
        arguments.append,
        arguments.quiet or arguments.json,
        arguments.focal_35mm,
        arguments.resize,
        arguments.mask,
        arguments.effort,
    )
    counts = export(job, *(settings.options_of(arguments, kind) for kind in
                           (tv.FeatureOptions, tv.MatchOptions, tv.EstimateOptions)))
    kinds = ", ".join(f"{n} {kind}" for kind, n in counts["configurations"].items())
    _say(
        arguments,
        counts,
        f"{arguments.database}: {counts['images']} images ({counts['new_images']} new), "
        f"{counts['pairs']} pairs ({kinds or 'none new'})",
    )
    if counts["pairs"] and not counts["pairs_verified"]:
        print("twoview: no pair has a geometry", file=sys.stderr)
        return EXIT_NO_POSE
    return EXIT_DONE


def _add_import(verbs):
    parser = verbs.add_parser(
        "import", help="a COLMAP model as reference poses, a database's matches as input"
    )
    parser.add_argument(
        "--model", default="", metavar="DIR", help="cameras, images and points3D, .bin or .txt"
    )
    parser.add_argument(
        "--database",
        default="",
        metavar="FILE",
        help="estimate from its features and matches, of COLMAP 3.8 or 4; with --model against its "
             "poses",
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="DIR",
        help="of pairs.txt, cameras.yaml and trajectory.tum; with --database of report.json",
    )
    _choice_of_pairs(parser)
    parser.add_argument(
        "--min-common-points",
        type=int,
        default=30,
        metavar="N",
        help="pairs.txt has the pairs that see as many points of the model (default: 30)",
    )
    parser.add_argument("--camera", action="append", default=[], metavar="YAML",
                        help="for all images, instead of the database's")
    parser.add_argument("--focal-sigma", type=_focal_sigma, metavar="S",
                        help="how sure the focal lengths of a database are, relative (default: "
                             "0.3 where COLMAP guessed them, prior_focal_length 0, else 0)")
    settings.add_options(parser, (tv.MatchOptions, tv.EstimateOptions),
                         **settings.SIGMAS_OF_THE_CAMERA)
    parser.set_defaults(run=_import)


def _import(arguments):
    from .importer import import_database, import_model
    from .model import read_model
    a = arguments
    if not a.model and not a.database:
        raise BadInput("import needs --model or --database (see twoview colmap import --help)")
    model = read_model(a.model) if a.model else None
    if not a.database:
        count = import_model(model, a.output, a.pairs, a.sequential, a.min_common_points)
        _say(a, {"images": len(model.images), "pairs": count,
                 "contradicted_images": sorted(model.contradicted)},
             f"{a.output}: {len(model.images)} images, {count} pairs; the model's focal lengths "
             f"count as measured: a model does not say which were guessed"
             + model.words_on_contradicted())
        return EXIT_DONE
    report = import_database(
        a.database,
        a.output,
        a.pairs,
        a.sequential,
        model,
        a.camera,
        settings.options_of(a, tv.MatchOptions),
        settings.options_of(a, tv.EstimateOptions),
        a.quiet or a.json,
        lambda known: settings.calibrations_of(a, known),
    )
    posed = sum(row["R"] is not None and row["t"] is not None for row in report["pairs"])
    areas = ", ".join(f"{area:.1f}" for area in report["auc"].values() if area is not None)
    ok = sum(row["verdict"] == "ok" for row in report["pairs"])
    _say(a, report, f"{a.output}/report.json: {report['num_pairs']} pairs, {posed} with a pose"
                    f", {ok} of them ok"
                    + (f"; AUC at 5, 10, 20 degrees {areas}" if areas else "")
                    + _words_on_matches(report)
                    + _words_on_invalid(report["invalid_keypoints"], "are NaN or infinite, and "
                                        "their matches are left out")
                    + _words_on_invalid(report["keypoints_outside"], "lie outside its picture: is "
                                        "the camera of pictures of another size?")
                    + (model.words_on_contradicted() if model else "")
                    + _words_on_guessed(report["guessed_focal_lengths"], a))
    return EXIT_DONE if posed else EXIT_NO_POSE


def _words_on_matches(report):
    """Continues the summary: how many pairs have verified matches alone, and how many none."""
    verified = sum(row["matches_from"] == "two_view_geometries" for row in report["pairs"])
    words = (f"; the matches of {verified} pairs are those that COLMAP has verified already, as "
             f"the table matches has none" if verified else "")
    return words + "".join(f"; {count} pairs have no matches: {reason}"
                           for reason, count in report["without_matches"].items())


def _words_on_invalid(counts, what):
    """Continues the summary: the images of which some keypoints are what they must not be."""
    if not counts:
        return ""
    name, count = next(iter(counts.items()))
    return (f"; {count} keypoints of {name} {what}"
            + (f" (so it is with {len(counts) - 1} more images)" if len(counts) > 1 else ""))


def _words_on_guessed(names, arguments):
    """Continues the summary: how many images have a focal length that COLMAP guessed, and how sure
    it counts."""
    if not names:
        return ""
    from .importer import GUESSED
    sigma = settings.calibrations_of(arguments, [GUESSED] * 2)["calibration0"].focal_sigma
    return (f"; the focal length of {len(names)} images was guessed (prior_focal_length 0) and "
            f"counts as known to {100 * sigma:g} % (--focal-sigma, or --camera)")


def _add_model(verbs):
    parser = verbs.add_parser(
        "model", help="two images to a COLMAP text model and a TUM trajectory"
    )
    parser.add_argument("images", nargs=2, metavar="IMAGE")
    parser.add_argument(
        "--camera", default="", metavar="YAML", help="of both images, or of the first"
    )
    parser.add_argument(
        "--camera1", default="", metavar="YAML", help="of the second, where it is another"
    )
    _add_size_and_focal(parser)
    _add_mask(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR",
                        help="of cameras.txt, images.txt, points3D.txt and trajectory.tum")
    settings.add_options(parser, **settings.SIGMAS_OF_THE_CAMERA)
    parser.set_defaults(run=_model)


def _model(arguments):
    from .cameras import film_camera, read_calibration, read_camera
    from .images import read_luma
    from .model import text_model
    from .output import require_own, write_files
    from .trajectory import write_trajectory
    from .two_view_model import reconstruct
    a = arguments
    if bool(a.camera) == bool(a.focal_35mm) or (a.camera1 and a.focal_35mm):
        raise BadInput("model needs either --camera or --focal-35mm")
    if a.focal_35mm:
        cameras = [film_camera(a.focal_35mm, *read_luma(path).shape[::-1]) for path in a.images]
        known = [tv.FILM] * 2
    else:
        files = (a.camera, a.camera1 or a.camera)
        cameras = [read_camera(path) for path in files]
        known = [read_calibration(path) for path in files]
    files = ("cameras.txt", "images.txt", "points3D.txt", "trajectory.tum")
    require_own(a.output, "colmap model", files, files)
    names = [os.path.basename(path) for path in a.images]
    if names[0] == names[1]:
        raise BadInput(
            f"both images are called {names[0]}, and a COLMAP model tells images apart by their "
            f"names"
        )
    for name in names:
        if any(c.isspace() for c in name):
            raise BadInput(f"image '{name}': COLMAP ends a name of a text model at its first "
                           f"blank; rename the picture")
    estimate = dataclasses.replace(settings.options_of(a, tv.EstimateOptions),
                                   **settings.calibrations_of(a, known))
    pose, model = reconstruct(a.images, names, cameras, settings.options_of(a, tv.FeatureOptions),
                              settings.options_of(a, tv.MatchOptions), estimate,
                              resize=a.resize or 0, mask=a.mask)
    if model is None:
        print(f"twoview: no full pose: {pose.kind.name.lower()}", file=sys.stderr)
        return EXIT_NO_POSE
    poses = {names[0]: (np.eye(3), np.zeros(3)), names[1]: (model.R, -model.R.T @ model.t)}
    write_files(a.output, {**text_model(model), "trajectory.tum": write_trajectory(poses)})
    shift = pose.principal_point_shift
    moved = (
        f"; principal point moved by ({shift[0]:+.1f}, {shift[1]:+.1f}) px" if shift.any() else ""
    )
    _say(
        a,
        {
            "points": len(model.points),
            "verdict": pose.verdict.name.lower(),
            "principal_point_shift_px": shift.tolist(),
        },
        f"{a.output}: 2 images, {len(model.points)} points, verdict "
        f"{pose.verdict.name.lower()}{moved}",
    )
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
    _add_import(verbs)
    _add_model(verbs)
    for verb in verbs.choices.values():
        verb.add_argument(
            "--json", action="store_true", help="print the result alone, as JSON, on stdout"
        )
        verb.add_argument("--quiet", action="store_true", help="print nothing on stdout")
    return parser


class _Ended(BaseException):
    """Raised by a signal that ends the program, so that temporary files are removed first."""

    def __init__(self, number):
        super().__init__()
        self.number = number


def _end(number, _frame):
    raise _Ended(number)


def main(arguments=None):
    for number in ENDING_SIGNALS:
        signal.signal(number, _end)
    try:
        parsed = _parser().parse_args(arguments)
        return parsed.run(parsed)
    except ImportError as error:
        print(
            f"twoview: colmap: {error} ({advice([error.name])})",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    except (BadInput, OSError, sqlite3.Error, MemoryError) as error:
        print("twoview: " + " ".join(str(error).split()), file=sys.stderr)
        return EXIT_BAD_INPUT
    except _Ended as ended:  # ends this process by the signal that it received
        signal.signal(ended.number, signal.SIG_DFL)
        os.kill(os.getpid(), ended.number)
        raise
