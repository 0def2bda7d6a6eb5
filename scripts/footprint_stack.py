#!/usr/bin/env python3
"""Computes the deepest stack of each public function from what gcc writes with -fcallgraph-info=su.
usage: footprint_stack.py FOLDER [--limit BYTES] [--all]
  FOLDER  where the library's .ci files lie, below object folders as ninja leaves them
  --all   also prints a line for each public function
Prints the deepest chain of calls. Status 1 where a function's frame has no bound (alloca, an array
of variable length), where functions call each other in a circle, or where a public function needs
more than BYTES (32768 by default)."""
import argparse
import pathlib
import re
import sys

NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "([^"]*)"')
EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^":]*))?')
FRAME = re.compile(r"(\d+) bytes \((\S+)\)")
INDIRECT = "__indirect_call"
SOURCES = pathlib.Path(__file__).resolve().parent.parent / "lib/src"
KERNEL = re.compile(r"(?:tvk_)?(\w+?)(?:_(?:c|sse2|avx2|avx512|neon|neon_dot))?(?:\.\w+)*")
# Stack assumed for functions of other libraries (memcpy and similar, sqrt, getauxval), whose frames
# are small.
FOREIGN_BYTES = 256
# Bounds of recursion: std::sort calls itself at most twice the logarithm of the number of elements,
# which is at most 2^20.
SELF_CALLS = {"__introsort_loop": 40}


class Graph:
    """The frames and calls of functions. For a static function gcc writes path:name, so that its
    name is unique to its file."""

    def __init__(self):
        self.frame, self.calls, self.unbounded = {}, {}, []

    def read(self, path, file=None):
        """`file`: whose indirect calls these are. None: of the file that gcc names for each."""
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
                target = edge[2]
                if target == INDIRECT:
                    target += " " + (file or "/".join(pathlib.Path(edge[3] or "none").parts[-2:]))
                self.calls.setdefault(edge[1], set()).add(target)


def kernels_of(source):
    """The kernels that a source file may call: those it names as members of the kernel table. A
    file that names none, or lies outside the library, may call any kernel."""
    if not source.exists():
        return frozenset()
    lists = [(SOURCES / "kernels" / name).read_text()
             for name in ("kernels.h", "odometry.h", "dense.h")]
    names = set(re.findall(r"X\((\w+), (?!TVK_)", "".join(lists)))  # not the lists themselves
    return frozenset(names & set(re.findall(r"(?:->|\.)(\w+)", source.read_text())))


def deepest_of(graph, kernel_bytes):
    """{function: (its deepest stack in bytes, the chain of calls)}. Recursion ends the program with
    an error. kernel_bytes(title) gives the bytes of an indirect call."""
    known, open_names = {}, []

    def visit(name):
        if name in known:
            return known[name]
        if name.startswith(INDIRECT):
            bytes_ = kernel_bytes(name)
            return bytes_, [f"(a kernel of those that {name.split()[1]} names: {bytes_})"]
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


def read_graphs(folder):
    """Returns two graphs: that of the library outside the kernels, in which indirect calls name
    their file, and that of the kernels."""
    graph, kernels = Graph(), Graph()
    files = sorted(folder.rglob("*.ci"))
    if not files:
        sys.exit(f"{folder}: no .ci files; build with -fcallgraph-info=su")
    for path in files:
        is_kernel_file = path.parent.name == "kernels" and not path.name.startswith("select")
        if is_kernel_file:
            kernels.read(path, "kernels")
        elif path.name.endswith(".ltrans.ci"):  # written as a library was linked, of many files
            graph.read(path)
        else:
            graph.read(path, f"{path.parent.name}/{path.name.removesuffix('.ci')}")
    return graph, kernels


def kernel_bytes_by(kernels):
    """Returns a function from the title of an indirect call to the stack of the deepest kernel, of
    any set, that the call's file names; if it names none, of all kernels."""
    # No kernel calls through a pointer, so an indirect call inside a kernel counts as 0.
    deepest = {name: bytes_ for name, (bytes_, _) in deepest_of(kernels, lambda _: 0).items()}

    def kernel_bytes(call):
        names = kernels_of(SOURCES / call.split()[1])
        return max(bytes_ for title, bytes_ in deepest.items()
                   if not names or KERNEL.fullmatch(title.rsplit(":", 1)[-1])[1] in names)

    return kernel_bytes


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--limit", type=int, default=32768)
    parser.add_argument("--all", action="store_true", help="a line for each public function")
    args = parser.parse_args()
    sys.setrecursionlimit(10000)

    graph, kernels = read_graphs(args.folder)
    wrong = graph.unbounded + kernels.unbounded
    deepest = deepest_of(graph, kernel_bytes_by(kernels))
    public = {name: deepest[name] for name in deepest if re.fullmatch(r"tv_\w+", name)}
    if "tv_reconstruct" not in public:
        wrong.append("tv_reconstruct is not there")
    for name, (bytes_, _) in sorted(public.items(), key=lambda item: -item[1][0]):
        if args.all:
            print(f"{bytes_:7d} {name}")
        if bytes_ > args.limit:
            wrong.append(f"{name}: {bytes_} bytes of stack are more than {args.limit}")
    name, (bytes_, chain) = max(public.items(), key=lambda item: item[1][0])
    print(f"{bytes_} bytes of stack at most: {name}")
    for link in chain:
        is_kernel = link.startswith("(")
        print(
            "        " + link
            if is_kernel
            else f"  {graph.frame.get(link, FOREIGN_BYTES):6d} {link}"
        )
    for line in wrong:
        print(line)
    sys.exit(1 if wrong else 0)


main()
