"""What the runs must reach: a sentence for each target, and whether it is reached (None: not
measured)."""

import numpy as np

from . import sensors

# Per set: (ATE in metres or None, ATE in per cent of the path or None, coverage at least).
SETS = {"seq_chessboard_desk": (0.01, None, 0.90), "seq_tum_fr1_rpy": (0.04, None, 0.90),
        "seq_parking": (0.40, None, 0.99), "seq_kitti00_first200": (0.8, None, 0.99),
        "seq_icl_of_kt3": (0.010, None, 0.85), "seq_tsukuba": (0.007, None, 0.95),
        "hololens_room_seq": (None, 1.5, 0.80)}
MOST_SEGMENTS = {"hololens_room_seq": 2}
FLIGHT_ATE_PERCENT, FLIGHT_LOOP_PERCENT, FLIGHT_SCALE = 0.5, 0.2, 0.02
MAP_MEDIAN_PERCENT, MAP_OUTLIER_PERCENT = 1.0, 2.0
COVARIANCE = (0.90, 0.98)
PICTURE, MEAN_MS, MAX_MS, MEMORY_MIB, PEER_TIMES = [640, 480], 5.0, 25.0, 24.0, 10.0


def _ate(figures):
    return (figures.get("truth") or {}).get("ate_rmse")


def _sets(runs):
    """A line for each set: every run, that is every seed, must reach it; the worst is shown."""
    for name, (metres, percent, coverage) in SETS.items():
        own = [run for run in runs if run["kind"] == "set" and run["set"] == name and
               run.get("truth")]
        if not own:
            continue
        key, limit, unit = (("ate_rmse", metres, "m") if metres else
                            ("ate_rmse_percent_of_path", percent, "% of the path"))
        values = [run["truth"].get(key) for run in own]
        worst = None if None in values else max(values)
        least = min(run["truth"]["coverage"] for run in own)
        reached = worst is not None and worst <= limit and least >= coverage
        text = (f"{name}: ATE at most {limit} {unit}, coverage at least {100 * coverage:.0f} %: "
                f"{'none' if worst is None else f'{worst:.4f}'}, {100 * least:.1f} %")
        if name in MOST_SEGMENTS:
            most = max(run["num_segments"] for run in own)
            reached = reached and most <= MOST_SEGMENTS[name]
            text += f", {most} segments (at most {MOST_SEGMENTS[name]})"
        yield reached, text + (f"; the worst of {len(own)} seeds" if len(own) > 1 else "")


def is_followed(run):
    """Whether a flight was followed: from its first pose on every frame is known, or "lost" was
    said and a later frame is in the same segment again."""
    return run["num_unsaid_losses"] == 0 and (
        run["truth"]["ate_rmse"] is not None and
        (run["status_counts"]["lost"] == 0 or run["num_segments"] == 1))


def _each(runs, text, value, limit, unit="%"):
    """A target that each run must reach: the worst and the median are shown."""
    values = [value(run) for run in runs]
    known = [v for v in values if v is not None]
    if not known:
        return None, f"{text}: not measured"
    below = sum(v <= limit for v in known)
    return below == len(runs), (f"{text}: {below} of {len(runs)}, median {np.median(known):.3g}, "
                                f"worst {max(known):.3g} {unit}")


def _flights(runs):
    flights = [run for run in runs if run["kind"] == "flight" and run.get("truth")]
    if not flights:
        return
    count = len(flights)
    followed = sum(map(is_followed, flights))
    yield followed == count, (f"flights: followed, or lost said and found again: {followed} of "
                              f"{count}")
    yield _each(flights, f"flights: ATE at most {FLIGHT_ATE_PERCENT} % of the path",
                lambda run: run["truth"].get("ate_rmse_percent_of_path"), FLIGHT_ATE_PERCENT)
    yield _each(flights, f"flights: the loop ends within {FLIGHT_LOOP_PERCENT} % of the path",
                lambda run: run["truth"].get("loop_end_percent"), FLIGHT_LOOP_PERCENT)
    metric = [run for run in flights if run.get("scale") == "metric" and
              run["truth"].get("scale_ratio")]
    yield _each(metric, f"flights: metric scale within {100 * FLIGHT_SCALE:.0f} %",
                lambda run: 100 * abs(run["truth"]["scale_ratio"] - 1), 100 * FLIGHT_SCALE)
    with_sigma = [run for run in metric if run.get("scale_sigma")]
    if with_sigma:
        inside = np.mean([abs(np.log(run["truth"]["scale_ratio"])) <= 2 * run["scale_sigma"]
                          for run in with_sigma])
        yield bool(inside >= 0.95), ("flights: metric scale within 2 sigmas in at least 95 %: "
                                     f"{100 * inside:.0f} % of {len(with_sigma)}")
    mapped = [run for run in flights if (run.get("map") or {}).get("num_points")]
    yield _each(mapped, f"maps: median distance at most {MAP_MEDIAN_PERCENT} % of the room",
                lambda run: run["map"]["median_percent"], MAP_MEDIAN_PERCENT)
    yield _each(mapped, f"maps: fewer than {MAP_OUTLIER_PERCENT} % outliers",
                lambda run: run["map"]["outlier_percent"], MAP_OUTLIER_PERCENT)


