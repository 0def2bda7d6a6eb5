"""Runs a function on many pieces of work in several processes."""

import concurrent.futures
import multiprocessing


def run(function, work, jobs=1):
    """Yields function's results in the order of `work`. The processes are new ones (no fork):
    OpenCV's threads do not survive a fork."""
    if jobs <= 1 or len(work) < 2:
        yield from map(function, work)
        return
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(min(jobs, len(work)), context) as pool:
        yield from pool.map(function, work)
