"""Runs tasks in threads of this process, each with worker processes, or on a dask cluster.

The workers of a cluster must have this source tree and the images under the same paths."""

import concurrent.futures
import contextlib

from .. import PARENT
from . import children, pair_run

LAUNCH = str(PARENT.parent / "compare_colmap" / "launch.py")


def _remote_worker():
    """Returns the function that runs a task in a worker of a cluster. It is an inner function
    because dask sends such functions by value: the worker cannot import this package before
    launch.py has set its path."""
    launch = LAUNCH

    def work(task):
        import runpy
        runpy.run_path(launch)
        from twoview_tools.compare import pair_run as there
        return there.work(task)
    return work


class Local:
    def __init__(self, jobs):
        self.description = f"{jobs} process{'es' if jobs > 1 else ''} here"
        self.pool = concurrent.futures.ThreadPoolExecutor(jobs)

    def run(self, tasks):
        """Yields (index, result) in the order in which the tasks finish."""
        futures = {self.pool.submit(pair_run.work, task): i for i, task in enumerate(tasks)}
        for future in concurrent.futures.as_completed(futures):
            yield futures[future], future.result()

    def close(self):
        self.pool.shutdown(wait=False, cancel_futures=True)
        children.close_all()


class Dask:
    def __init__(self, address):
        import distributed
        self.client = distributed.Client(address, timeout="10s")
        workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
        self.description = f"dask.distributed, {workers} workers at the start"

    def run(self, tasks):
        import distributed
        work = _remote_worker()
        futures = {self.client.submit(work, task, pure=False): i for i, task in enumerate(tasks)}
        for future in distributed.as_completed(futures):
            yield futures[future], future.result()

    def close(self):
        self.client.close()


@contextlib.contextmanager
def workers(jobs, scheduler):
    """Yields a Local or a Dask, and closes it at the end."""
    made = Dask(scheduler) if scheduler else Local(jobs)
    try:
        yield made
    finally:
        made.close()
