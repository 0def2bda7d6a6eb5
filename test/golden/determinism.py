#!/usr/bin/env python3
"""Every CPU, the same bits: builds the digest program (digest.c) for x86-64, aarch64 and armv7 with
gcc and clang at -O0 and -O2, runs each build with every kernel set on real pairs, ARM under
qemu-user, and compares all digests. Exit status 0 if they are equal, 1 on any difference, 2 where a
build or a run fails.

A digest covers keypoints, descriptors, matches, poses with covariance and evidence, E F H,
verdicts, points of all seven triangulations with angles and errors, their covariances, guided
matching, bundle adjustment of two views and of windows, cameras, absolute poses, and the rungs of
effort with squeezed views. No number is stored: builds are compared with each other."""
import argparse
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGER_SIDE = 320  # pixels of the longer side, since an -O0 build under qemu is slow
# (architecture, the command that runs its programs, the kernel set that "neon" stands for in this
# run). A Cortex-A72 has no dot product instructions.
RUNNERS = {
    "x86-64": [([], "")],
    "aarch64": [(["qemu-aarch64", "-cpu", "cortex-a72", "-L", "/usr/aarch64-linux-gnu"], ""),
                (["qemu-aarch64", "-cpu", "max", "-L", "/usr/aarch64-linux-gnu"], "+dot")],
    "armv7": [(["qemu-arm", "-cpu", "cortex-a8", "-L", "/usr/arm-linux-gnueabihf"], "")],
}
SETS = {"x86-64": {"c", "sse2"}, "aarch64": {"c", "neon", "neon+dot"}, "armv7": {"c", "neon"}}
BUILDS = [(architecture, compiler, level) for level in ("O2", "O0")
          for compiler in ("gcc", "clang") for architecture in RUNNERS]
# One build of each architecture, compiler and level: as many as the test suite has time for.
QUICK = [("x86-64", "gcc", "O2"), ("x86-64", "clang", "O0"), ("aarch64", "gcc", "O2"),
         ("armv7", "gcc", "O2")]
# The first has a lens with distortion, and the Motorcycle pair has none.
DATA_SETS = ["euroc_v101_start", "tum_fr3_office"]
QUICK_DATA_SETS = DATA_SETS[:1]

SKIP_CODE = 77  # ctest reports this exit status (TWOVIEW_SKIP_CODE) as skipped
NEEDED = ("cmake", "ninja", "gcc", "clang", "aarch64-linux-gnu-gcc", "arm-linux-gnueabihf-gcc",
          "qemu-aarch64", "qemu-arm")


