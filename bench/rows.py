"""Rows of the benchmark's table: the measures of programs and Python peers, their ratios, and the
targets."""

import dataclasses
import re
import statistics

OURS = "twoview"

# The unit of each stage's time, and the factor by which Google Benchmark's microseconds are
# divided.
UNITS = {"fast": ("ms", 1e3), "describe": ("us/keypoint", 1), "extract": ("ms", 1e3),
         "match": ("ms", 1e3), "relpose": ("us/sample", 1), "robust": ("ms/problem", 1e3),
         "triangulate": ("us/point", 1), "pair": ("ms", 1e3), "window": ("ms", 1e3)}


@dataclasses.dataclass
class Measure:
    """The times of one system on one case, in the unit of the stage, and a description of its
    result."""
    stage: str
    case: str
    system: str
    times: list  # one time for each repetition; empty if the peer is missing
    found: dict = dataclasses.field(default_factory=dict)
    note: str = ""

    def median(self):
        return statistics.median(self.times)

    def spread_percent(self):
        """Half the distance between the quartiles, in per cent of the median."""
        low, _, high = statistics.quantiles(self.times, n=4) if len(self.times) > 1 else [0, 0, 0]
        return 50 * (high - low) / self.median()


@dataclasses.dataclass
class Row:
    stage: str
    case: str
    ours: float
    peer: float  # median time of the peer; None if it is missing
    peer_name: str
    ratio: float           # time of the peer / time of ours
    unit: str
    target: str = ""
    reached: bool = None  # None if there is no target or no peer
    spread_percent: list = None
    found: dict = None
    peer_found: dict = None
    note: str = ""


# The targets: (stage, case, peer, smallest ratio, longest time of ours in the stage's unit). Stage,
# case and peer are regular expressions that match from the beginning. docs/performance.md lists the
# same numbers.
TARGETS = [
    ("fast", "FAST-9 ", "OpenCV", 1.5, None),
    ("fast", "FAST-12 ", "libcvd", 3, None),
    ("describe", ".*pyramid apart", "OpenCV", 10, None),
    ("match", "", "OpenCV", 12, None),
    ("match", "", "faiss", 3, None),
    ("relpose", "five-point$", "OpenGV", 6, 2.5),
    ("relpose", "five-point$", "PoseLib", None, 2.5),
    ("robust", "", "PoseLib", 3, None),
    ("triangulate", "Iterative-LS", "", None, 0.1),
    ("triangulate", "Poly$", "", None, 0.5),
    ("triangulate", "Midpoint", "OpenGV", 1, 0.011),
    ("window", "", "Ceres", 5, None),
    ("pair", ".*same corners", "OpenCV.*FAST", 10, None),
    ("pair", ".*median window", "OpenCV.*SIFT", 12, None),
    ("pair", ".*median window", "pycolmap", 50, None),
    ("pair", ".*defaults", "OpenCV.*FAST", 15, None),
    ("pair", ".*defaults", "pycolmap", 100, None),
]


def from_google_benchmark(report):
    """The measures in a JSON report of a benchmark program."""
    measures = {}
    for entry in sorted(report["benchmarks"], key=lambda e: e.get("family_index", 0)):
        name = re.sub(r"/(iterations:\d+|repeats:\d+|process_time)", "", entry["name"])
        if entry.get("run_type") != "iteration":
            continue
        stage, case, system = name.split("/")
        measure = measures.setdefault(name, Measure(stage, case, system, []))
        if entry.get("error_occurred"):
            measure.note = entry["error_message"]
            continue
        assert entry["time_unit"] == "us"
        measure.times.append(entry["cpu_time"] / UNITS[stage][1] / entry["units"])
        standard = {"name", "run_name", "run_type", "family_index", "per_family_instance_index",
                    "repetitions", "repetition_index", "threads", "iterations", "real_time",
                    "cpu_time", "time_unit", "units"}
        measure.found = {k: v for k, v in entry.items() if k not in standard}
    return list(measures.values()) + pyramid_apart(measures.values())


