"""Computes one digest for each stage of the library from a rendered pair (scene.c), and compares it
with the committed one.

test/golden/digests.txt has a line `stage digest` for each stage. The test golden/stages fails
- where the digest of a stage's output differs from that of the file, with any kernel set of this
  CPU;
- where CHANGELOG.md does not announce the file's digest: under a heading "Results", the newest
  mention of `STAGE DIGITS`, DIGITS being the first eight of the digest, must be the file's.
So nobody changes a result without writing it down. To announce an intended change, run
  cmake --build build/release --target golden_update
which rewrites digests.txt and prints a line, and add this line, and why the result changed, under
Results of CHANGELOG.md's newest section."""
import argparse
import re
import subprocess
import sys
from pathlib import Path

from determinism import summary

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = Path(__file__).with_name("digests.txt")
CHANGELOG = ROOT / "CHANGELOG.md"
# The parts that digest.c prints. Its part "memory" is left out, since sizes and layout are no
# results.
STAGES = {
    "camera": ["camera"],
    "features": ["features", "features_options"],
    "match": ["matches"],
    "estimate": ["upright", "seven_point", "eight_point", "five_point", "gravity",
                 "principal_point"],
    "guided": ["guided"],
    "triangulate": ["poly", "poly_abs", "linear_eigen", "linear_ls", "iterative_eigen",
                    "iterative_ls", "midpoint"],
    "bundle": ["point_covariances", "bundle"],
    "dense": ["dense"],
    "depth": ["depth"],
    "room": ["room"],
    "absolute_pose": ["absolute_pose"],
    "window": ["window"],
    "odometry": ["odometry"],
    "reconstruct": ["reconstruct"],
    "align": ["aligned"],
    "effort": ["effort"],
}
NOT_A_RESULT = {"memory"}


def run(*command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          check=True).stdout


def computed(scene_program, digest_program, folder):
    """Runs this build's digest program; returns {kernel set: {stage: digest}}."""
    folder.mkdir(parents=True, exist_ok=True)
    run(scene_program, folder / "scene")
    parts = {}
    for line in run(digest_program, folder / "scene").splitlines():
        _, kernels, part, digest = line.split()
        parts.setdefault(kernels, {})[part] = digest
    for kernels, found in parts.items():
        unknown = set(found) ^ ({p for names in STAGES.values() for p in names} | NOT_A_RESULT)
        if unknown:
            sys.exit(f"{kernels}: STAGES and digest.c differ in {', '.join(sorted(unknown))}")
    return {kernels: {stage: summary([(name, found[name]) for name in names])
                      for stage, names in STAGES.items()} for kernels, found in parts.items()}


def announced(text):
    """The digits that the CHANGELOG announces, {stage: digits}: the first mention from the top,
    which is the newest, under a heading Results."""
    found, results = {}, False
    for line in text.splitlines():
        if line.startswith("#"):
            results = line.lstrip("#").strip() == "Results"
        elif results:
            for stage, digits in re.findall(r"`(\w+) ([0-9a-f]{8})`", line):
                found.setdefault(stage, digits)
    return found


def changelog_entry(digests):
    return ", ".join(f"`{stage} {digest[:8]}`" for stage, digest in digests.items())


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="the program made from scene.c")
    parser.add_argument("digest", type=Path, help="the program made from digest.c")
    parser.add_argument("folder", type=Path, help="where the rendered pair goes")
    parser.add_argument("--update", action="store_true", help="rewrite digests.txt")
    args = parser.parse_args()
    by_set = computed(args.scene, args.digest, args.folder)
    before = dict(line.split() for line in COMMITTED.read_text().splitlines()) \
        if COMMITTED.exists() else {}
    if args.update:
        now = by_set["c"]
        COMMITTED.write_text("".join(f"{stage} {digest}\n" for stage, digest in now.items()))
        changed = {s: d for s, d in now.items() if announced(CHANGELOG.read_text()).get(s) != d[:8]}
        print("CHANGELOG.md's newest Results need: - Golden digests: "
              f"{changelog_entry(changed)}: why." if changed else "CHANGELOG.md announces them all")
        return 0
    wrong = []
    for kernels, stages in by_set.items():
        for stage in sorted(set(stages) | set(before)):
            if stages.get(stage) != before.get(stage):
                wrong.append(f"{stage} ({kernels}): {stages.get(stage)}, committed "
                             f"{before.get(stage)}")
    known = announced(CHANGELOG.read_text())
    for stage, digest in before.items():
        if known.get(stage) != digest[:8]:
            wrong.append(f"{stage}: CHANGELOG.md announces {known.get(stage)} under Results, "
                         f"digests.txt has {digest[:8]}")
    for line in wrong:
        print(line)
    if wrong:
        print(
            "An output has changed. If that is meant: test/golden/stages.py says what to do."
        )
    else:
        print(f"{len(STAGES)} stages with {', '.join(by_set)}: equal to the committed digests")
    return 1 if wrong else 0


sys.exit(main())