def _sensors(runs):
    for is_sound, what in ((False, "contradicting sensors"), (True, "sound sensors")):
        own = [run for run in runs if run["kind"] == "sensors" and
               run["label"].split(" ")[0].endswith("+none") == is_sound]
        if not own:
            continue
        metric = [run for run in own if run.get("scale") == "metric"]
        wrong = [run["label"] for run in own if not sensors.is_honest(run)]
        yield not wrong, (f"{what}: never metric with a scale off by more than 3 sigmas: "
                          f"{len(own) - len(wrong)} of {len(own)}, {len(metric)} of them metric"
                          + (f"; not {', '.join(wrong)}" if wrong else ""))


def _honesty(runs):
    for kinds, what in ((("set", "flight"), "sets and flights"), (("copy",), "changed copies"),
                        (("fault",), "injected faults")):
        chosen = [run for run in runs if run["kind"] in kinds and run.get("silent")]
        if not chosen:
            continue
        wrong = [run["label"] for run in chosen
                 if run["silent"]["num_wrong"] or run["silent_live"]["num_wrong"]]
        jumps = [run["label"] for run in chosen
                 if run["silent"]["unflagged_jumps"] or run["silent_live"]["unflagged_jumps"]]
        for names, text in ((wrong, "never tracking and off by 5 % of the path or 5 degrees"),
                            (jumps, "no unflagged jump")):
            yield not names, (f"{what}: {text}: {len(chosen) - len(names)} of {len(chosen)}"
                              + (f"; not {', '.join(names)}" if names else ""))
    # Faults are no part of it: what they break is judged above. A truth that is not exact adds its
    # own errors to those of a step of a few centimetres, so that it cannot judge the covariance.
    items = [run["covariance"] for run in runs if run["kind"] in ("set", "flight") and
             (run.get("covariance") or {}).get("num_pairs") and
             run["covariance"]["is_truth_exact"]]
    if items:
        pairs = sum(item["num_pairs"] for item in items)
        share = sum(item["inside_share"] * item["num_pairs"] for item in items) / pairs
        yield COVARIANCE[0] <= share <= COVARIANCE[1], (
            f"covariance: the 95 % ellipsoid holds the truth in 90 to 98 %: {100 * share:.1f} % of "
            f"{pairs} pairs of keyframes")
    else:
        yield None, ("covariance of consecutive keyframes: not measured (no run with an exact "
                     "truth and a covariances.txt)")


def _cost(runs):
    times = [run["times_ms"] for run in runs
             if run.get("times_ms") and run.get("picture_size") == PICTURE]
    if times:
        mean = np.concatenate(times).mean()
        yield bool(mean <= MEAN_MS), (f"CPU time a frame of {PICTURE[0]}x{PICTURE[1]}: mean about "
                                      f"{MEAN_MS:.0f} ms: {mean:.2f} ms")
    longest = [run["time_ms"]["max"] for run in runs if run.get("time_ms")]
    if longest:
        yield max(longest) < MAX_MS, (f"every frame of every size below {MAX_MS:.0f} ms: at most "
                                      f"{max(longest):.1f} ms")
    sizes = [run["context_bytes"] / 2 ** 20 for run in runs if run.get("context_bytes")]
    if sizes:
        yield max(sizes) <= MEMORY_MIB, (f"memory at most {MEMORY_MIB:.0f} MiB: "
                                         f"{max(sizes):.1f} MiB")


def _against_peer(runs, peers):
    theirs = {run["label"]: run for run in peers if run.get("truth")}
    for run in runs:
        peer = theirs.get(run.get("source", run["label"]))
        if peer is None or run.get("truth") is None:
            continue
        if run.get("time_ms"):
            ratio = peer["cpu_ms_per_frame"] / run["time_ms"]["mean"]
            yield ratio >= PEER_TIMES, (f"{run['label']}: a tenth of ORB-SLAM3's CPU time a frame: "
                                        f"{ratio:.1f} times less")
        ours, other = _ate(run), _ate(peer)
        if run["kind"] == "set" and run["set"] not in SETS:
            ahead = ours is not None and (other is None or (
                ours <= other and run["truth"]["coverage"] >= peer["truth"]["coverage"]))
            yield ahead, f"{run['label']}: ATE and coverage ahead of ORB-SLAM3"


def judge(runs, peers=()):
    """[(True, False or None; sentence)] of the runs (evaluate.evaluate's figures with `label` and
    `kind` "set", "copy", "flight" or "fault") and of a peer's runs over the same sources."""
    return [*_sets(runs), *_flights(runs), *_sensors(runs), *_honesty(runs), *_cost(runs),
            *_against_peer(runs, peers)]
