"""Makes the report's page: one file with tables, plots and every pair, which needs no network."""

import base64
import json
import os

import cv2
import jinja2
import numpy as np

from .. import ROOT
from ..accuracy import datasets
from . import pair_run, plots, systems

PARTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "page")
HISTOGRAM_EDGES_PX = pair_run.HISTOGRAM_EDGES_PX.tolist()
THUMBNAIL_PX, THUMBNAIL_QUALITY = 420, 55


def thumbnails(tasks):
    """Returns ({(set, name): index}, [{"src", "width", "height"}]). width and height are those of
    the image at the scale that the systems used."""
    index, images = {}, []
    for task in tasks:
        for view in task["views"]:
            key = task["set"], view["name"]
            if key in index:
                continue
            index[key] = len(images)
            gray = datasets.resized_luma(view["path"], task["resize"])[0]
            size = datasets.resized_shape(gray.shape[1], gray.shape[0], THUMBNAIL_PX)
            small = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
            coded = cv2.imencode(".webp", small, [cv2.IMWRITE_WEBP_QUALITY, THUMBNAIL_QUALITY])[1]
            images.append({"src": "data:image/webp;base64," + base64.b64encode(coded).decode(),
                           "width": gray.shape[1], "height": gray.shape[0]})
    return index, images


def short(value, digits=4):
    """A number rounded to this many significant digits, for the data of the page."""
    return None if value is None else float(f"{value:.{digits}g}")


def flat(rows):
    return [int(round(value)) for row in rows for value in row]


def pair_data(pair, index, names):
    """The data from which the page's script draws a pair."""
    rows = []
    for kind in ("pipeline", "solver"):
        for name, row in pair["rows"][kind].items():
            entry = [names[kind, name], row["status"], short(row["rotation_error_deg"]),
                     short(row["translation_error_deg"]), short(row["pose_error_deg"]),
                     row["num_matches"], row["num_inliers"], short(row["precision"], 3),
                     short(row["time_ms"], 3), row["message"]]
            rows.append(entry)
    pictures = {}
    for name, overlay in pair["overlays"].items():
        row = pair["rows"]["pipeline"].get(name)
        if row is None:
            continue
        pose = None if row["R"] is None else [short(v, 7) for v in np.ravel(row["R"])] + [
            short(v, 7) for v in row["t"]]
        pictures[names["pipeline", name]] = {
            "in": flat(overlay["inliers"]), "out": flat(overlay["outliers"]), "pose": pose,
            "shift": [short(v, 4) for v in row.get("principal_point_shift_px", (0, 0))],
            "within": overlay["num_within"]}
    reference = pair["reference"]
    return {"set": pair["set"], "names": [pair["name0"], pair["name1"]],
            "images": [index[pair["set"], pair[n]] for n in ("name0", "name1")],
            "cameras": pair["cameras"] and [
                [short(v, 9) for v in (K[0][0], K[1][1], K[0][2], K[1][2], *distortion)]
                for K, distortion in pair["cameras"]],
            "reference": reference and [short(v, 7) for v in np.ravel(reference["R"])] + [
                short(v, 7) for v in np.array(reference["t"])
                / max(1e-300, np.linalg.norm(reference["t"]))],
            "rows": rows, "pictures": pictures}


def cells(system):
    """The cells of a row of a table. `system` is a system of the report, whose values are those of
    all pairs, or its entry for one set."""
    return {key: system[key] for key in ("auc", "median_error_deg", "median_rotation_error_deg",
                                         "median_translation_error_deg", "time_ms", "failures",
                                         "num_pairs", "num_scored", "num_matches", "num_inliers",
                                         "precision", "statuses")}


def table_groups(report):
    """[(title, kind, [(name of the set, number of pairs, [(system, its cells)])])]."""
    groups = []
    for kind, title in (("pipeline", "Whole pipelines, each from its own features"),
                        ("solver",
                         f"Solvers on identical matches, those of {report['matches_of']}")):
        listed = [s for s in report["systems"] if s["kind"] == kind]
        if not listed:
            continue
        parts = [("all", report["num_pairs"], [(s, cells(s)) for s in listed])]
        if len(report["sets"]) > 1:
            parts += [(name, count, [(s, cells(s["sets"][name])) for s in listed])
                      for name, count in report["sets"].items()]
        groups.append((title, kind, parts))
    return groups


def script_text(value):
    """Encodes a value as JSON that contains no '</', so that it cannot end a script element."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def number(value, form):
    return "–" if value is None else format(value, form)


def read(*path):
    with open(os.path.join(*path), encoding="utf-8") as f:
        return f.read()


def program_style():
    """The style sheet of the program's own report: in the source tree, or beside page.css in an
    installation."""
    tree = os.path.join(ROOT, "tools", "twoview", "report", "style.css")
    return read(tree) if os.path.isfile(tree) else read(PARTS, "style.css")


def render(report, pairs, tasks):
    index, images = thumbnails(tasks)
    drawn = [s for kind in ("pipeline", "solver")
             for s in systems.of_kind(kind, report["options"]["systems"])]
    drawn += systems.own_of(report["own"])
    names = {(s.kind, s.id): i for i, s in enumerate(drawn)}
    data = {"systems": [{"id": s.id, "name": s.name, "kind": s.kind, "colour": plots.colour(s)}
                        for s in drawn],
            "images": images, "pairs": [pair_data(p, index, names) for p in pairs],
            "matchesOf": report["matches_of"], "maxErrorPx": report["options"]["max_error_px"]}
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["number"] = number
    from plotly.offline import get_plotlyjs
    return environment.from_string(read(PARTS, "page.html")).render(
        report=report, groups=table_groups(report),
        style=program_style() + read(PARTS, "page.css"),
        script=read(PARTS, "page.js"), plotly=get_plotlyjs(), data=script_text(data),
        plots=[{**plot, "json": script_text(plot["figure"])}
               for plot in plots.all_plots(report, pairs)],
        missing=sorted((m, v["missing"]) for m, v in report["versions"].items() if "missing" in v))
