"""Summarises results over pairs."""

import os
import time

import numpy as np

from ..accuracy import metrics, tables
from . import pair_run, systems

ERROR_KEYS = ("rotation_error_deg", "translation_error_deg", "translation_error_signed_deg",
              "pose_error_deg")


def reference_words(arguments, run, pairs):
    """A description of the reference that the errors refer to, for every table."""
    known = sum(p["reference"] is not None for p in pairs)
    if arguments.reference == "colmap":
        words = ("Reference: COLMAP's own reconstruction of these images (pycolmap "
                 f"{run['versions']['pycolmap'].get('version', '?')}), not ground truth")
    else:
        words = "Reference: the true poses of the lists"
    if known == len(pairs):
        return f"{words}; all {len(pairs)} pairs have one."
    return (f"{words}; {known} of {len(pairs)} pairs have one, the others count in no error and no "
            "AUC.")


def errors_of(rows):
    """The pose errors of these rows, all of pairs with a reference; infinite without a pose."""
    return np.array([np.inf if row["pose_error_deg"] is None else row["pose_error_deg"]
                     for row in rows], float)


def summarise(rows, has_reference):
    """Summarises a system over pairs. rows: its rows. has_reference: a flag for each row."""
    scored = [row for row, known in zip(rows, has_reference) if known]
    errors = errors_of(scored)
    signed = np.array([np.inf if r["pose_error_deg"] is None else
                       max(r["rotation_error_deg"], r["translation_error_signed_deg"])
                       for r in scored])
    auc = {f"{t:g}": metrics.auc(errors, t) if len(errors) else None
           for t in metrics.THRESHOLDS_DEG}
    times = [r["time_ms"] for r in rows if r["time_ms"] is not None]
    return metrics.finite({
        "auc": auc,
        "auc_signed": {f"{t:g}": metrics.auc(signed, t) if len(errors) else None
                       for t in metrics.THRESHOLDS_DEG},
        "median_error_deg": float(np.median(errors)) if len(errors) else None,
        "median_rotation_error_deg": _median([r["rotation_error_deg"] for r in scored]),
        "median_translation_error_deg": _median([r["translation_error_deg"] for r in scored]),
        "time_ms": float(np.median(times)) if times else None,
        "time_ms_p95": float(np.percentile(times, 95)) if times else None,
        "failures": sum(r["status"] != "ok" for r in rows),
        "statuses": {s: sum(r["status"] == s for r in rows)
                     for s in sorted({r["status"] for r in rows})},
        "num_pairs": len(rows), "num_scored": len(scored),
        "num_matches": _mean([r["num_matches"] for r in rows]),
        "num_inliers": _mean([r["num_inliers"] for r in rows]),
        "precision": _mean([r["precision"] for r in rows])})


def _median(values):
    return float(np.median([np.inf if v is None else v for v in values])) if values else None


def _mean(values):
    values = [v for v in values if v is not None]
    return float(np.mean(values)) if values else None


def summarise_points(rows):
    told = [r for r in rows if r["status"] == "ok" and r["num_points"]]
    return {"num_pairs": len(rows), "failures": sum(r["status"] != "ok" for r in rows),
            "num_points": sum(r["num_points"] for r in told),
            "in_front": (sum(r["num_in_front"] for r in told)
                         / max(1, sum(r["num_points"] for r in told)) if told else None),
            "median_error_px": _middle([r["median_error_px"] for r in told]),
            "p95_error_px": _middle([r["p95_error_px"] for r in told]),
            "time_us_per_point": _middle([r["time_us_per_point"] for r in told])}


def _middle(values):
    values = [v for v in values if v is not None]
    return float(np.median(values)) if values else None


def time_shares(pairs):
    """The seconds of CPU of each module's systems over all pairs."""
    modules = {f"{s.kind} {s.id}": s.module for s in systems.SYSTEMS}
    # The estimate is ours where the matches are not.
    seconds = {}
    for pair in pairs:
        for key, value in pair["seconds"].items():
            module = modules.get(key, "twoview")
            seconds[module] = seconds.get(module, 0) + value
    return seconds