def pyramid_apart(measures):
    """Measures of the time of one additional keypoint, i.e. without the pyramid, from the rows with
    many and with few keypoints."""
    described = {(m.case, m.system): m for m in measures if m.stage == "describe" and m.times}
    apart = []
    for (case, system), many in described.items():
        match = re.fullmatch(r"(.*) at 1000", case)
        few = described.get((match[1] + " at 200", system)) if match else None
        if few is None:
            continue
        n, k = many.found["keypoints"], few.found["keypoints"]
        times = [(b * n - a * k) / (n - k) for a, b in zip(sorted(few.times), sorted(many.times))]
        apart.append(Measure("describe", match[1] + ", pyramid apart", system, times,
                             {k: v for k, v in many.found.items() if k == "cosine"}))
    return apart


def make_rows(measures):
    """A row for each peer of a case that our library ran too, with the target."""
    ours = {(m.stage, m.case): m for m in measures if m.system == OURS}
    rows = []
    for peer in measures:
        if peer.system == OURS or (peer.stage, peer.case) not in ours:
            continue
        if peer.stage == "describe" and peer.case.endswith(" at 200"):
            continue  # this case is reported in the row "pyramid apart"
        own = ours[peer.stage, peer.case]
        missing = not peer.times
        row = Row(peer.stage, peer.case, own.median(), None if missing else peer.median(),
                  peer.system, None if missing else peer.median() / own.median(),
                  UNITS[peer.stage][0], found=own.found, peer_found=peer.found,
                  spread_percent=[own.spread_percent(), None if missing else
                                  peer.spread_percent()],
                  note=peer.note)
        set_target(row)
        rows.append(row)
    return rows


def set_target(row):
    for stage, case, peer, ratio, most in TARGETS:
        if not (stage == row.stage and re.match(case, row.case) and re.match(peer, row.peer_name)):
            continue
        wanted, held = [], []
        if ratio is not None:
            wanted.append(f"{ratio:g}x")
            held.append(None if row.ratio is None else row.ratio >= ratio)
        if most is not None:
            wanted.append(f"<= {most:g} {row.unit}")
            held.append(row.ours <= most)
        if stage == "robust" and row.peer is not None:
            wanted.append("error not above")
            held.append(row.found["error_deg"] <= row.peer_found["error_deg"])
        row.target = ", ".join(wanted)
        row.reached = None if None in held else all(held)
        return


def _short(found):
    """Formats the counters of a row, such as '1039 corners, 0.15 deg'."""
    words = {"error_deg": "deg", "cost_px": "px", "above_5deg": "above 5 deg"}
    skip = re.compile(r".*_us$|threshold|units|nearest")
    parts = []
    for key, value in (found or {}).items():
        if not skip.match(key) and not (key == "above_5deg" and value == 0):
            parts.append(f"{value:.3g} {words.get(key, key)}" if value < 1000
                         else f"{value:.0f} {words.get(key, key)}")
    return ", ".join(parts)


def _number(value):
    return "-" if value is None else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def print_table(rows, out):
    header = (
        "stage",
        "case",
        "ours",
        "peer",
        "unit",
        "peer / ours",
        "target",
        "reached",
        "peer's name",
        "spread %",
        "found: ours; peer's",
    )
    table = [header]
    for row in rows:
        reached = {None: "", True: "yes", False: "NO"}[row.reached]
        spread = "" if not row.spread_percent else "/".join(
            _number(s) for s in row.spread_percent)
        found = row.note or "; ".join(filter(None, (_short(row.found), _short(row.peer_found))))
        table.append((row.stage, row.case, _number(row.ours), _number(row.peer), row.unit,
                      _number(row.ratio), row.target, reached, row.peer_name or "-", spread, found))
    widths = [max(len(line[i]) for line in table) for i in range(len(header))]
    for i, line in enumerate(table):
        print("| " + " | ".join(w.ljust(n) for w, n in zip(line, widths)) + " |", file=out)
        if i == 0:
            print("|" + "|".join("-" * (n + 2) for n in widths) + "|", file=out)
