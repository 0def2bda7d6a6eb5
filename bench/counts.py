"""Instructions a call under valgrind --tool=callgrind, which no mood of the machine changes.

Each row of the benchmark programs is called once more after a first call; what happens inside
bench_measured (bench.cc) is counted. Once with the avx2 and once with the c kernel set; valgrind 3.19
hides AVX-512, so OpenCV too runs its AVX2 code.
"""

import glob
import json
import os
import re
import subprocess
import sys
import tempfile

import rows as table

SETS = ("avx2", "c")
# Where the other rows' calls would be minutes each.
FILTERS = {"robust": "^robust/.*/twoview$", "match": "^match/1000x1000"}


def _totals(folder):
    """Instructions of each dump, in the order in which they were made."""
    paths = glob.glob(os.path.join(folder, "out.*"))
    dumps = []
    for path in paths:
        with open(path, encoding="utf-8") as f:
            text = f.read()
        if "Trigger: --dump-after=bench_measured" in text:
            total = re.search(r"^(?:totals|summary): (\d+)", text, flags=re.M)
            dumps.append((int(path.rsplit(".", 1)[1]), int(total[1])))
    return [total for _, total in sorted(dumps)]


def _count(build, program, stage, kernels):
    """{name: instructions a unit} of the stage's rows."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        environment = dict(os.environ, TWOVIEW_BENCH_CALLS="1", TWOVIEW_KERNELS=kernels)
        command = ["valgrind", "--tool=callgrind", "--toggle-collect=bench_measured",
                   "--dump-after=bench_measured", f"--callgrind-out-file={folder}/out",
                   os.path.join(build, "bin", program),
                   "--benchmark_filter=" + FILTERS.get(stage, f"^{stage}/"),
                   f"--benchmark_out={report}", "--benchmark_enable_random_interleaving=false"]
        print(f"bench: counting {stage} with the {kernels} set", file=sys.stderr, flush=True)
        subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        totals = _totals(folder)
        with open(report, encoding="utf-8") as f:
            entries = [e for e in json.load(f)["benchmarks"] if not e.get("error_occurred")]
    assert len(totals) == len(entries), (len(totals), len(entries))
    return {re.sub(r"/(iterations:\d+|repeats:\d+|process_time)", "", e["name"]):
            total / e["units"] for e, total in zip(entries, totals)}


def measure(build, stages, programs):
    """Rows as dictionaries: stage, case, ours by kernel set, peer, peer_name, ratio, unit."""
    found = []
    for stage in (s for s in stages if programs[s]):
        by_set = {kernels: _count(build, programs[stage], stage, kernels) for kernels in SETS}
        first = by_set[SETS[0]]
        unit = table.UNITS[stage][0].partition("/")[2] or "call"
        for name in first:
            case, system = name.split("/")[1:]
            own = f"{stage}/{case}/{table.OURS}"
            alone = all(not n.startswith(f"{stage}/{case}/") or n == own for n in first)
            if system == table.OURS and not alone:
                continue  # stands in its peers' rows
            peer = None if alone else first[name]
            found.append({"stage": stage, "case": case,
                          "ours": {kernels: by_set[kernels][own] for kernels in SETS},
                          "peer": peer, "peer_name": None if alone else system,
                          "ratio": None if alone else peer / first[own],
                          "unit": f"instructions/{unit}"})
    return found


def print_table(found, out):
    sets = " | ".join(f"ours, {kernels}" for kernels in SETS)
    print(f"| stage | case | {sets} | peer | peer / {SETS[0]} | peer's name | a |", file=out)
    print("| --- | --- |" + " --- |" * (len(SETS) + 4), file=out)
    for row in found:
        numbers = [f"{row['ours'][kernels]:,.0f}" for kernels in SETS]
        numbers += ["-", "-"] if row["peer"] is None else [f"{row['peer']:,.0f}",
                                                           f"{row['ratio']:.3g}"]
        print(f"| {row['stage']} | {row['case']} | " + " | ".join(numbers) +
              f" | {row['peer_name'] or '-'} | {row['unit'].partition('/')[2]} |", file=out)
