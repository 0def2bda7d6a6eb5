"""Counts the rows of twoview_tools.accuracy.belief and prints them as tables, as text or as
Markdown."""

import numpy as np

from . import truth

VERDICTS = ("ok", "doubtful", "refused")
ERROR_BOUNDS_DEG = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
SIGMA_BOUNDS_DEG = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
# (title, a row's number, bounds of the classes)
FEATURES = (
    ("inliers", "num_inliers", (20, 25, 30, 40, 60, 100, 200)),
    ("inlier share", "inlier_share", (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
    ("median parallax [deg]", "median_parallax_deg", (1, 2, 5, 10, 20, 30, 45, 90)),
    ("coverage", "coverage", (0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8)),
)
IMPOSSIBLE = ("unrelated", "mirrored", "self-zoomed")


# ---- counting ------------------------------------------------------------------------------------

def class_of(value, bounds):
    """The number of the class of a value: how many of the ascending bounds are at most it."""
    return int(np.searchsorted(bounds, value, side="right"))


def class_names(bounds):
    return ([f"< {bounds[0]:g}"] + [f"{a:g} - {b:g}" for a, b in zip(bounds, bounds[1:])]
            + [f">= {bounds[-1]:g}"])


def related(rows):
    """The rows with a true pose that is trusted."""
    return [r for r in rows if r["kind"] == "related" and r["trusted"]]


def ok(rows):
    return [r for r in rows if r["verdict"] == "ok"]


def error_table(rows, key):
    """{verdict: the number of rows in each class of an error; the last one has no pose}."""
    table = {v: [0] * (len(ERROR_BOUNDS_DEG) + 2) for v in VERDICTS}
    for row in rows:
        error = row[key]
        table[row["verdict"]][-1 if error is None else class_of(error, ERROR_BOUNDS_DEG)] += 1
    return table


def reason_table(rows):
    """{reason: counts} of rows with a pose: "pairs" that have the reason, of these "wrong" and
    "right"; and "alone", "alone_wrong", "alone_right", where it is the only reason."""
    table = {}
    for row in rows:
        if row["rotation_error_deg"] is None:
            continue
        for reason in row["reasons"] or ["none (ok)"]:
            counts = table.setdefault(reason, dict.fromkeys(
                ("pairs", "wrong", "right", "alone", "alone_wrong", "alone_right"), 0))
            for prefix in ("",) + (("alone_",) if len(row["reasons"]) <= 1 else ()):
                counts["alone" if prefix else "pairs"] += 1
                counts[prefix + "wrong"] += bool(row["wrong"])
                counts[prefix + "right"] += bool(row["right"])
    return table


def feature_table(rows, key, bounds):
    """[(ok, wrong in rotation, wrong, right with a pose, right and ok)] for each class of a number
    of the rows."""
    table = [[0] * 5 for _ in range(len(bounds) + 1)]
    for row in rows:
        if row["rotation_error_deg"] is None:
            continue
        counts = table[class_of(row[key], bounds)]
        counts[3] += bool(row["right"])
        if row["verdict"] == "ok":
            counts[0] += 1
            counts[1] += bool(row["wrong_rotation"])
            counts[2] += bool(row["wrong"])
            counts[4] += bool(row["right"])
    return table


def _ratio(errors, stated):
    return float(np.median(np.divide(errors, stated))) if len(errors) else np.nan


def reliability(rows):
    """Of rows with a covariance: their number, medians of error, sigma and error / sigma of the
    rotation and (where it counts) of the direction, and the shares inside the ellipsoid."""
    rows = [r for r in rows if r.get("chi2_freedom")]
    aimed = [r for r in rows if r["direction_counts"]]
    found = {"pairs": len(rows), "directions": len(aimed)}
    for part, some in (("rotation", rows), ("direction", aimed)):
        errors = np.array([r[part + "_error_deg"] for r in some], float)
        stated = np.array([r[f"sigma_{part}_deg"] for r in some], float)
        found[part + "_error"] = float(np.median(errors)) if some else np.nan
        found[part + "_sigma"] = float(np.median(stated)) if some else np.nan
        found[part + "_ratio"] = _ratio(errors, stated)
        found[part + "_p95"] = float(np.percentile(errors, 95)) if some else np.nan
    for key in ("inside", "inside_with_truth"):
        found[key] = float(np.mean([r[key] for r in rows])) if rows else np.nan
    return found


def summary(rows):
    """The counts of the pairs of a set: pairs, ok, wrong in rotation, wrong, right, right and
    ok."""
    good, right = ok(rows), [r for r in rows if r["right"]]
    return {"pairs": len(rows), "ok": len(good),
            "wrong_rotation": sum(bool(r["wrong_rotation"]) for r in good),
            "wrong": sum(bool(r["wrong"]) for r in good),
            "right": len(right), "right_ok": len(ok(right))}


def by_set(rows):
    """{set: its rows} in the order of names, then "all", and before it the exact sets."""
    found = {name: [r for r in rows if r["set"] == name]
             for name in sorted({r["set"] for r in rows})}
    exact = [r for r in rows if r["set"] in truth.EXACT]
    if exact and len(found) > 1:
        found["exact truth"] = exact
    if len(found) > 1:
        found["all"] = rows
    return found


def check(rows, key, limit):
    """(reached, sentence) for the share of the "ok" with a true pose whose `key` is set."""
    good = ok(related(rows))
    bad = sum(bool(r[key]) for r in good)
    share = bad / max(len(good), 1)
    what = "wrong in rotation" if key == "wrong_rotation" else "wrong"
    return share <= limit, (f"{bad} of {len(good)} \"ok\" with a true pose are {what} "
                            f"({100 * share:.2f} per cent, at most {100 * limit:g})")


def by_rung(rows):
    """{rung: its rows}, ascending; rows of before there were rungs are of rung 0."""
    rungs = sorted({r.get("effort", 0) for r in rows})
    return {rung: [r for r in rows if r.get("effort", 0) == rung] for rung in rungs}


# ---- text ----------------------------------------------------------------------------------------

def _cell(value):
    if isinstance(value, str):
        return value
    if isinstance(value, (int, np.integer)):
        return str(value)
    if value is None or not np.isfinite(value):
        return "-"
    return f"{value:.3f}" if abs(value) < 1 else f"{value:.2f}"


def _percent(part, whole):
    return f"{100 * part / whole:.1f}" if whole else "-"


class _Text:
    """Aligned columns for a terminal."""

    @staticmethod
    def table(title, head, lines):
        cells = [head] + [[_cell(v) for v in line] for line in lines]
        widths = [max(len(c[i]) for c in cells) for i in range(len(head))]
        rows = ["  " + "  ".join([c[0].ljust(widths[0])]
                                 + [v.rjust(w) for v, w in zip(c[1:], widths[1:])])
                for c in cells]
        return "\n".join([f"\n{title}"] + rows)


class _Markdown:
    @staticmethod
    def table(title, head, lines):
        rows = [head, ["---"] * len(head)] + [[_cell(v) for v in line] for line in lines]
        return "\n".join([f"\n{title}\n"] + ["| " + " | ".join(r) + " |" for r in rows])


def _sets(style, rows):
    head = ["set", "pairs", "ok", "wrong in rotation", "wrong", "% wrong", "right", "of these ok",
            "%"]
    lines = []
    for name, some in by_set(rows).items():
        s = summary(some)
        lines.append([name, s["pairs"], s["ok"], s["wrong_rotation"], s["wrong"],
                      _percent(s["wrong"], s["ok"]), s["right"], s["right_ok"],
                      _percent(s["right_ok"], s["right"])])
    return style.table("Pairs with a true pose: \"ok\" that are wrong, and right poses that are "
                       "\"ok\"", head, lines)


def _errors(style, title, rows, key):
    table = error_table(rows, key)
    head = ["verdict"] + class_names(ERROR_BOUNDS_DEG) + ["no pose"]
    return style.table(title, head, [[v] + counts for v, counts in table.items()])


def _reasons(style, rows):
    table = reason_table(rows)
    head = ["reason", "pairs", "wrong", "right", "the only one", "wrong", "right"]
    return style.table("Reasons of pairs with a pose", head, [
        [reason, c["pairs"], c["wrong"], c["right"], c["alone"], c["alone_wrong"],
         c["alone_right"]] for reason, c in sorted(table.items())])


def _features(style, rows, some=FEATURES):
    parts = []
    for title, key, bounds in some:
        table = np.transpose(feature_table(rows, key, bounds)).tolist()
        names = ("ok", "wrong in rotation", "wrong", "right with a pose", "of these ok")
        parts.append(style.table(f"\"ok\" by {title}", [title] + class_names(bounds),
                                 [[n] + line for n, line in zip(names, table)]))
    return "\n".join(parts)


_RELIABILITY_HEAD = ["pairs", "rotation error", "sigma", "error / sigma", "directions",
                     "direction error", "sigma", "error / sigma", "% inside", "+ truth"]


def _reliability_line(some):
    r = reliability(some)
    return [r["pairs"], r["rotation_error"], r["rotation_sigma"], r["rotation_ratio"],
            r["directions"], r["direction_error"], r["direction_sigma"], r["direction_ratio"],
            f"{100 * r['inside']:.1f}" if r["pairs"] else "-",
            f"{100 * r['inside_with_truth']:.1f}" if r["pairs"] else "-"]


def _reliability(style, rows):
    good = ok(rows)
    return style.table(
        "The covariance of the \"ok\" by set: medians in degrees, share of the truth inside the 95 "
        "per cent ellipsoid", ["set"] + _RELIABILITY_HEAD,
        [[name] + _reliability_line(some) for name, some in by_set(good).items()])


def _rungs(style, rows):
    """The "ok" by the rung of effort of the result; empty where no pair was above rung 0."""
    groups = by_rung(rows)
    if set(groups) <= {0}:
        return ""
    lines = []
    for rung, some in [*groups.items(), ("all", rows)]:
        s, r = summary(some), reliability(ok(some))
        stated = sum(row["probability_wrong"] for row in ok(some))
        lines.append([str(rung), s["pairs"], s["ok"], s["wrong_rotation"], float(stated),
                      s["wrong"], s["right"], s["right_ok"],
                      _percent(s["right_ok"], s["right"]),
                      _percent(r["inside"] * r["pairs"], r["pairs"]),
                      _percent(r["inside_with_truth"] * r["pairs"], r["pairs"])])
    return style.table(
        "By the rung of effort of the result. \"stated\": the sum of probability_wrong over the "
        "\"ok\", beside the number that are wrong in rotation. The last two columns are of the "
        "\"ok\"", ["rung", "pairs", "ok", "wrong in rotation", "stated", "wrong", "right",
                   "of these ok", "%", "% inside", "+ truth"], lines)


def _curve(style, rows, part):
    good = [r for r in ok(rows) if r.get("chi2_freedom")
            and (part == "rotation" or r["direction_counts"])]
    lines = []
    for i, name in enumerate(class_names(SIGMA_BOUNDS_DEG)):
        some = [r for r in good if class_of(r[f"sigma_{part}_deg"], SIGMA_BOUNDS_DEG) == i]
        errors = [r[f"{part}_error_deg"] for r in some] or [np.nan]
        r = reliability(some)
        lines.append([name, len(some), r[f"{part}_sigma"]]
                     + [float(np.percentile(errors, p)) for p in (50, 90, 99)]
                     + [r[f"{part}_ratio"], f"{100 * r['inside']:.1f}" if some else "-"])
    return style.table(f"The covariance of the \"ok\" by the stated sigma of the {part} [deg]",
                       ["sigma", "pairs", "median sigma", "median error", "90 %", "99 %",
                        "error / sigma", "% inside"], lines)


def _others(style, rows):
    lines = []
    for kind in IMPOSSIBLE:
        some = [r for r in rows if r["kind"] == kind]
        if some:
            lines.append([kind, len(some)] + [sum(r["verdict"] == v for r in some)
                                              for v in VERDICTS])
    wrong_lens = [r for r in rows if r["kind"] == "file-lens" and r["trusted"]]
    text = style.table("Pairs without a translation to be known: every \"ok\" is wrong",
                       ["kind", "pairs"] + list(VERDICTS), lines) if lines else ""
    if wrong_lens:
        s = summary(wrong_lens)
        text += "\n" + style.table(
            "Pairs with the lens of the camera file, where that is wrong",
            ["pairs", "ok", "wrong in rotation", "wrong", "right", "of these ok"],
            [[str(s[key]) for key in ("pairs", "ok", "wrong_rotation", "wrong", "right",
                                      "right_ok")]])
    zoomed = [r for r in rows if r["kind"] == "zoomed" and r["trusted"]]
    if zoomed:
        text += "\n" + _errors(style, "Zoomed pairs: verdict against the rotation's error [deg]",
                               zoomed, "rotation_error_deg")
        lines = []
        for zoom in sorted({r["zoom"] for r in zoomed}):
            s = summary([r for r in zoomed if r["zoom"] == zoom])
            lines.append([f"{zoom:g}", s["pairs"], s["ok"], s["wrong_rotation"], s["wrong"]])
        text += "\n" + style.table("Zoomed pairs", ["zoom", "pairs", "ok", "wrong in rotation",
                                                    "wrong"], lines)
    return text


def text(rows):
    """All tables for a terminal."""
    good = related(rows)
    parts = []
    if good:
        aimed = [r for r in good if r["direction_counts"]]
        parts = [
            _errors(_Text, "Verdict against the rotation's error [deg]", good,
                    "rotation_error_deg"),
            _errors(_Text, "Verdict against the direction's error [deg], where it counts", aimed,
                    "direction_error_deg"),
            _sets(_Text, good), _calibration(_Text, good), _reasons(_Text, good),
            _features(_Text, good), _rungs(_Text, good),
            _reliability(_Text, good), _curve(_Text, good, "rotation"),
            _curve(_Text, good, "direction")]
    apart = sum(r["kind"] == "related" and not r["trusted"] for r in rows)
    if apart:
        parts.append(f"\n{apart} pairs have no trusted truth and are not counted.")
    return "\n".join(parts + [_others(_Text, rows)])


def tenths(rows, probabilities):
    """[(tenth, poses, stated %, wrong in rotation, actual %)]: the poses in the order of their
    probability_wrong, in ten equal parts."""
    lines = []
    for k, chosen in enumerate(np.array_split(np.argsort(probabilities, kind="stable"), 10)):
        wrong = sum(bool(rows[i]["wrong_rotation"]) for i in chosen)
        stated = float(np.mean([probabilities[i] for i in chosen])) if len(chosen) else np.nan
        lines.append([k + 1, len(chosen), 100 * stated, wrong, _percent(wrong, len(chosen))])
    return lines


TENTHS_HEAD = ["tenth", "poses", "stated %", "wrong in rotation", "actual %"]


def _calibration(style, rows):
    posed = [r for r in rows if r["rotation_error_deg"] is not None
             and r.get("probability_wrong") is not None]
    return style.table("probability_wrong: stated and actual, in tenths of the poses", TENTHS_HEAD,
                       tenths(posed, [r["probability_wrong"] for r in posed])) if posed else ""


def fitted(constants, left_out, as_markdown=False):
    """The result of belief_fit: the constants and the left-out tables."""
    style = _Markdown if as_markdown else _Text
    return "\n".join(constants + [style.table(*table) for table in left_out])


def _overview(rows):
    head = ["set", "pairs", "ok", "wrong in rotation", "wrong", "right", "% of these ok",
            "rotation: error / sigma", "direction: error / sigma", "% inside", "+ truth"]
    lines = []
    for name, some in by_set(rows).items():
        s, r = summary(some), reliability(ok(some))
        lines.append([name, s["pairs"], s["ok"], s["wrong_rotation"], s["wrong"], s["right"],
                      _percent(s["right_ok"], s["right"]), r["rotation_ratio"],
                      r["direction_ratio"], _percent(r["inside"] * r["pairs"], r["pairs"]),
                      _percent(r["inside_with_truth"] * r["pairs"], r["pairs"])])
    return _Markdown.table("Pairs with a true pose, by set. The last four columns are of the "
                           "\"ok\".", head, lines)


def markdown(rows):
    """The tables of docs/accuracy.md."""
    good = related(rows)
    return "\n".join([_overview(good), _rungs(_Markdown, good), _calibration(_Markdown, good),
                      _errors(_Markdown, "Verdict against the rotation's error [deg]", good,
                              "rotation_error_deg"),
                      _features(_Markdown, good, FEATURES[:1]), _reasons(_Markdown, good),
                      _others(_Markdown, rows)]).strip("\n")


def wrong_pairs(rows, num):
    """A line for each of the wrong "ok" pairs, the largest errors of the rotation first."""
    some = sorted((r for r in ok(related(rows)) if r["wrong"]),
                  key=lambda r: -r["rotation_error_deg"])
    return "\n".join(
        f"{r['set']} {r['image0']} {r['image1']}: rotation {r['rotation_error_deg']:.1f}, "
        f"direction {r['direction_error_deg']:.1f} deg, {r['num_inliers']} of {r['num_matches']} "
        f"matches, parallax {r['median_parallax_deg']:.1f} deg, coverage {r['coverage']:.2f}"
        for r in some[:num])
