#!/usr/bin/env python3
"""Keeps the layers of docs/contributing.md: which folder of lib/src may include which, who may see
Eigen, pixels, the heap and the internals at all, that no files include one another in a circle,
that no sources of a folder call one another in one and no Python modules import one another in one,
that what is installed of twoview_tools needs nothing of its laboratory, and that the rooms
(folders) of tools/twoview include one another only as ROOMS allows. Reads the sources' text; prints
each offence."""
import posixpath
import re
import sys
from pathlib import Path

import circles

# LAYERS[layer]: the layers whose headers the files of this layer may include.
LAYERS = {
    "base": set(),
    "kernels": {"base"},
    "image": {"kernels", "base"},
    "feature": {"image", "kernels", "base"},
    "match": {"feature", "image", "kernels", "base"},
    "geometry": {"kernels", "base"},
    "triangulation": {"geometry", "kernels", "base"},
    "robust": {"triangulation", "geometry", "kernels", "base"},
    "pose": {"robust", "geometry", "kernels", "base"},
    "adjust": {"pose", "robust", "geometry", "kernels", "base"},
    "odometry": {"adjust", "pose", "match", "robust", "feature", "image", "geometry", "kernels",
                 "base"},
    "dense": {"triangulation", "geometry", "kernels", "base"},
    "room": {"geometry", "base"},
    "pipeline": {"dense", "pose", "match", "robust", "feature", "image", "triangulation",
                 "geometry", "kernels", "base"},
    "api": {"pipeline", "room", "dense", "odometry", "adjust", "pose", "match", "robust", "feature",
            "image", "triangulation", "geometry", "kernels", "base"},
}
WITHOUT_EIGEN = {"base", "kernels", "image", "feature", "match"}
WITHOUT_PIXELS = {"geometry", "triangulation", "robust", "pose", "adjust"}
PIXELS = ("twoview/image.h", "image/")
# Headers whose use would bring in the heap, files, threads, clocks or libstdc++.
BANNED = {
    "vector", "string", "map", "set", "unordered_map", "unordered_set", "deque", "list", "memory",
    "functional", "iostream", "fstream", "sstream", "ostream", "istream", "cstdio", "stdio.h",
    "cstdlib", "stdlib.h", "stdexcept", "exception", "thread", "mutex", "future", "chrono", "ctime",
    "time.h", "random", "regex", "locale", "any", "typeinfo",
}
# These folders may include only the public headers of the library.
OUTSIDE = ("drivers", "examples", "tools", "python", "bench")
# bench/relpose.cc times the five-point solver, which no function of the public API calls alone.
EXCEPT = {("bench/relpose.cc", "kernels/kernels.h")}
# The AR.Drone's codecs, which only translate between bytes and structs, and so may not include the
# headers of CODEC_BANNED.
CODECS = {f"drivers/ardrone/{stem}" for stem in (
    "at.c", "bytes.h", "config.c", "encode.c", "exchange.c", "navdata.c", "navdata_layout.c",
    "navdata_layout.h", "pave.c", "pilot.c")}
CODEC_BANNED = re.compile(
    r"^(sys|arpa|netinet)/|^(stdlib|stdio|time|unistd|poll|netdb|errno)\.h$")
# The rooms of tools/twoview and the rooms that each may include; main.cc may include all of them.
# tools/twoview/README.md says what they hold.
ROOMS = {
    "base": set(),
    "files": {"base"},
    "pair": {"files", "base"},
    "pictures": {"pair", "files", "base"},
    "report": {"pictures", "pair", "files", "base"},
    "calibration": {"sources", "pictures", "files", "base"},
    "recording": {"pair", "files", "base"},
    "verbs": {"recording", "calibration", "report", "pictures", "pair", "files", "base"},
    "drone": {"sources", "recording", "files", "base"},
    "room_model": {"report", "pictures", "pair", "files", "base"},
    "odometry": {"room_model", "sources", "drone", "recording", "report", "pictures", "pair",
                 "files", "base"},
    "simulate": {"drone", "files", "base"},
    "sources": {"base"},
}
# The one header of `verbs` that the drone's verbs may include: it declares how a verb is added and
# run.
ROOM_HEADERS = {room: {"verbs/common.h"} for room in ("drone", "odometry", "simulate")}
# Folders outside tools/twoview, and the rooms that may include each.
OUTSIDE_ROOMS = {
    "simulator": {"simulate"},
    "room": {"simulate"},
    "twoview_drivers": {"recording", "drone", "simulate", "sources"},
}
SUFFIXES = {".c", ".cc", ".cpp", ".h", ".hpp"}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.M)


