#!/usr/bin/env python3
"""The deepest stack of each public function, from what gcc writes with -fcallgraph-info=su.
usage: footprint_stack.py FOLDER [--limit BYTES] [--all]
  FOLDER  where the library's .ci files lie, below object folders as ninja leaves them
Prints the deepest chain; status 1 where a function's frame has no bound (alloca, an array of
variable length), where functions call each other in a circle, or above the limit."""
import argparse
import pathlib
import re
import sys

NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
FRAME = re.compile(r"(\d+) bytes \((\S+)\)")
INDIRECT = "__indirect_call"
# Of other libraries: memcpy and its like, sqrt, getauxval. Their frames are small and not ours.
FOREIGN_BYTES = 256
# std::sort calls itself at most twice the logarithm of the number, of at most 2^20 elements.
SELF_CALLS = {"__introsort_loop": 40}


class Graph:
    """Frames and calls by a name that is one file's own for static functions: gcc writes those as
    path:name."""

    def __init__(self):
        self.frame, self.calls, self.unbounded = {}, {}, []

    def read(self, path):
        for line in path.read_text().splitlines():
            node = NODE.match(line)
            if node:
                frame = FRAME.search(node[2])
                if frame:
                    self.frame[node[1]] = max(int(frame[1]), self.frame.get(node[1], 0))
                    if frame[2] not in ("static", "dynamic,bounded"):
                        self.unbounded.append(f"{node[1]}: {frame[2]}")
                continue
            edge = EDGE.match(line)
            if edge:
                self.calls.setdefault(edge[1], set()).add(edge[2])


def deepest_of(graph, indirect_bytes):
    """Bytes and chain by function; a circle is a SystemExit."""
    known, open_names = {}, []

    def visit(name):
        if name in known:
            return known[name]
        if name == INDIRECT:
            return indirect_bytes, ["(a kernel)"]
        if name not in graph.frame:
            return FOREIGN_BYTES, [name]
        if name in open_names:
            sys.exit("recursion: " + " -> ".join(open_names[open_names.index(name):] + [name]))
        open_names.append(name)
        times = next((n for part, n in SELF_CALLS.items() if part in name), 1)
        below, chain = 0, []
        for callee in sorted(graph.calls.get(name, set()) - ({name} if times > 1 else set())):
            bytes_, names = visit(callee)
            if bytes_ > below:
                below, chain = bytes_, names
        open_names.pop()
        known[name] = times * graph.frame[name] + below, [name] + chain
        return known[name]

    for name in sorted(graph.frame):
        visit(name)
    return known


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--limit", type=int, default=32768)
    parser.add_argument("--all", action="store_true", help="a line for each public function")
    args = parser.parse_args()
    sys.setrecursionlimit(10000)

    graph, kernels = Graph(), Graph()
    files = sorted(args.folder.rglob("*.ci"))
    if not files:
        sys.exit(f"{args.folder}: no .ci files; build with -fcallgraph-info=su")
    for path in files:
        is_kernel_file = path.parent.name == "kernels" and not path.name.startswith("select.")
        (kernels if is_kernel_file else graph).read(path)
    found = graph.unbounded + kernels.unbounded
    # A call through a pointer inside a kernel would be one more kernel; there is none.
    kernel = max(deepest_of(kernels, 0).values())
    deepest = deepest_of(graph, kernel[0])
    public = {name: deepest[name] for name in deepest if re.fullmatch(r"tv_\w+", name)}
    if "tv_reconstruct" not in public:
        found.append("tv_reconstruct is not there")
    for name, (bytes_, _) in sorted(public.items(), key=lambda item: -item[1][0]):
        if args.all:
            print(f"{bytes_:7d} {name}")
        if bytes_ > args.limit:
            found.append(f"{name}: {bytes_} bytes of stack are more than {args.limit}")
    name, (bytes_, chain) = max(public.items(), key=lambda item: item[1][0])
    print(f"{bytes_} bytes of stack at most, {kernel[0]} of them a kernel's: {name}")
    for link in chain:
        print(f"  {graph.frame.get(link, kernel[0] if link.startswith('(') else FOREIGN_BYTES):6d} {link}")
    for line in found:
        print(line)
    sys.exit(1 if found else 0)


main()
