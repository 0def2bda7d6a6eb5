"""compare_colmap: the command line, the run over all pairs, and the files that it writes."""

import contextlib
import hashlib
import importlib.util
import json
import os
import re
import signal
import sys
import time

import numpy as np

from .. import formats, own_matches
from ..accuracy import datasets
from ..colmap.errors import BadInput
from ..colmap.masks import Masks
from ..folders import foreign_result, foreign_words
from ..progress import Lines, on_terminal
from ..sizes import MAX_NATIVE_SIDE, RESIZE_LONG_SIDE
from ..unread import unread_picture
from . import cluster, extras, report_files, results, systems
from .arguments import PIPELINES, PROGRAM, make_parser

FORMAT = 1  # increase it if a change here changes the stored result of a pair
REFERENCE_TIMEOUT_S = 3600
TABLES, FIGURES = ("csv", "tex"), ("svg", "pdf", "png")


# ---- the command line --------------------------------------------------------------------------

def parse(words):
    arguments = make_parser().parse_args(words)
    if arguments.jobs < 1:
        raise BadInput("--jobs: at least 1")
    if not 0 <= arguments.seed < 2**31:
        raise BadInput("--seed: from 0 to 2147483647")
    if not arguments.max_error_px > 0 or not arguments.timeout > 0:
        raise BadInput("--max-error-px and --timeout: above 0")
    if arguments.matches_resize is not None and (arguments.matches_resize < 0
                                                 or arguments.matches in PIPELINES):
        raise BadInput("--matches-resize: not below 0, and with a folder of --matches")
    if (arguments.resize or 0) < 0 or arguments.max_pairs < 0:
        raise BadInput("--resize and --max-pairs: not below 0")
    try:
        arguments.systems = systems.chosen(arguments.systems)
    except ValueError as error:
        raise BadInput(f"--systems: {error}") from error
    arguments.own = own_systems(arguments)
    arguments.systems += [entry["id"] for entry in arguments.own]
    arguments.tables = chosen_words("--tables", arguments.tables, TABLES)
    arguments.figures = chosen_words("--figures", arguments.figures, FIGURES)
    if arguments.figures and importlib.util.find_spec("matplotlib") is None:
        raise BadInput("--figures needs matplotlib: pip install matplotlib")
    return arguments


def chosen_words(flag, text, known):
    words = [word for word in text.split(",") if word]
    for word in words:
        if word not in known:
            raise BadInput(f"{flag}: '{word}' is none of {', '.join(known)}")
    return list(dict.fromkeys(words))


def named_path(given):
    """(name, path) of [NAME=]PATH; without a name that of the file or folder."""
    if "=" in given and not os.path.exists(given):
        return tuple(given.split("=", 1))
    return os.path.splitext(os.path.basename(os.path.abspath(given)))[0], given


def own_systems(arguments):
    """The user's systems: the folder of --matches, which arguments.matches then names, and the
    files of --poses."""
    entries = []
    try:
        if arguments.matches not in PIPELINES:
            name, folder = named_path(arguments.matches)
            if not os.path.isdir(folder):
                raise BadInput(f"--matches: {arguments.matches} is no folder and none of "
                               f"{', '.join(PIPELINES)}")
            entries.append({"id": name, "note": "matches of your own, twoview's estimate",
                            "options": {"matches": os.path.abspath(folder),
                                        "matches_resize": arguments.matches_resize},
                            "folder": own_matches.MatchFolder(folder)})
            arguments.matches = name
        for given in arguments.poses:
            name, path = named_path(given)
            entries.append({"id": name, "note": "poses of your own",
                            "options": {"poses": os.path.abspath(path)},
                            "poses": own_matches.read_poses(path)})
    except own_matches.Refused as error:
        raise BadInput(str(error)) from error
    except OSError as error:
        raise BadInput(f"{error.filename}: {error.strerror}") from error
    names = [s.id for s in systems.SYSTEMS] + [entry["id"] for entry in entries]
    for entry in entries:
        if not re.fullmatch(r"[\w.+-]+", entry["id"]) or names.count(entry["id"]) > 1:
            raise BadInput(f"'{entry['id']}' cannot be the name of your system; give NAME=PATH "
                           "with another name")
    return entries