def make_report(arguments, run, pairs):
    known = [p["reference"] is not None for p in pairs]
    sets = list(dict.fromkeys(p["set"] for p in pairs))
    listed = []
    for system in (*systems.SYSTEMS, *systems.own_of(arguments.own)):
        if system.id not in arguments.systems or system.kind == "triangulation":
            continue
        rows = [p["rows"][system.kind][system.id] for p in pairs]
        entry = {"id": system.id, "name": system.name, **version(system, run),
                 "kind": system.kind, "note": system.note, "options": system.options,
                 "seed": arguments.seed, **summarise(rows, known)}
        entry["sets"] = {name: summarise([r for r, p in zip(rows, pairs) if p["set"] == name],
                                         [k for k, p in zip(known, pairs) if p["set"] == name])
                         for name in sets}
        listed.append(entry)
    points = [{"id": s.id, "name": s.name, **version(s, run), "note": s.note, "options": s.options,
               **summarise_points([p["rows"]["triangulation"][s.id] for p in pairs])}
              for s in systems.of_kind("triangulation", arguments.systems)]
    seconds = time_shares(pairs)
    return {
        "systems": listed, "triangulations": points,
        "reference": arguments.reference,
        "reference_words": reference_words(arguments, run, pairs),
        "reference_of_sets": run["reference_of_sets"],
        "matches_of": arguments.matches,
        "own": [{key: entry[key] for key in ("id", "note", "options")} for entry in arguments.own],
        "num_pairs": len(pairs), "sets": {s: sum(p["set"] == s for p in pairs) for s in sets},
        "options": {"max_error_px": arguments.max_error_px, "resize": run["resize"],
                    "mask": arguments.mask or None,
                    "seed": arguments.seed, "timeout_s": arguments.timeout,
                    "jobs": arguments.jobs, "systems": arguments.systems},
        "versions": run["versions"], "machine": tables.machine(), "where": run["where"],
        "made": time.strftime("%Y-%m-%d %H:%M:%S %Z"),
        "wall_seconds": run["wall_seconds"], "pairs_run_now": run["pairs_run_now"],
        "seconds": {"all": sum(seconds.values()), "by_module": seconds,
                    "twoview_share": seconds.get("twoview", 0) / max(1e-9, sum(seconds.values()))},
        "histogram_edges_px": pair_run.HISTOGRAM_EDGES_PX.tolist(),
        "pairs": [{k: v for k, v in p.items() if k != "overlays"} for p in pairs]}


def version(system, run):
    found = run["versions"].get(system.module, {})
    return {"version": found.get("version"), "missing": found.get("missing")}


# ---- the terminal ------------------------------------------------------------------------------

def _cell(value, form):
    return "-" if value is None else format(value, form)


def print_summary(report, folder):
    width = max(len(s["name"]) for s in report["systems"] + report["triangulations"])
    for kind, title in (("pipeline", "whole pipelines"),
                        ("solver", f"solvers on {report['matches_of']}'s matches")):
        part = [s for s in report["systems"] if s["kind"] == kind]
        if not part:
            continue
        print(f"\n{title}: {report['num_pairs']} pairs\n  {'':<{width}} {'AUC5':>6} {'AUC10':>6} "
              f"{'AUC20':>6} {'median':>8} {'no pose':>8} {'ms':>9}")
        for s in part:
            auc = " ".join(f"{_cell(v, '6.1f'):>6}" for v in s["auc"].values())
            median = f"{_cell(s['median_error_deg'], '8.2f'):>8}"
            print(f"  {s['name']:<{width}} {auc} {median} {s['failures']:>8} "
                  f"{_cell(s['time_ms'], '9.1f'):>9}" + ("  missing" if s["missing"] else ""))
    if report["triangulations"]:
        print(f"\ntriangulations of the same matches with the same poses\n  {'':<{width}} "
              f"{'in front':>8} {'median px':>10} {'us a point':>11}")
        for s in report["triangulations"]:
            front = "-" if s["in_front"] is None else f"{100 * s['in_front']:.2f} %"
            print(f"  {s['name']:<{width}} {front:>8} {_cell(s['median_error_px'], '.4f'):>10} "
                  f"{_cell(s['time_us_per_point'], '.3f'):>11}")
    print(f"\n{report['reference_words']}\n{report['wall_seconds']:.0f} s for "
          f"{report['pairs_run_now']} pairs; {report['seconds']['all']:.0f} s of CPU for all, "
          f"{100 * report['seconds']['twoview_share']:.2f} % of it twoview's\n"
          f"{os.path.join(folder, 'index.html')}")
