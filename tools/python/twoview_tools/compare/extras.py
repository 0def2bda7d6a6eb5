"""Tables and plots of a comparison as files for a paper: systems.csv, systems.tex, figures/."""

import csv
import io
import os
import re

from . import plots

# The columns of a table of systems: the key of a system's summary, the head, the format.
COLUMNS = (("auc 5", "AUC@5", ".1f"), ("auc 10", "AUC@10", ".1f"), ("auc 20", "AUC@20", ".1f"),
           ("median_error_deg", "median [deg]", ".2f"),
           ("median_rotation_error_deg", "rotation [deg]", ".2f"),
           ("median_translation_error_deg", "translation [deg]", ".2f"),
           ("failures", "no pose", "d"), ("num_matches", "matches", ".0f"),
           ("num_inliers", "inliers", ".0f"), ("precision", "precision", ".3f"),
           ("time_ms", "time [ms]", ".1f"))
TITLES = {"pipeline": "Whole pipelines", "solver": "Solvers on identical matches"}
LATEX = str.maketrans({"&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
                       "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
                       "\\": r"\textbackslash{}"})
# The dashes of plotly's lines, as matplotlib has them.
DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-.", "longdash": (0, (8, 3)),
          "longdashdot": (0, (8, 3, 1, 3))}
MARKERS = "os^Dv<>p*hX"


def _value(system, key):
    return system["auc"][key.split()[1]] if key.startswith("auc ") else system[key]


def csv_text(report):
    """A row for each system and list of pairs; "all" stands for all lists together."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["system", "name", "version", "kind", "set", "pairs",
                    *(key.replace(" ", "_") for key, _, _ in COLUMNS)])
    for system in report["systems"]:
        parts = {"all": system, **(system["sets"] if len(system["sets"]) > 1 else {})}
        for name, part in parts.items():
            values = (_value(part, key) for key, _, _ in COLUMNS)
            table.writerow([system["id"], system["name"], system["version"] or "", system["kind"],
                            name, part["num_pairs"], *("" if v is None else v for v in values)])
    return text.getvalue()


def tex_text(report):
    """Tables for LaTeX with the package booktabs, the best figure of each AUC in bold."""
    lines = ["% Needs \\usepackage{booktabs}. " + report["reference_words"].translate(LATEX)]
    for kind, title in TITLES.items():
        listed = [s for s in report["systems"] if s["kind"] == kind and not s["missing"]]
        if not listed:
            continue
        best = {key: max((_value(s, key) for s in listed if _value(s, key) is not None),
                         default=None) for key, _, _ in COLUMNS if key.startswith("auc ")}
        lines += [f"% {title}, {report['num_pairs']} pairs",
                  rf"\begin{{tabular}}{{l{'r' * len(COLUMNS)}}}", r"\toprule",
                  " & ".join(["system", *(head.translate(LATEX) for _, head, _ in COLUMNS)])
                  + r" \\", r"\midrule"]
        for system in listed:
            cells = [system["name"].translate(LATEX)]
            for key, _, form in COLUMNS:
                value = _value(system, key)
                text = "--" if value is None else format(value, form)
                cells.append(rf"\textbf{{{text}}}" if value is not None
                             and value == best.get(key) else text)
            lines.append(" & ".join(cells) + r" \\")
        lines += [r"\bottomrule", r"\end{tabular}", ""]
    return "\n".join(lines) + "\n"


# ---- figures -------------------------------------------------------------------------------------

def _axis(figure, name):
    return figure["layout"].get(name, {})


def draw(plot):
    """A plot of plots.all_plots, which is Plotly's, as matplotlib's Figure."""
    from matplotlib.figure import Figure
    drawn = plot["figure"]
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    for i, trace in enumerate(drawn["data"]):
        line, marker = trace.get("line", {}), trace.get("marker", {})
        colour = line.get("color") or marker.get("color")
        has_lines = "lines" in trace["mode"]
        has_marks = "markers" in trace["mode"]
        is_open = "open" in str(marker.get("symbol", ""))
        axes.plot(trace["x"], trace["y"], color=colour,
                  linestyle=DASHES[line.get("dash", "solid")] if has_lines else "none",
                  linewidth=0.6 * line.get("width", 2), alpha=marker.get("opacity", 1),
                  marker=MARKERS[i % len(MARKERS)] if has_marks else "none",
                  markersize=0.6 * marker.get("size", 6),
                  markerfacecolor="none" if is_open else colour,
                  drawstyle="steps-post" if line.get("shape") == "hv" else "default",
                  label=trace.get("name") if trace.get("showlegend", True) else "_")
    for name in ("x", "y"):
        axis = _axis(drawn, name + "axis")
        is_log = axis.get("type") == "log"
        if is_log:
            getattr(axes, f"set_{name}scale")("log")
        if "range" in axis:
            low, high = axis["range"]
            getattr(axes, f"set_{name}lim")(*((10**low, 10**high) if is_log else (low, high)))
        getattr(axes, f"set_{name}label")(axis.get("title", {}).get("text", ""))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6, loc="best")
    return figure


def write(folder, report, pairs, tables, figures):
    """Writes the tables and figures of --tables and --figures beside the report."""
    texts = {"csv": csv_text, "tex": tex_text}
    for kind in tables:
        _replace(os.path.join(folder, "systems." + kind), texts[kind](report).encode())
    if not figures:
        return
    os.makedirs(os.path.join(folder, "figures"), exist_ok=True)
    for plot in plots.all_plots(report, pairs):
        name = re.sub(r"[^a-z0-9]+", "_", plot["title"].lower()).strip("_")
        for kind in figures:
            data = io.BytesIO()
            draw(plot).savefig(data, format=kind, dpi=200)
            _replace(os.path.join(folder, "figures", f"{name}.{kind}"), data.getvalue())


def _replace(path, data):
    with open(path + ".part", "wb") as file:
        file.write(data)
    os.replace(path + ".part", path)
