"""Runs a program over a set folder in a process of its own, and measures what it takes."""

import os
import subprocess
import time

from .. import ROOT

PROGRAM = os.path.join(ROOT, "build", "release", "bin", "twoview")
EXIT_STATUSES = (0, 3)  # of twoview odometry with files written; 3: nothing tracked to the end


def measured(command, log, timeout=3600, environment=None):
    """Runs a command with its output in the file `log`. Returns {status, wall_s, cpu_s,
    peak_rss_mib}: CPU time and memory of the process and its children. status is None where the
    time was over."""
    with open(log, "wb") as out:
        begin = time.monotonic()
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, env=environment)
        status = usage = None
        while time.monotonic() - begin < timeout:
            pid, code, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                status = os.waitstatus_to_exitcode(code)
                break
            time.sleep(0.01)
        else:
            process.kill()
            _, _, usage = os.wait4(process.pid, 0)
    process.returncode = status if status is not None else -9  # wait4 has taken the process
    return {"status": status, "wall_s": time.monotonic() - begin,
            "cpu_s": usage.ru_utime + usage.ru_stime,
            "peak_rss_mib": usage.ru_maxrss / 1024}


def program_path(given=None):
    """The program `twoview`: the one given, TWOVIEW_PROGRAM's, or the release build's."""
    return given or os.environ.get("TWOVIEW_PROGRAM") or PROGRAM


def run_odometry(program, source, out, options=()):
    """Runs `twoview odometry SOURCE -o OUT`. Returns measured()'s figures. A RuntimeError has the
    last line of a run that failed."""
    os.makedirs(out, exist_ok=True)
    log = os.path.join(out, "log.txt")
    figures = measured([program, "odometry", source, "-o", out, "--quiet", *options], log)
    if figures["status"] not in EXIT_STATUSES:
        with open(log, encoding="utf-8", errors="replace") as file:
            lines = file.read().strip().splitlines() or ["no output"]
        raise RuntimeError(f"{program} odometry {source}: status {figures['status']}: {lines[-1]}")
    return figures
