"""The tables that scripts/odometry prints."""

COLUMNS = ("run", "known", "coverage", "ATE m", "% path", "live %", "RPE deg", "seg", "reloc",
           "loops", "silent", "jumps", "loop %", "scale", "map %", "out %", "ms", "max ms", "RSS")


def _number(value, form):
    return "-" if value is None else format(value, form)


def row_of(run):
    """The cells of one run's figures."""
    truth, live = run.get("truth") or {}, run.get("live") or {}
    silent, jumps = "-", "-"
    if run.get("silent"):
        silent = f"{run['silent']['num_wrong']}/{run['silent_live']['num_wrong']}"
        jumps = f"{run['silent']['unflagged_jumps']}/{run['silent_live']['unflagged_jumps']}"
    times = run.get("time_ms") or {}
    cost = run.get("cpu_ms_per_frame", times.get("mean"))
    found = run.get("map") or {}
    percent = truth.get("coverage")
    return (run["label"], f"{100 * run['known_share']:.0f} %",
            "-" if percent is None else f"{100 * percent:.1f} %",
            _number(truth.get("ate_rmse"), ".4f"),
            _number(truth.get("ate_rmse_percent_of_path"), ".2f"),
            _number(live.get("ate_rmse_percent_of_path"), ".2f"),
            _number(truth.get("rpe_rotation_deg"), ".3f"), str(run["num_segments"]),
            _number(run.get("num_relocalisations"), "d"), _number(run.get("num_loops"), "d"),
            silent, jumps, _number(truth.get("loop_end_percent"), ".2f"),
            _number(truth.get("scale_ratio") if run.get("scale") == "metric" else None, ".3f"),
            _number(found.get("median_percent"), ".2f"),
            _number(found.get("outlier_percent"), ".1f"), _number(cost, ".1f"),
            _number(times.get("max"), ".1f"), _number(run.get("peak_rss_mib"), ".0f"))


def table(rows, columns=COLUMNS):
    """Text columns of equal width; the first one is aligned left, the others right."""
    widths = [max(len(str(line[k])) for line in (columns, *rows)) for k in range(len(columns))]
    return "\n".join("  ".join(str(cell).ljust(width) if k == 0 else str(cell).rjust(width)
                               for k, (cell, width) in enumerate(zip(line, widths)))
                     for line in (columns, *rows))


def _span(values, form):
    """Minimum, median and maximum; "none" stands for a run without the figure, the worst one."""
    known = sorted(value for value in values if value is not None)
    if not known:
        return "none"
    worst = "none" if len(known) < len(values) else format(known[-1], form)
    return f"{known[0]:{form}} / {known[len(known) // 2]:{form}} / {worst}"


SEED_COLUMNS = ("run", "seeds", "ATE m: min / median / max", "% path", "coverage %", "segments",
                "silent", "jumps")


def seeds_table(runs):
    """A row for each source that ran with several seeds."""
    groups = {}
    for run in runs:
        if run.get("truth"):
            groups.setdefault(run["source"], []).append(run)
    rows = []
    for label, own in groups.items():
        truths = [run["truth"] for run in own]
        rows.append((label, len(own), _span([t["ate_rmse"] for t in truths], ".4f"),
                     _span([t.get("ate_rmse_percent_of_path") for t in truths], ".2f"),
                     _span([100 * t["coverage"] for t in truths], ".1f"),
                     _span([run["num_segments"] for run in own], "d"),
                     sum(run["silent"]["num_wrong"] + run["silent_live"]["num_wrong"]
                         for run in own),
                     sum(run["silent"]["unflagged_jumps"] + run["silent_live"]["unflagged_jumps"]
                         for run in own)))
    return table(rows, SEED_COLUMNS)


LEGEND = """known: frames with a pose. coverage: frames of the longest segment. ATE: after a
similarity, over that segment; live: of the poses as they were known when their frames were tracked.
silent, jumps: frames with status "tracking" that are off by 5 % of the path or 5 degrees, and
steps as large without a flag, of the final / live poses (live ones from before the metre was known
are compared among themselves). loop %: error of the motion from the first
pose to the last, of the path. scale: metric estimate / truth. map %, out %: median distance of the
points to the surfaces in per cent of the room's longest side; points farther than 3 % of it. ms:
CPU time a frame (ORB-SLAM3: of all its threads, without reading the images). RSS: peak memory of
the process, MiB."""
