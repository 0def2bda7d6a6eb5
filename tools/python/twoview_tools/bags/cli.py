"""The command lines of `twoview import` and `twoview export`."""

import argparse
import importlib.util
import json
import os
import pathlib
import signal
import sys

from .. import advice
from ..parser import Parser
from . import BadInput

IMPORT = """Reads a bag of ROS 1 (.bag), of ROS 2 (a folder, .db3 or .mcap) or an MCAP file of
either, and writes a set folder that the other verbs read: frames.txt, images/, cameras.yaml (of
CameraInfo), imu.txt (attitudes of Imu) and groundtruth.txt (Odometry, PoseStamped,
PoseWithCovarianceStamped or TransformStamped).

  twoview import flight.bag --list
  twoview import flight.bag -o flight
  twoview odometry flight -o path

Exit status: 0; 2 for bad input (one line on stderr, and nothing is written)."""
EXPORT = """Writes what `twoview odometry` wrote into a folder as a bag: the path as
nav_msgs/Odometry, the map's points as sensor_msgs/PointCloud2, and how both are turned to ROS's
axes as tf_static.

  twoview export path -o path.mcap

FILE.bag is a bag of ROS 1, FILE.mcap an MCAP file of ROS 2; any other name is the folder of a ROS 2
bag. Exit status: 0; 2 for bad input (one line on stderr, and nothing is written)."""


class _Ended(BaseException):
    """A signal that ends the process, after what is half written was removed."""


def _end(number, _):
    raise _Ended(number)


def _parser(verb, about):
    parser = Parser(prog=f"twoview {verb}", speaker=f"twoview: {verb}", description=about,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print the result alone, as JSON")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    return parser


def _say(arguments, summary, lines):
    """The summary on stdout, as the other verbs have it; notes go to stderr beside JSON."""
    if arguments.json:
        print(json.dumps(summary, indent=2))
    elif not arguments.quiet:
        for label, text in lines:
            print(f"{label:<12} {text}")
    where = sys.stderr if arguments.json or arguments.quiet else sys.stdout
    begin = f"{'note':<12} " if where is sys.stdout else "twoview: note: "
    for note in summary.get("notes", []):
        print(begin + note, file=where)


def _import(argv):
    parser = _parser("import", IMPORT)
    parser.add_argument("bag", metavar="BAG", help="a file or the folder of a ROS 2 bag")
    parser.add_argument("-o", dest="output", metavar="SET", help="the new folder")
    parser.add_argument("--list", action="store_true",
                        help="only print the topics: types, numbers of messages, rates")
    for option, what in (("--image", "of the pictures"),
                         ("--camera-info", "of the camera, or none"),
                         ("--imu", "of the attitudes, or none"),
                         ("--truth", "of the true poses, or none")):
        parser.add_argument(option, metavar="TOPIC",
                            help=f"topic {what} (where the bag has one only: that one)")
    parser.add_argument("--time", choices=("header", "receive"),
                        help="the stamps of the headers (the default, where they have any), or "
                             "when the bag received the messages")
    parser.add_argument("--body-from-cam", nargs=4, type=float, metavar=("W", "X", "Y", "Z"),
                        help="how the camera is mounted, as in imu.txt (default: by tf_static)")
    arguments = parser.parse_args(argv)
    if not arguments.list and not arguments.output:
        parser.error("-o SET is required (or --list)")
    mount = arguments.body_from_cam
    if mount is not None and not sum(value * value for value in mount) > 1e-6:
        parser.error("--body-from-cam is no quaternion: its length is 0")
    from .importer import import_bag, list_topics
    from .storage import open_bag
    if not os.path.exists(arguments.bag):
        raise BadInput(f"cannot read {arguments.bag}: there is none")
    with open_bag(arguments.bag) as bag:
        if arguments.list:
            rows = list_topics(bag)
            _say(arguments, {"source": arguments.bag, "kind": bag.kind, "topics": rows,
                             "notes": [bag.cut] if bag.cut else []}, _topic_lines(bag, rows))
            return 0
        summary = import_bag(bag, arguments)
    topics = summary["topics"]
    size = "" if summary["size"] is None else "{}x{} ".format(*summary["size"])
    lines = [("source", f"{arguments.bag}: {summary['kind']}"),
             ("frames", f"{summary['num_frames']} of {topics['image']}, "
                        f"{size}{summary['encoding']}, {summary['seconds']:.1f} s")]
    if topics["camera_info"]:
        lines.append(("camera", f"cameras.yaml of {topics['camera_info']}"))
    if topics["imu"]:
        lines.append(("attitudes", f"{summary['num_attitudes']} of {topics['imu']}"))
    if topics["truth"]:
        lines.append(("truth", f"{summary['num_poses']} poses of {topics['truth']}"))
    _say(arguments, summary, [*lines, ("files", arguments.output)])
    return 0


def _topic_lines(bag, rows):
    yield "source", f"{bag.path}: {bag.kind}"
    if not rows:
        yield "topics", "none"
    widths = [max(len(row[key]) for row in rows) for key in ("name", "type")] if rows else ()
    for row in rows:
        rate = "" if row["rate_hz"] is None else f"{row['rate_hz']:9.2f} Hz"
        used = row["used_for"]
        if row["encoding"] not in ("ros1", "cdr"):
            used = f"not read: {row['encoding'] or 'no encoding'}"
        yield "topic", (f"{row['name']:<{widths[0]}}  {row['type']:<{widths[1]}}  {row['count']:>8}"
                        f"{rate:>12}  {used}").rstrip()


def _export(argv):
    parser = _parser("export", EXPORT)
    parser.add_argument("folder", metavar="DIR", type=pathlib.Path,
                        help="what twoview odometry wrote")
    parser.add_argument("-o", dest="output", metavar="FILE", type=pathlib.Path, required=True,
                        help="the new bag")
    parser.add_argument("--storage", choices=("sqlite3", "mcap"), default="sqlite3",
                        help="of the folder of a ROS 2 bag (default: %(default)s)")
    parser.add_argument("--poses", choices=("trajectory", "live"), default="trajectory",
                        help="the path in the finished map, or as each pose was known when its "
                             "frame was tracked (default: %(default)s)")
    arguments = parser.parse_args(argv)
    from .exporter import export
    summary = export(arguments)
    _say(arguments, summary, [
        ("path", f"{summary['num_poses']} poses, {summary['num_segments']} "
                 f"segment{'s' * (summary['num_segments'] != 1)}"),
        ("cloud", f"{summary['num_points']} points"), ("files", arguments.output)])
    return 0


VERBS = {"import": _import, "export": _export}


def main(verb, argv=None):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _end)
    try:
        return VERBS[verb](argv)
    except ImportError as error:
        missing = [name for name in ("rosbags", "mcap") if importlib.util.find_spec(name) is None]
        print(f"twoview: {verb}: {error} "
              f"({advice(missing or [(error.name or '').partition('.')[0]])})", file=sys.stderr)
    except OSError as error:
        print(f"twoview: {verb}: {error.filename or 'output'}: {error.strerror or error}",
              file=sys.stderr)
    except (BadInput, MemoryError) as error:
        words = " ".join(str(error).split()) or "out of memory"
        print(f"twoview: {verb}: {words}", file=sys.stderr)
    except _Ended as ended:  # ends this process by the signal that it received
        signal.signal(ended.args[0], signal.SIG_DFL)
        os.kill(os.getpid(), ended.args[0])
    return 2