def own_of_pair(entries, name0, name1):
    """What the user's systems have of a pair, as a task has it. Raises BadInput."""
    found = []
    for entry in entries:
        options = dict(entry["options"])
        if "folder" in entry:
            try:
                options["file"], options["exchanged"] = entry["folder"].find(name0, name1)
            except own_matches.Refused as error:
                raise BadInput(str(error)) from error
            if options["file"]:
                with open(options["file"], "rb") as file:
                    options["sha256"] = hashlib.sha256(file.read()).hexdigest()
        else:
            pose = own_matches.pose_of_pair(entry["poses"], name0, name1)
            options["listed"] = bool({(name0, name1), (name1, name0)} & set(entry["poses"]))
            options["pose"] = pose and {"R": pose[0].tolist(), "t": pose[1].tolist()}
        found.append({"id": entry["id"], "note": entry["note"], "options": options})
    return found


def unique_names(paths):
    """A unique name for each list: that of its folder, with the list's own name after it where
    several lists have that folder name. Raises BadInput for two equal names."""
    folders = [os.path.basename(os.path.dirname(os.path.abspath(p))) for p in paths]
    stems = [os.path.splitext(os.path.basename(p))[0] for p in paths]
    names = [f if folders.count(f) == 1 else f"{f}/{s}" for f, s in zip(folders, stems)]
    if len(set(names)) < len(names):
        raise BadInput("a list of pairs is named twice")
    return names


def read_lists(arguments):
    """The pairs of every list as tasks, without a reference. Raises BadInput if a list or its
    cameras cannot be read, or if there is no folder of images."""
    tasks = []
    for path, name in zip(arguments.pairs, unique_names(arguments.pairs)):
        try:
            pairs = datasets.read_measurable(path, needs_truth=False)
            cameras = datasets.read_cameras(os.path.dirname(os.path.abspath(path)))
        except OSError as error:
            raise BadInput(f"{path}: {error.strerror or error}") from error
        except ValueError as error:
            raise BadInput(str(error)) from error
        folder = arguments.images or os.path.join(os.path.dirname(os.path.abspath(path)), "images")
        if not os.path.isdir(folder):
            raise BadInput(f"{folder} is not a folder; --images names the images'")
        tasks += [make_task(arguments, name, folder, pair, cameras) for pair in pairs]
    return tasks


def make_task(arguments, name, folder, pair, cameras):
    views, masks = [], Masks(arguments.mask)
    for image, K in ((pair.name0, pair.K0), (pair.name1, pair.K1)):
        try:
            camera = formats.choose_camera(cameras, image, K)
            if camera is not None:
                formats.check_K(camera, image, K, camera.width, camera.height)
            distortion = datasets.distortion_of(camera)
        except ValueError as error:
            raise BadInput(f"{name}: {error}") from error
        views.append({"name": image, "path": os.path.abspath(os.path.join(folder, image)),
                      "K": K.tolist(), "distortion": distortion, "has_entry": camera is not None,
                      "mask": arguments.mask and os.path.abspath(masks.file_of(image))})
    truth = None if pair.R is None else {"R": pair.R.tolist(), "t": pair.t.tolist()}
    return {"what": "pair", "set": name, "views": views, "truth": truth,
            "resize": arguments.resize, "systems": arguments.systems,
            "own": own_of_pair(arguments.own, pair.name0, pair.name1),
            "matches_of": arguments.matches, "max_error_px": arguments.max_error_px,
            "seed": arguments.seed, "timeout_s": arguments.timeout, "library": library_path()}


def library_path():
    """The path of libtwoview.so, which is the same for every worker."""
    from ..accuracy import twoview_ctypes
    return os.path.abspath(os.environ.get("TWOVIEW_LIBRARY") or twoview_ctypes.DEFAULT_LIBRARY)


def thin_out(tasks, most):
    """At most `most` pairs of each list, evenly spaced; all of them if `most` is 0."""
    found = []
    for name in dict.fromkeys(t["set"] for t in tasks):
        part = [t for t in tasks if t["set"] == name]
        if most and most < len(part):
            part = [part[i] for i in sorted({round(x) for x in
                                             np.linspace(0, len(part) - 1, most)})]
        found += part
    return found