class Failure(Exception):
    """Raised when a build or a run fails."""


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failure(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def write_pairs(folder, data, sets):
    """Writes the pairs, one of each data set of `sets` and the Motorcycle pair, as digest.c reads
    them: luma, decoded and scaled down here, once for all builds."""
    import cv2

    motorcycle = ROOT / ".cache/motorcycle"
    pairs = [("motorcycle", [motorcycle / f"motorcycle_{side}.png" for side in ("left", "right")],
              [[994.978, 994.978, 311.193, 254.877], [994.978, 994.978, 342.279, 254.877]],
              [[0.0] * 5] * 2)]
    for name in sets:
        if data and (data / name / "pairs.txt").exists():
            pairs.append(read_set(data / name))
    for name, images, cameras, distortion in pairs:
        luma = [cv2.imread(str(image), cv2.IMREAD_GRAYSCALE) for image in images]
        height, width = luma[0].shape
        scale = LONGER_SIDE / max(height, width)
        size = (round(width * scale), round(height * scale))
        with open(folder / name, "wb") as file:
            file.write(b"%d %d\n" % size)
            for (fx, fy, cx, cy), k in zip(cameras, distortion):
                scaled = [
                    scale * fx,
                    scale * fy,
                    scale * (cx + 0.5) - 0.5,
                    scale * (cy + 0.5) - 0.5,
                ]
                file.write(" ".join(map(repr, scaled + k)).encode() + b"\n")
            for image in luma:
                file.write(cv2.resize(image, size, interpolation=cv2.INTER_AREA).tobytes())
    return [folder / name for name, *_ in pairs]


def read_set(folder):
    """Reads the first pair of a data set."""
    import yaml

    words = next(line for line in (folder / "pairs.txt").read_text().splitlines()
                 if line.strip() and not line.startswith("#")).split()
    known = yaml.safe_load((folder / "cameras.yaml").read_text())
    entries = [
        next((known[key] for key in known if name.startswith(key)), next(iter(known.values())))
        for name in words[:2]
    ]
    return (folder.name, [folder / "images" / name for name in words[:2]],
            [[entry[key] for key in ("fx", "fy", "cx", "cy")] for entry in entries],
            [[float(entry[key]) for key in ("k1", "k2", "p1", "p2", "k3")] for entry in entries])


def build(folder, architecture, compiler, level, keep_footprint):
    """Builds the digest program for this architecture, compiler and level. keep_footprint: for ARM
    also builds the shared library and its call graphs, which scripts/footprint measures; a
    compiler cache would not have the call graphs."""
    there = folder / f"{architecture}-{compiler}-{level}"
    options = [f"-DCMAKE_BUILD_TYPE={'Release' if level == 'O2' else 'Debug'}",
               "-DCMAKE_C_FLAGS_DEBUG=-O0", "-DCMAKE_CXX_FLAGS_DEBUG=-O0",
               "-DTWOVIEW_TOOLS=OFF", "-DBUILD_TESTING=ON", "-DTWOVIEW_PRECOMPILE=ON"]
    if architecture != "x86-64":
        options.append(f"--toolchain={ROOT}/cmake/toolchains/{architecture}.cmake")
    if compiler == "clang":
        options += ["-DCMAKE_C_COMPILER=clang", "-DCMAKE_CXX_COMPILER=clang++"]
    elif architecture == "x86-64":
        options += ["-DCMAKE_C_COMPILER=gcc", "-DCMAKE_CXX_COMPILER=g++"]
    targets = ["golden_digest"]
    if keep_footprint and architecture != "x86-64":
        targets += ["twoview", "twoview_without_room", "twoview_without_dense",
                    "twoview_without_odometry", "twoview_static"]
        options += ["-DCMAKE_C_COMPILER_LAUNCHER=", "-DCMAKE_CXX_COMPILER_LAUNCHER="]
    configured = there / "configured_with"
    if not configured.exists() or configured.read_text() != repr(options):
        run("cmake", "-S", ROOT, "-B", there, "-G", "Ninja", *options)
        configured.write_text(repr(options))
    run("cmake", "--build", there, "--target", *targets, "-j", "1", "--", "--quiet")
    return there / "test/bin/golden_digest"


def digests(program, architecture, pairs):
    """The digests of one build: {kernel set: [(pair and part, digest)]}."""
    found = {}
    for command, suffix in RUNNERS[architecture]:
        # The run without a suffix has the digests of set "c".
        sets = ["--without-c"] if suffix else []
        for line in run(*command, program, *sets, *pairs).splitlines():
            pair, kernels, part, digest = line.split()
            found.setdefault(kernels + (suffix if kernels == "neon" else ""), []).append(
                (f"{pair}/{part}", digest))
    missing = SETS[architecture] - set(found)
    if missing:
        raise Failure(f"{program} does not run the sets {', '.join(sorted(missing))}")
    return found


def summary(lines):
    """One digest over the digests of all pairs and parts."""
    total = 14695981039346656037
    for _, digest in lines:
        for byte in bytes.fromhex(digest):
            total = (total ^ byte) * 1099511628211 % 2**64
    return f"{total:016x}"


def compare(expected, actual):
    """The names of the parts, with their pair, that differ."""
    parts, other = dict(expected), dict(actual)
    return [part for part in {**parts, **other} if parts.get(part) != other.get(part)]


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true",
                        help="four builds instead of twelve, two pairs instead of three")
    parser.add_argument("--build-dir", type=Path, default=ROOT / "build/determinism")
    parser.add_argument(
        "--native", type=Path, help="x86-64 -O2 digest program that is built already"
    )
    parser.add_argument("--data", type=Path, default=os.environ.get("TWOVIEW_DATA"),
                        help="folder of data sets; default TWOVIEW_DATA, else ../shared/data")
    parser.add_argument("--jobs", type=int,
                        default=int(os.environ.get("TWOVIEW_JOBS", os.cpu_count() or 1)))
    args = parser.parse_args()
    missing = [tool for tool in NEEDED if not shutil.which(tool)]
    if missing:
        print(f"missing: {', '.join(missing)} (scripts/bootstrap test)")
        return SKIP_CODE
    data = args.data or ROOT.parent / "shared/data"
    args.build_dir.mkdir(parents=True, exist_ok=True)
    pair_folder = args.build_dir / "pairs"
    pair_folder.mkdir(exist_ok=True)
    pairs = write_pairs(pair_folder, data, QUICK_DATA_SETS if args.quick else DATA_SETS)
    wanted = QUICK if args.quick else BUILDS

    def job(one):
        given = args.native if one == QUICK[0] else None
        return digests(given or build(args.build_dir, *one, args.quick), one[0], pairs)

    print(f"{'architecture':<13}{'compiler':<9}{'level':<6}{'kernels':<9} digest of "
          f"{', '.join(p.name for p in pairs)}", flush=True)
    first, differences = None, 0
    with ThreadPoolExecutor(args.jobs) as pool:
        for (architecture, compiler, level), sets in zip(wanted, pool.map(job, wanted)):
            for kernels, lines in sets.items():
                first = first or lines
                parts = compare(first, lines)
                differences += bool(parts)
                print(f"{architecture:<13}{compiler:<9}-{level:<5}{kernels:<9} {summary(lines)}"
                      + (f"  DIFFERS in {len(parts)}: {' '.join(parts)}" if parts else ""),
                      flush=True)
    print(f"{differences} differ" if differences else "all equal")
    return 1 if differences else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failure as failure:
        print(f"determinism: {failure}", file=sys.stderr)
        sys.exit(2)
