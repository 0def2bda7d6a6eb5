"""Writes the three files of a report: report.json, pairs.csv and index.html."""

import csv
import io
import json
import os

from ..accuracy import metrics
from . import page, results

CSV_COLUMNS = ("set", "name0", "name1", "system", "kind", "status", *results.ERROR_KEYS,
               "num_keypoints0", "num_keypoints1", "num_matches", "num_inliers", "precision",
               "time_ms", "num_points", "num_in_front", "median_error_px", "p95_error_px",
               "time_us_per_point", "message")


def csv_text(pairs):
    text = io.StringIO()
    table = csv.DictWriter(text, CSV_COLUMNS, restval="", extrasaction="ignore",
                           lineterminator="\n")
    table.writeheader()
    for pair in pairs:
        for kind, rows in pair["rows"].items():
            for name, row in rows.items():
                keypoints = row.get("num_keypoints") or ("", "")
                table.writerow({
                    **{k: pair[k] for k in ("set", "name0", "name1")},
                    **{k: "" if v is None else v for k, v in row.items()},
                    "system": name, "kind": kind,
                    "num_keypoints0": keypoints[0], "num_keypoints1": keypoints[1]})
    return text.getvalue()


def write(folder, report, pairs, tasks):
    """Writes the three files, each completely or not at all. The page is written last because it
    refers to the others."""
    texts = {"report.json": json.dumps(metrics.finite(report), allow_nan=False),
             "pairs.csv": csv_text(pairs),
             "index.html": page.render(report, pairs, tasks)}
    for name, text in texts.items():
        with open(os.path.join(folder, "unfinished", name + ".part"), "w", encoding="utf-8") as f:
            f.write(text)
    for name in texts:
        os.replace(os.path.join(folder, "unfinished", name + ".part"), os.path.join(folder, name))
