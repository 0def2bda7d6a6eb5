"""Runs callers that were compiled with other headers than the library they run on, and compares
what they print.

usage: run_callers.py "PROGRAM ARGUMENT..." ...   The first one is what the others are compared
with."""

import subprocess
import sys

outputs = []
for command in sys.argv[1:]:
    done = subprocess.run(command.split(), capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{command}: status {done.returncode}\n{done.stdout}{done.stderr}")
    outputs.append(done.stdout)
    if done.stdout != outputs[0] or "tv_reconstruct" not in done.stdout:
        sys.exit(f"{command} differs from {sys.argv[1]}:\n{done.stdout}\n{outputs[0]}")
print(outputs[0])
