"""A long flight: a set folder's frames there and back, again and again, and whether the work a
frame stays the same."""

import os
import shutil

import numpy as np

from . import poses
from .sets import read_set, write_frames

NUM_FRAMES, NUM_RUNS = 10000, 3
GROWTH = 1.10  # a mean time a frame that grows by no more counts as flat


def period_of(count):
    """How many frames a way there and back through `count` of them has."""
    return max(2 * (count - 1), 1)


def there_and_back(count, num):
    """The indices of `num` frames of a way there and back through `count` of them."""
    period = period_of(count)
    along = np.arange(num) % period
    return np.where(along < count, along, period - along)


def repeat(source_path, folder, num=NUM_FRAMES):
    """Writes a set folder of `num` frames that lead through those of another one, there and back.
    What a vehicle measured is left out: its velocities would be wrong on the way back."""
    source = read_set(source_path)
    order = there_and_back(len(source.names), num)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    step = float(np.median(np.diff(source.times)))
    times = [source.times[0] + step * k for k in range(num)]
    write_frames(folder, times, [os.path.abspath(os.path.join(source.path, source.names[k]))
                                 for k in order])
    for name in ("cameras.yaml", "surfaces.json"):
        if source.file(name):
            shutil.copy(source.file(name), folder)
    truth = source.truth()
    if truth is not None:
        nearest = [int(np.abs(truth.times - source.times[k]).argmin())
                   for k in range(len(source.times))]
        there = truth[np.array([nearest[k] for k in order])]
        there.times = np.array(times)
        poses.write_tum(os.path.join(folder, "groundtruth.txt"), there)
    return folder


def growth(times_ms, num):
    """(mean of the first `num` times, largest mean of `num` that follow each other, in parts of
    `num`); (None, None) for fewer than twice as many. A way there and back has the same pictures
    each time; other parts of a flight differ by what they see."""
    times = np.asarray(times_ms, float)
    if len(times) < 2 * num:
        return None, None
    means = times[:len(times) // num * num].reshape(-1, num).mean(axis=1)
    return float(means[0]), float(means.max())


def least_times(runs):
    """The least time of each frame in several runs, which do the same work: what else the machine
    does only adds to it."""
    return np.min([run["times_ms"] for run in runs], axis=0).tolist()


def judged(runs, count):
    """(reached, sentence) of the runs over repeat()'s folder of a source of `count` frames."""
    run, times, num = runs[0], least_times(runs), period_of(count)
    first, most = growth(times, num)
    longest = ", ".join(f"{max(each['times_ms']):.1f}" for each in runs)
    if first is None:
        return None, f"CPU time over {NUM_FRAMES} frames: not measured (too few frames)"
    return most <= GROWTH * first, (
        f"CPU time flat over {len(times)} frames (at most {100 * (GROWTH - 1):.0f} % more), the "
        f"least of {len(runs)} runs: the first way there and back, {num} frames, {first:.2f} ms a "
        f"frame, the slowest one {most:.2f} ms, longest frame {max(times):.1f} ms (of each run "
        f"{longest}); coverage {100 * run['truth']['coverage']:.1f} %, "
        f"{run['num_keyframes']} keyframes, {run['num_segments']} segments, peak memory "
        f"{run['peak_rss_mib']:.0f} MiB")
