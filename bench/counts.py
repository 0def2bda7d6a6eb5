"""Counts the instructions of a call, which do not depend on the load of the machine.

x86-64, under valgrind --tool=callgrind: each row of the benchmark programs (for the stages in
FILTERS, each row that the filter names) is called once, and then once more within bench_measured
(bench.cc); only the instructions within bench_measured are counted. This is done with the kernel
sets avx2 and c. valgrind 3.19 hides AVX-512, so OpenCV too runs its AVX2 code.

ARM, under qemu-user with the plugin qemu_count.c: stages.c, built by the cross compiler and linked
with the library that the presets aarch64 and armv7 build. The count of a call is the count of a
run with one call minus that of a run without any."""

import glob
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

import rows as table

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SETS = ("avx2", "c")
ARM = (("aarch64", "aarch64-linux-gnu-gcc", "qemu-aarch64"),
       ("armv7", "arm-linux-gnueabihf-gcc", "qemu-arm"))
ARM_STAGES = ("detect", "describe", "match", "estimate", "pair")
ARM_SETS = ("auto", "c")
# Only these rows are run; the calls of the other rows would take minutes each.
FILTERS = {"robust": "^robust/.*/twoview$", "match": "^match/1000x1000"}


def _totals(folder):
    """Total instructions of each dump file, in the order in which the files were made."""
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
    """{name: instructions for one unit (keypoint, sample, ...)} of the rows of a stage."""
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
    """Returns rows as dictionaries: stage, case, ours by kernel set, peer, peer_name, ratio,
    unit."""
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
                continue  # each peer's row already contains our count
            peer = None if alone else first[name]
            found.append({"stage": stage, "case": case,
                          "ours": {kernels: by_set[kernels][own] for kernels in SETS},
                          "peer": peer, "peer_name": None if alone else system,
                          "ratio": None if alone else peer / first[own],
                          "unit": f"instructions/{unit}"})
    return found


def _run(*command):
    subprocess.run(
        command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def _arm_program(preset, compiler, folder):
    """Builds stages.c for an architecture, linked statically, and returns its path."""
    _run("cmake", "--preset", preset, "-S", ROOT, "-DTWOVIEW_TOOLS=OFF", "-DBUILD_TESTING=OFF",
         "-B", os.path.join(folder, preset))
    _run("cmake", "--build", os.path.join(folder, preset), "--target", "twoview_static")
    program = os.path.join(folder, "stages-" + preset)
    _run(compiler, "-std=c99", "-O2", "-static", os.path.join(ROOT, "bench", "stages.c"), "-I",
         os.path.join(ROOT, "lib", "include"), os.path.join(folder, preset, "lib", "libtwoview.a"),
         "-lm", "-o", program)
    return program


def arm(build):
    """Rows as measure() returns them, without peers. An architecture that cannot run here is named
    on stderr and omitted."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        plugin = os.path.join(folder, "count.so")
        _run("gcc", "-O2", "-shared", "-fPIC", os.path.join(ROOT, "bench", "qemu_count.c"), "-o",
             plugin)
        _run(os.path.join(build, "bin", "bench_export_images"), folder)
        with open(os.path.join(folder, "640x480.json"), encoding="utf-8") as f:
            camera = [str(k) for k in json.load(f)["K0"]["data"]]
        images = [os.path.join(folder, f"640x480_{v}.pgm") for v in (0, 1)]
        for preset, compiler, qemu in ARM:
            missing = [tool for tool in (compiler, qemu) if not shutil.which(tool)]
            if missing:
                print(
                    f"bench: no {' and no '.join(missing)}: {preset} is left out", file=sys.stderr
                )
                continue
            print(f"bench: counting {preset} under qemu", file=sys.stderr, flush=True)
            program = _arm_program(preset, compiler, folder)

            def count(stage, calls, kernels, qemu=qemu, program=program):
                done = subprocess.run([qemu, "-plugin", plugin, program, *images, *camera, stage,
                                       str(calls), kernels], check=True, capture_output=True,
                                      text=True)
                return int(re.search(r"instructions: (\d+)", done.stderr)[1])
            for stage in ARM_STAGES:
                ours = {kernels: count(stage, 1, kernels) - count(stage, 0, kernels)
                        for kernels in ARM_SETS}
                found.append({"stage": stage, "case": f"640x480 defaults, {preset}", "ours": ours,
                              "peer": None, "peer_name": None, "ratio": None,
                              "unit": "instructions/call"})
    return found


def print_table(found, out):
    print("| stage | case | ours, fastest set | ours, c | peer | peer / ours | peer's name | a |\n"
          "| --- | --- | --- | --- | --- | --- | --- | --- |", file=out)
    for row in found:
        numbers = [f"{n:,.0f}" for n in row["ours"].values()]
        numbers += ["-", "-"] if row["peer"] is None else [f"{row['peer']:,.0f}",
                                                           f"{row['ratio']:.3g}"]
        print(f"| {row['stage']} | {row['case']} | " + " | ".join(numbers) +
              f" | {row['peer_name'] or '-'} | {row['unit'].partition('/')[2]} |", file=out)