def read_includes(root):
    """Maps each source file, named from the root, to the headers it includes."""
    files = {}
    for top in ("lib",) + OUTSIDE:
        for path in sorted((root / top).rglob("*")):
            if path.suffix in SUFFIXES and path.is_file():
                files[path.relative_to(root).as_posix()] = INCLUDE.findall(path.read_text())
    return files


def resolve(header, files):
    """The project's file that an include names, or None for a system header."""
    for folder in ("lib/src/", "lib/include/"):
        if folder + header in files:
            return folder + header
    return None


def closure(start, files):
    """All headers that `start` includes, directly or through others, as the includes spell them."""
    seen, open_files = set(), [start]
    while open_files:
        for header in files[open_files.pop()]:
            if header not in seen:
                seen.add(header)
                found = resolve(header, files)
                if found:
                    open_files.append(found)
    return seen


def offences(files):
    for name, headers in files.items():
        if name.startswith("lib/src/"):
            layer = name.split("/")[2]
            if layer not in LAYERS:
                yield f"{name}: folder {layer} is no layer"
                continue
            for header in headers:
                target = header.split("/")[0]
                if header.startswith(".") or lies_beside(name, header, files):
                    yield f"{name}: {header}: write includes from lib/src, layer first"
                elif target in LAYERS and target != layer and target not in LAYERS[layer]:
                    yield f"{name}: {layer} may not include {header}"
                elif target == "twoview" and layer == "base":
                    yield f"{name}: base depends on nobody, so not on {header}"
                elif header in BANNED:
                    yield f"{name}: <{header}> has no place in the library"
            everything = closure(name, files)
            if layer in WITHOUT_EIGEN and any(h.startswith("Eigen/") for h in everything):
                yield f"{name}: {layer} includes Eigen"
            if layer in WITHOUT_PIXELS:
                for header in sorted(h for h in everything if h.startswith(PIXELS)):
                    yield f"{name}: {layer} sees pixels through {header}"
        elif name.startswith("lib/include/"):
            for header in headers:
                if "/" in header and not header.startswith("twoview/"):
                    yield f"{name}: a public header includes {header}"
        else:
            for header in headers:
                if (name, header) in EXCEPT:
                    continue
                if name in CODECS and CODEC_BANNED.search(header):
                    yield f"{name}: <{header}>: a codec has no heap, file, socket or clock"
                if (name.startswith("drivers/") and header.startswith("libav") and
                        not name.startswith("drivers/h264/")):
                    yield f"{name}: {header}: libav is for drivers/h264 alone"
                if (resolve(header, files) or "").startswith("lib/src/") or "lib/src" in header:
                    yield f"{name}: {header} is internal; only the public headers are for use here"
    for circle in find_circles(files):
        yield "a circle of files: " + " includes ".join(circle)


def unit_of(name):
    """A path without its suffix: x.h and x.cc are one unit, and a unit may include itself."""
    return name.rsplit(".", 1)[0]


def included_units(name, headers, files):
    """The other units that a file includes: beside it, from a folder above it, or from the folders
    that the compiler searches."""
    parents = [parent.as_posix() + "/" for parent in Path(name).parents][:-1]
    for header in headers:
        for folder in parents + ["lib/src/", "lib/include/", "drivers/include/"]:
            found = posixpath.normpath(folder + header)
            if found in files:
                if unit_of(found) != unit_of(name):
                    yield unit_of(found)
                break


def find_circles(files):
    """The circles of includes, as circles.circles_of lists them."""
    edges = {}
    for name, headers in files.items():
        edges.setdefault(unit_of(name), set()).update(included_units(name, headers, files))
    return circles.circles_of(edges)


def room_offences(files):
    """Yields each file of tools/twoview outside the rooms and each include that ROOMS forbids."""
    folder = "tools/twoview/"
    for name, headers in files.items():
        if not name.startswith(folder):
            continue
        room = name[len(folder):].rpartition("/")[0]
        if room not in ROOMS and name != folder + "main.cc":
            yield f"{name}: not in a room; the rooms of {folder} are {', '.join(ROOMS)}"
            continue
        for header in headers:
            target = header.split("/")[0]
            if header.startswith(".") or room and lies_beside(name, header, files):
                yield f"{name}: {header}: write includes from {folder}, room first"
            elif not room or header in ROOM_HEADERS.get(room, ()):
                continue
            elif "/" in header and target in ROOMS and target not in ROOMS[room] | {room}:
                yield f"{name}: room {room} may not include {header}"
            elif target in OUTSIDE_ROOMS and room not in OUTSIDE_ROOMS[target]:
                yield f"{name}: room {room} may not include {header}"


