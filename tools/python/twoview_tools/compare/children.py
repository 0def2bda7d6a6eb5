"""The parent's side of worker.py: one child process for each thread and interpreter, restarted
after a crash."""

import atexit
import json
import os
import signal
import subprocess
import tempfile
import threading
from multiprocessing.connection import Pipe

from .. import environment

WORKER = "twoview_tools.compare.worker"
TRACE = (" ", "***", "PC: ")  # each line of glog's stack trace begins with one of these


class ChildError(Exception):
    """A failed call. `status` is failed, crashed or timed_out; the text describes it."""

    def __init__(self, status, text):
        super().__init__(text)
        self.status = status


class Child:
    """A running process of worker.py, which answers calls."""

    def __init__(self, python):
        self.connection, theirs = Pipe()
        self.errors, self.matches = tempfile.TemporaryFile(), None
        # The child has a session of its own: killing it also kills the programs that it started
        # (colmap), and Ctrl-C reaches only the parent.
        self.process = subprocess.Popen(
            [python, "-m", WORKER, str(theirs.fileno())], pass_fds=[theirs.fileno()],
            env=environment(),
            stdin=subprocess.DEVNULL, stdout=self.errors, stderr=self.errors,
            start_new_session=True)
        theirs.close()

    def call(self, request, timeout_s, matches):
        """Returns (answer, seconds of CPU). `matches` are bytes that are sent only once for all
        requests that share them."""
        try:
            is_new = matches is not None and matches is not self.matches
            self.connection.send_bytes(json.dumps({**request, "has_matches": is_new}).encode())
            if is_new:
                self.connection.send_bytes(matches)
                self.matches = matches
            if not self.connection.poll(timeout_s):
                self.close()
                raise ChildError("timed_out", f"no answer within {timeout_s:g} s")
            reply = json.loads(self.connection.recv_bytes())
        except (EOFError, OSError):
            raise ChildError("crashed", self._epitaph()) from None
        if "error" in reply:
            raise ChildError("failed", reply["error"])
        return reply["ok"], reply["cpu_seconds"]

    def _epitaph(self):
        """How the child ended, and its last line of output."""
        try:
            code = self.process.wait(5)
        except subprocess.TimeoutExpired:
            code = None
        if code is not None and code < 0:
            how = f"ended by {signal.Signals(-code).name}"
        else:
            how = f"ended with exit status {code}"
        self.errors.seek(max(0, self.errors.seek(0, os.SEEK_END) - 4096))
        lines = [line for line in self.errors.read().decode(errors="replace").strip().splitlines()
                 if not line.startswith(TRACE)]
        self.close()
        return f"{how}: {lines[-1][:200]}" if lines else how

    @property
    def is_usable(self):
        return self.process.poll() is None and not self.connection.closed

    def close(self):
        try:
            os.killpg(self.process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self.process.wait()
        self.connection.close()


_children = {}  # {(thread, interpreter): Child}
_closed = threading.Event()  # set at the end of the run: no thread may start a new child


def call(python, request, timeout_s, matches=None):
    """Calls this thread's child of that interpreter. Returns (the worker's answer, its seconds of
    CPU)."""
    if _closed.is_set():
        raise ChildError("failed", "interrupted")
    key = threading.get_ident(), python
    child = _children.get(key)
    if child is None or not child.is_usable:
        try:
            child = _children[key] = Child(python)
        except OSError as error:
            raise ChildError("crashed", f"{python}: {error.strerror}") from error
    return child.call(request, timeout_s, matches)


def close_all():
    _closed.set()
    for key in list(_children):
        _children.pop(key).close()


atexit.register(close_all)