def check_images(tasks, default_resize, mask=""):
    """Reads every image once; its hash shows in a later run whether the file has changed. Sets each
    task's "resize": with default_resize the value for the width of the first image of its list that
    no earlier list has (0 before there is one). Returns {path: hash}. BadInput names the first
    image that cannot be read and the number of the others."""
    hashes, bad, resize, masks = {}, [], {}, Masks(mask)
    for task in tasks:
        for view in task["views"]:
            path = view["path"]
            if path in hashes or path in bad:
                continue
            try:
                with open(path, "rb") as f:
                    content = hashlib.sha256(f.read()).hexdigest()
                luma = datasets.read_luma(path)
                masks.of(view["name"], luma)
                if view["mask"]:
                    with open(view["mask"], "rb") as f:
                        hashes[view["mask"]] = hashlib.sha256(f.read()).hexdigest()
                height, width = luma.shape
                if default_resize and task["set"] not in resize:
                    resize[task["set"]] = datasets.default_resize(width, height)
                hashes[path] = content
            except (OSError, ValueError):
                bad.append(path)
        task["resize"] = resize.get(task["set"], 0) if default_resize else task["resize"]
    if bad:
        others = f", and {len(bad) - 1} more" if len(bad) > 1 else ""
        unread = unread_picture(bad[0])
        why = f": {'the first' if others else 'it'} {unread}" if unread else ""
        raise BadInput(f"cannot read the image {bad[0]}{others}{why}")
    return hashes


def contents(views, hashes):
    """The hashes of the images and their masks."""
    return [hashes[view[key]] for key in ("path", "mask") for view in views if view[key]]


# ---- the reference -----------------------------------------------------------------------------

def set_references(arguments, tasks, workers, store, hashes):
    """Sets each task's "reference": the true pose, or COLMAP's. Returns the report's description of
    the reference."""
    if arguments.reference == "truth":
        for task in tasks:
            task["reference"] = task["truth"]
        return {}
    told = {}
    for name in dict.fromkeys(task["set"] for task in tasks):
        part = [t for t in tasks if t["set"] == name]
        models = _reconstruct(arguments, part, workers, store, hashes)
        for task in part:
            task["reference"] = relative_pose(models, *(v["name"] for v in task["views"]))
        images = {v["name"] for t in part for v in t["views"]}
        told[name] = {"images": len(images), "models": [len(model) for model in models],
                      "pairs": len(part), "pairs_with_pose": sum(bool(t["reference"])
                                                                 for t in part)}
    return told


def _reconstruct(arguments, part, workers, store, hashes):
    images = {v["name"]: {key: v[key] for key in ("path", "K", "distortion", "mask")}
              for t in part for v in t["views"]}
    task = {"what": "reference", "set": part[0]["set"], "images": images,
            "resize": part[0]["resize"], "seed": arguments.seed, "threads": arguments.jobs,
            "pairs": [[v["name"] for v in t["views"]] for t in part],
            "timeout_s": REFERENCE_TIMEOUT_S}
    key = digest({**task, "threads": 0}, contents(images.values(), hashes))
    models = store.get(key)
    if models is None:
        try:
            (_, models), = workers.run([task])
        except Exception as error:
            raise BadInput(f"{part[0]['set']}: COLMAP made no reconstruction: {error}") from error
        store.put(key, models)
    return models


def relative_pose(models, name0, name1):
    """The pose cam1_from_cam0 of two images, with |t| = 1, from the first model that contains both
    at different places; None if there is no such model."""
    for model in models:
        if name0 in model and name1 in model and name0 != name1:
            (R0, t0), (R1, t1) = ((np.array(model[n]["R"]), np.array(model[n]["t"]))
                                  for n in (name0, name1))
            R = R1 @ R0.T
            t = t1 - R @ t0
            if np.linalg.norm(t) > 0:
                return {"R": R.tolist(), "t": (t / np.linalg.norm(t)).tolist()}
    return None


# ---- a run that may be interrupted -------------------------------------------------------------

