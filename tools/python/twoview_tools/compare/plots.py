"""Makes the figures for Plotly as plain dicts, which the page's script draws."""

import json

import numpy as np
import plotly.graph_objects as graph
from plotly.colors import qualitative

from . import results, systems

PALETTE = qualitative.D3
FAMILIES = {"twoview": 0, "pycolmap": 1, "colmap": 3, "cv2": 2, "poselib": 4, "pyopengv": 5,
            "own": 6}
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
MAX_ERROR_DEG, MIN_ERROR_DEG = 20.0, 0.01


def colour(system):
    """The colour of a system's library, the same in every plot."""
    return PALETTE[FAMILIES[system.module]]


def _dash(system, listed):
    family = [s for s in listed if s.module == system.module]
    return DASHES[family.index(system) % len(DASHES)]


def _figure(traces, x, y, **layout):
    figure = graph.Figure(traces)
    figure.update_layout(
        template="none", margin={"l": 62, "r": 16, "t": 12, "b": 52}, hovermode="closest",
        xaxis={"title": {"text": x}, **layout.pop("xaxis", {})},
        yaxis={"title": {"text": y}, **layout.pop("yaxis", {})},
        legend={"font": {"size": 10}}, **layout)
    return json.loads(figure.to_json())


def _listed(report, kind):
    present = {s["id"] for s in report["systems"] if s["kind"] == kind and not s["missing"]}
    own = systems.own_of(report["own"]) if kind == "pipeline" else []
    return [*systems.of_kind(kind, present), *own]


def _known(pairs):
    return [p for p in pairs if p["reference"] is not None]


def recall(report, pairs, kind):
    """The share of pairs whose error is below a threshold, as a curve."""
    listed, known = _listed(report, kind), _known(pairs)
    traces = []
    for system in listed:
        errors = np.sort(results.errors_of([p["rows"][kind][system.id] for p in known]))
        inside = errors[errors < MAX_ERROR_DEG]
        share = np.arange(1, len(inside) + 1) / len(errors)
        x = np.concatenate([[0], inside, [MAX_ERROR_DEG]])
        y = np.concatenate([[0], share, share[-1:] if len(share) else [0]])
        traces.append(graph.Scatter(
            x=np.round(x, 3).tolist(), y=np.round(100 * y, 2).tolist(), mode="lines",
            name=system.name, line={"color": colour(system), "dash": _dash(system, listed),
                                    "width": 3 if system.module == "twoview" else 1.6}))
    return _figure(traces, "pose error [degrees]", "pairs below it [%]",
                   xaxis={"range": [0, MAX_ERROR_DEG]}, yaxis={"range": [0, 100]})


def time_against_accuracy(report):
    traces = []
    for kind, symbol in (("pipeline", "circle"), ("solver", "diamond-open")):
        for system in _listed(report, kind):
            entry = next(s for s in report["systems"]
                         if s["id"] == system.id and s["kind"] == kind)
            if entry["time_ms"] is None or entry["auc"]["10"] is None:
                continue
            traces.append(graph.Scatter(
                x=[round(entry["time_ms"], 3)], y=[round(entry["auc"]["10"], 2)], mode="markers",
                name=system.name,
                marker={"color": colour(system), "symbol": symbol, "size": 11}))
    return _figure(traces, "median time of a pair [ms], one thread", "AUC at 10 degrees [%]",
                   xaxis={"type": "log"})


def scatter(report, pairs):
    """The error of a pipeline against twoview's for each pair. A failure is drawn at the border."""
    known = _known(pairs)
    listed = [s for s in _listed(report, "pipeline") if s.id != "twoview"]
    if "twoview" not in {s.id for s in _listed(report, "pipeline")} or not known:
        return None
    clip = lambda e: np.round(np.clip(e, MIN_ERROR_DEG, 180), 4).tolist()
    rows = lambda name: results.errors_of([p["rows"]["pipeline"][name] for p in known])
    ours = clip(rows("twoview"))
    number = {id(p): i for i, p in enumerate(pairs)}
    traces = [graph.Scatter(
        x=ours, y=clip(rows(system.id)), mode="markers", name=system.name,
        customdata=[number[id(p)] for p in known], text=[f"{p['set']}: {p['name0']} {p['name1']}"
                                                         for p in known],
        hovertemplate="%{text}<br>twoview %{x}°, " + system.name + " %{y}°<extra></extra>",
        marker={"color": colour(system), "size": 6, "opacity": 0.65,
                "symbol": i}) for i, system in enumerate(listed)]
    traces.append(graph.Scatter(x=[MIN_ERROR_DEG, 180], y=[MIN_ERROR_DEG, 180], mode="lines",
                                line={"color": "gray", "width": 1}, showlegend=False,
                                hoverinfo="skip"))
    axis = {"type": "log", "range": [np.log10(MIN_ERROR_DEG) - 0.05, np.log10(180) + 0.05]}
    return _figure(traces, "twoview's pose error [degrees]", "the other's [degrees]",
                   xaxis=axis, yaxis=axis)