def rooms_self_check():
    """Runs each rule about rooms on an example that breaks it: the rule must report it."""
    good = {
        "tools/twoview/main.cc": ["verbs/verbs.h", "drone/drone.h", "simulate/simulate.h"],
        "tools/twoview/base/error.h": ["string", "twoview/status.h"],
        "tools/twoview/files/image_file.h": ["base/error.h"],
        "tools/twoview/files/image_file.cc": ["files/image_file.h"],
        "tools/twoview/drone/drone.h": ["verbs/common.h", "twoview_drivers/source.h"],
        "tools/twoview/simulate/simulate.cc": ["simulator/server.h", "drone/drone.h"],
    }
    assert not list(room_offences(good)), list(room_offences(good))
    for name, header in [
        ("tools/twoview/base/error.h", "files/image_file.h"),
        ("tools/twoview/files/image_file.cc", "verbs/verbs.h"),
        ("tools/twoview/files/image_file.cc", "image_file.h"),
        ("tools/twoview/files/image_file.cc", "../base/error.h"),
        ("tools/twoview/files/image_file.cc", "twoview_drivers/source.h"),
        ("tools/twoview/drone/drone.h", "verbs/verbs.h"),
        ("tools/twoview/drone/drone.h", "simulator/server.h"),
        ("tools/twoview/drone/drone.h", "simulate/simulate.h"),
        ("tools/twoview/drone/drone.h", "room/room.h"),
        ("tools/twoview/flat.cc", "string"),
        ("tools/twoview/attic/old.cc", "string"),
    ]:
        bad = {file: list(headers) for file, headers in good.items()}
        bad.setdefault(name, []).append(header)
        assert list(room_offences(bad)), f"the check misses {name} including {header}"


def lies_beside(name, header, files):
    return f"{name.rsplit('/', 1)[0]}/{header}" in files


# Circles that the check must find: two headers, a circle through a .cc file, and three files in two
# folders.
CIRCLES = [
    {"lib/src/robust/a.h": ["robust/b.h"], "lib/src/robust/b.h": ["robust/a.h"]},
    {
        "lib/src/robust/refine.h": [],
        "lib/src/robust/refine.cc": ["robust/refine.h", "robust/gravity.h"],
        "lib/src/robust/gravity.h": ["robust/refine.h"],
    },
    {
        "tools/twoview/a.h": ["rooms/b.h"],
        "tools/twoview/rooms/b.h": ["c.h"],
        "tools/twoview/rooms/c.h": [],
        "tools/twoview/rooms/c.cc": ["../a.h"],
    },
]


def self_check():
    """Runs each rule on an example that breaks it: the rule must report it, else a check that finds
    nothing would prove nothing."""
    good = {
        "lib/include/twoview/image.h": ["stdint.h"],
        "lib/include/twoview/two_view.h": ["twoview/image.h"],
        "lib/src/base/arena.h": ["cstdint"],
        "lib/src/image/pyramid.h": ["base/arena.h"],
        "lib/src/geometry/camera.h": ["Eigen/Core"],
        "lib/src/match/match.cc": ["image/pyramid.h", "cmath"],
        "tools/twoview/main.cc": ["twoview/image.h", "vector"],
        "drivers/ardrone/at.c": ["string.h"],
        "drivers/ardrone/sockets.c": ["sys/socket.h"],
        "drivers/h264/h264.c": ["libavcodec/avcodec.h"],
    }
    assert not list(offences(good)), list(offences(good))
    for name, header in [
        ("lib/src/image/pyramid.h", "feature/corners.h"),
        ("lib/src/base/arena.h", "twoview/image.h"),
        ("lib/src/match/match.cc", "geometry/camera.h"),
        ("lib/src/match/match.cc", "Eigen/Core"),
        ("lib/src/match/match.cc", "vector"),
        ("lib/src/geometry/camera.h", "twoview/image.h"),
        ("lib/src/geometry/camera.h", "twoview/two_view.h"),
        ("lib/src/image/pyramid.h", "../base/arena.h"),
        ("lib/src/engine/x.cc", "cmath"),
        ("lib/include/twoview/image.h", "Eigen/Core"),
        ("tools/twoview/main.cc", "base/arena.h"),
        ("drivers/ardrone/at.c", "sys/socket.h"),
        ("drivers/ardrone/at.c", "stdlib.h"),
        ("drivers/ardrone/at.c", "libavcodec/avcodec.h"),
        ("drivers/ardrone/sockets.c", "base/arena.h"),
        ("drivers/ardrone/sockets.c", "libavcodec/avcodec.h"),
    ]:
        bad = {file: list(headers) for file, headers in good.items()}
        bad.setdefault(name, []).append(header)
        assert list(offences(bad)), f"the check misses {name} including {header}"
    for circle in CIRCLES:
        assert find_circles(circle), f"the check misses a circle in {circle}"
    # A unit that includes its own header, and a diamond of includes, are no circles.
    assert not find_circles({
        "lib/src/robust/a.h": ["robust/b.h", "robust/c.h"], "lib/src/robust/a.cc": ["robust/a.h"],
        "lib/src/robust/b.h": ["robust/d.h"], "lib/src/robust/c.h": ["robust/d.h"],
        "lib/src/robust/d.h": []})