def digest(*parts):
    text = json.dumps([FORMAT, *parts], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


class Store:
    """The results of pairs and references, stored in a folder beside the report so that an
    interrupted run can continue. Each result is stored completely or not at all."""

    def __init__(self, folder):
        self.folder = folder
        os.makedirs(folder, exist_ok=True)

    def _path(self, key):
        return os.path.join(self.folder, key + ".json")

    def get(self, key):
        try:
            with open(self._path(key), encoding="utf-8") as f:
                return json.load(f)
        except (FileNotFoundError, ValueError):
            return None

    def put(self, key, value):
        part = self._path(key) + ".part"
        with open(part, "w", encoding="utf-8") as f:
            json.dump(value, f)
        os.replace(part, self._path(key))

    def remove(self):
        for name in os.listdir(self.folder):
            if name.endswith((".json", ".part")):
                os.remove(os.path.join(self.folder, name))
        # The folder may contain files that this program did not write.
        with contextlib.suppress(OSError):
            os.rmdir(self.folder)


def shows_progress(quiet):
    return not quiet and on_terminal()


def run_pairs(tasks, keys, workers, store, quiet):
    """Returns (the results in the order of the tasks, the number of pairs run now). Pairs with a
    stored result are not run again."""
    from tqdm import tqdm
    found = [store.get(key) for key in keys]
    todo = [i for i, result in enumerate(found) if result is None]
    if len(todo) < len(tasks) and not quiet:
        print(f"{PROGRAM}: going on: {len(tasks) - len(todo)} of {len(tasks)} pairs are done",
              file=sys.stderr)
    with tqdm(total=len(tasks), initial=len(tasks) - len(todo), unit="pair", smoothing=0.05,
              disable=not shows_progress(quiet), file=sys.stderr) as bar:
        lines, num_done = Lines(PROGRAM, wanted=not quiet), len(tasks) - len(todo)
        for number, result in workers.run([tasks[i] for i in todo]):
            index = todo[number]
            store.put(keys[index], result)
            found[index] = result
            bar.set_postfix_str(f"{result['name0']} {result['name1']}", refresh=False)
            bar.update()
            num_done += 1
            lines.tell(f"{num_done} of {len(tasks)} pairs")
    return found, len(todo)


def compare(arguments):
    tasks = read_lists(arguments)
    tasks = thin_out(tasks, arguments.max_pairs)
    hashes = check_images(tasks, arguments.resize is None, arguments.mask)
    if arguments.resize is None and any(t["resize"] for t in tasks) and not arguments.quiet:
        print(f"{PROGRAM}: images are compared at {RESIZE_LONG_SIDE} pixels a side where the first "
              f"of their list is above {MAX_NATIVE_SIDE} (--resize 0: as they are)",
              file=sys.stderr)
    folder = os.path.abspath(arguments.output)
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise BadInput(f"-o: {folder} is a file")
    files = ("index.html", "pairs.csv", "report.json")
    if name := foreign_result(folder, files, files):
        raise BadInput(foreign_words(arguments.output, name, "compare"))
    try:
        store = Store(os.path.join(folder, "unfinished"))
    except OSError as error:
        raise BadInput(f"-o: {error.filename}: {error.strerror}") from error
    if arguments.reference == "truth" and not any(t["truth"] for t in tasks) \
            and not arguments.quiet:
        print(f"{PROGRAM}: no pair has a true pose, so there are no errors; --reference colmap "
              "takes COLMAP's reconstruction", file=sys.stderr)
    start = time.time()
    try:
        with cluster.workers(arguments.jobs, arguments.scheduler) as workers:
            (_, versions), = workers.run([{"what": "versions", "library": library_path(),
                                           "timeout_s": 120}])
            missing = {m: v["missing"] for m, v in versions.items() if "missing" in v}
            for module, why in missing.items():
                print(f"{PROGRAM}: {module} is missing: {why}", file=sys.stderr)
            told = set_references(arguments, tasks, workers, store, hashes)
            for task in tasks:
                task["missing"] = missing
            keys = [digest(task, versions, contents(task["views"], hashes)) for task in tasks]
            pairs, num_run = run_pairs(tasks, keys, workers, store, arguments.quiet)
            where = workers.description
    except OSError as error:
        if not arguments.scheduler:
            raise
        raise BadInput(f"--scheduler: {arguments.scheduler}: {error}") from error
    run = {
        "versions": versions,
        "missing": missing,
        "reference_of_sets": told,
        "where": where,
        "wall_seconds": time.time() - start,
        "pairs_run_now": num_run,
        "resize": {t["set"]: t["resize"] for t in tasks},
    }
    report = results.make_report(arguments, run, pairs)
    report_files.write(folder, report, pairs, tasks)
    extras.write(folder, report, pairs, arguments.tables, arguments.figures)
    store.remove()
    if not arguments.quiet:
        # The report is complete even if nobody reads this output.
        with contextlib.suppress(BrokenPipeError):
            results.print_summary(report, folder)
            sys.stdout.flush()


def main(words=None):
    signal.signal(signal.SIGTERM, lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
    try:
        compare(parse(words))
    except BadInput as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\n{PROGRAM}: interrupted; the same command goes on where it stopped",
              file=sys.stderr)
        return 130
    except OSError as error:
        print(f"{PROGRAM}: {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
        return 2
    return 0