def rotation_and_translation(report, pairs):
    """The rotation and translation errors of every pipeline as a scatter plot."""
    known = _known(pairs)
    traces = []
    for i, system in enumerate(_listed(report, "pipeline")):
        rows = [p["rows"]["pipeline"][system.id] for p in known]
        clip = lambda key, rows=rows: np.round(np.clip(
            [180 if r[key] is None else r[key] for r in rows], MIN_ERROR_DEG, 180), 4).tolist()
        traces.append(graph.Scatter(
            x=clip("rotation_error_deg"), y=clip("translation_error_deg"), mode="markers",
            name=system.name, marker={"color": colour(system), "size": 5, "opacity": 0.6,
                                      "symbol": i},
            text=[f"{p['set']}: {p['name0']} {p['name1']}" for p in known],
            hovertemplate="%{text}<br>rotation %{x}°, translation %{y}°<extra></extra>"))
    return _figure(traces, "rotation error [degrees]", "translation direction's error [degrees]",
                   xaxis={"type": "log"}, yaxis={"type": "log"})


def inlier_histogram(report, pairs):
    """A histogram over the pairs of the share of inliers among the matches."""
    traces = []
    edges = np.linspace(0, 1, 21)
    for system in _listed(report, "pipeline"):
        rows = [p["rows"]["pipeline"][system.id] for p in pairs]
        shares = [r["num_inliers"] / r["num_matches"] for r in rows
                  if r["num_matches"] and r["num_inliers"] is not None]
        count = np.histogram(np.clip(shares, 0, 1), edges)[0]
        traces.append(graph.Scatter(
            x=(100 * edges).tolist(), y=[*count.tolist(), int(count[-1])], mode="lines",
            name=system.name,
            line={"shape": "hv", "color": colour(system),
                  "width": 3 if system.module == "twoview" else 1.6,
                  "dash": _dash(system, _listed(report, "pipeline"))}))
    return _figure(traces, "inliers of a pipeline's own matches [%]", "pairs")


def epipolar_histogram(report, pairs, kind):
    """The share of a system's matches, over all pairs, whose Sampson distance under its own pose is
    below a threshold, as a curve."""
    listed = _listed(report, kind)
    edges = np.array(report["histogram_edges_px"])
    traces = []
    for system in listed:
        counts = [p["rows"][kind][system.id].get("error_px_histogram") for p in pairs]
        counts = [c for c in counts if c]
        total = sum(p["rows"][kind][system.id]["num_matches"] or 0 for p in pairs)
        if not counts or not total:
            continue
        share = 100 * np.cumsum(np.sum(counts, axis=0)) / total
        traces.append(graph.Scatter(
            x=edges[1:].tolist(), y=np.round(share, 2).tolist(), mode="lines+markers",
            name=system.name, marker={"size": 4},
            line={"color": colour(system), "dash": _dash(system, listed),
                  "width": 3 if system.module == "twoview" else 1.6}))
    return _figure(traces, "distance from the epipolar line [px]", "matches within it [%]",
                   xaxis={"type": "log"})


def all_plots(report, pairs):
    """Makes all plots of the page as a list of {"title", "hint", "figure", "reference"}."""
    is_known = bool(_known(pairs))
    has = {kind: bool(_listed(report, kind)) for kind in ("pipeline", "solver")}
    found = []

    def add(title, hint, figure, needs_reference):
        if figure is not None:
            found.append({"title": title, "hint": hint, "figure": figure,
                          "reference": needs_reference})
    if is_known and has["pipeline"]:
        add("Recall of the pipelines", "A double click on a name shows it alone.",
            recall(report, pairs, "pipeline"), True)
    if is_known and has["solver"]:
        add("Recall of the solvers", f"All on the matches of {report['matches_of']}.",
            recall(report, pairs, "solver"), True)
    if is_known:
        add("Time against accuracy", "Up and to the left is better. Discs are pipelines, from two "
            "images to a pose; diamonds solvers, from matches to a pose.",
            time_against_accuracy(report), True)
        add("Error of each pair beside twoview's", "Above the line twoview is nearer. Failures "
            "stand at 180 degrees. A click on a point opens the pair.", scatter(report, pairs),
            True)
        if has["pipeline"]:
            add("Rotation and translation", "The two parts of a pair's error.",
                rotation_and_translation(report, pairs), True)
    if has["pipeline"]:
        add("Share of inliers", "A system's own count, of its own matches.",
            inlier_histogram(report, pairs), False)
        add("Distance of the matches from the epipolar lines",
            "Sampson's distance of a pipeline's own matches under its own pose, pairs together.",
            epipolar_histogram(report, pairs, "pipeline"), False)
    if has["solver"]:
        add("The same distances, solvers", "All have the same matches: higher is better.",
            epipolar_histogram(report, pairs, "solver"), False)
    return found