def read_modules(folder):
    """The text of each Python module below a folder, by dotted name."""
    return {".".join(path.relative_to(folder).with_suffix("").parts): path.read_text()
            for path in sorted(folder.rglob("*.py"))}


def laboratory_offences(modules, cmake):
    """Yields each import by which a module of twoview_tools that is installed needs one that is
    not, and each module that the list of cmake, the text of tools/twoview/CMakeLists.txt, names in
    vain."""
    words = {name: re.search(rf"set\({name} ([^)]*)\)", cmake)[1].split()
             for name in ("laboratory", "modules_of_verbs")}
    listed = {"twoview_tools." + module.replace("/", ".") for module in words["modules_of_verbs"]}
    edges = circles.imports(modules)

    def is_installed(name):
        return name in listed or name.split(".")[1] not in words["laboratory"]
    needed = {target for name, targets in edges.items() if is_installed(name) for target in targets}
    for name, targets in sorted(edges.items()):
        for target in sorted(targets):
            if is_installed(name) and not is_installed(target):
                yield f"{name} is installed and imports {target} of the laboratory"
    for name in sorted(listed - needed):
        if name not in modules or not name.endswith(".__init__"):
            yield f"{name} is installed, and no verb imports it"


def laboratory_self_check():
    """Each offence must be found: a module of the laboratory that a verb needs, and one in vain."""
    modules = {"twoview_tools.compare.cli": "from ..accuracy import tables",
               "twoview_tools.accuracy.__init__": "", "twoview_tools.accuracy.tables": "",
               "twoview_tools.accuracy.cli": "from . import tables"}
    cmake = "set(laboratory accuracy)\nset(modules_of_verbs accuracy/__init__ accuracy/tables)"
    assert not list(laboratory_offences(modules, cmake))
    assert len(list(laboratory_offences(modules, cmake.replace(" accuracy/tables", "")))) == 1
    assert len(list(laboratory_offences(modules, cmake[:-1] + " accuracy/cli)"))) == 1


def code_circles(root):
    """Yields each circle of sources that call each other and of Python modules."""
    sources = {path.relative_to(root).as_posix(): path.read_text()
               for top in ("lib/src",) + OUTSIDE for path in sorted((root / top).rglob("*"))
               if path.suffix in {".c", ".cc"} and path.is_file()}
    for circle in circles.circles_of(circles.calls(sources)):
        yield "a circle of files: " + " calls ".join(circle)
    for top in ("tools/python", "python"):
        for circle in circles.circles_of(circles.imports(read_modules(root / top))):
            yield "a circle of modules: " + " imports ".join(circle)


def main():
    self_check()
    rooms_self_check()
    circles.self_check()
    laboratory_self_check()
    root = Path(sys.argv[1])
    files = read_includes(root)
    if not any(name.startswith("lib/src/") for name in files):
        sys.exit(f"no sources under {sys.argv[1]}/lib/src")
    cmake = (root / "tools/twoview/CMakeLists.txt").read_text()
    found = [*offences(files), *room_offences(files), *code_circles(root),
             *laboratory_offences(read_modules(root / "tools/python"), cmake)]
    for offence in found:
        print(offence)
    print(f"{len(files)} files, {len(found)} offences")
    sys.exit(1 if found else 0)


main()
