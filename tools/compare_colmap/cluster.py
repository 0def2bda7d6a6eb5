"""Who does the work: threads of this process, each with its own worker processes, or a dask cluster.

A worker of a cluster has this tree and the images under the same paths."""

import concurrent.futures
import contextlib
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))


def _work(here, task):
    if here not in sys.path:
        sys.path.insert(0, here)
    import pair_run
    return pair_run.work(task)


class Local:
    def __init__(self, jobs):
        self.description = f"{jobs} process{'es' if jobs > 1 else ''} here"
        self.pool = concurrent.futures.ThreadPoolExecutor(jobs)

    def run(self, tasks):
        """(index, result) as they are done."""
        futures = {self.pool.submit(_work, HERE, task): i for i, task in enumerate(tasks)}
        for future in concurrent.futures.as_completed(futures):
            yield futures[future], future.result()

    def close(self):
        import children
        self.pool.shutdown(wait=False, cancel_futures=True)
        children.close_all()


class Dask:
    def __init__(self, address):
        import cloudpickle
        import distributed
        cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers have no path to it
        self.client = distributed.Client(address, timeout="10s")
        workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
        self.description = f"dask.distributed, {workers} workers at the start"

    def run(self, tasks):
        import distributed
        futures = {self.client.submit(_work, HERE, task, pure=False): i
                   for i, task in enumerate(tasks)}
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
