"""Who does the work: threads of this process, each with worker processes, or a dask cluster.

A worker of a cluster has this tree and the images under the same paths."""

import concurrent.futures
import contextlib
import os

HERE = os.path.dirname(os.path.abspath(__file__))


def _worker():
    """The function that does a task. It is an inner one, which dask sends as it stands: the other
    side has no path to this module yet."""
    here = HERE

    def work(task):
        import sys
        if here not in sys.path:
            sys.path.insert(0, here)
        import pair_run
        return pair_run.work(task)
    return work


class Local:
    def __init__(self, jobs):
        self.description = f"{jobs} process{'es' if jobs > 1 else ''} here"
        self.pool = concurrent.futures.ThreadPoolExecutor(jobs)

    def run(self, tasks):
        """(index, result) as they are done."""
        work = _worker()
        futures = {self.pool.submit(work, task): i for i, task in enumerate(tasks)}
        for future in concurrent.futures.as_completed(futures):
            yield futures[future], future.result()

    def close(self):
        import children
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
        work = _worker()
        futures = {self.client.submit(work, task, pure=False): i for i, task in enumerate(tasks)}
        for future in distributed.as_completed(futures):
            yield futures[future], future.result()

    def close(self):
        self.client.close()


@contextlib.contextmanager
def workers(jobs, scheduler):
    """A Local or Dask, closed at the end."""
    made = Dask(scheduler) if scheduler else Local(jobs)
    try:
        yield made
    finally:
        made.close()
