"""Clouds of points and meshes in PLY files (cloud.ply, room.ply)."""

import numpy as np

_TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "uchar": "u1",
          "uint8": "u1", "char": "i1", "int8": "i1", "short": "<i2", "int16": "<i2",
          "ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4",
          "uint32": "<u4"}


def _read_header(file, path):
    header = []
    while not header or header[-1] != "end_header":
        line = file.readline()
        if not line or len(header) > 200:
            raise ValueError(f"{path}: no PLY header")
        header.append(line.decode("ascii", "replace").strip())
    return header


def _read_vertices(file, header, path):
    form = next((line.split()[1] for line in header if line.startswith("format ")), "")
    names, count, is_vertex = [], 0, False
    for line in header:
        words = line.split()
        if words[:1] == ["element"]:
            is_vertex = words[1] == "vertex"
            count = int(words[2]) if is_vertex else count
        elif words[:1] == ["property"] and is_vertex:
            if len(words) != 3 or words[1] not in _TYPES:
                raise ValueError(f"{path}: not read: '{line}'")
            names.append((words[2], _TYPES[words[1]]))
    if not names:
        raise ValueError(f"{path}: no points")
    first = next(line.split()[1] for line in header if line.startswith("element "))
    if first != "vertex":
        raise ValueError(f"{path}: its points are not first, but '{first}'")
    if form == "binary_little_endian":
        vertex = np.dtype(names)
        data = file.read(count * vertex.itemsize)
        vertices = np.frombuffer(data, vertex, len(data) // vertex.itemsize)
    elif form == "ascii":
        rows = [tuple(float(v) for v in file.readline().split()) for _ in range(count)]
        vertices = np.array(rows, np.dtype(names))
    else:
        raise ValueError(f"{path}: PLY of the form '{form}'")
    if len(vertices) != count:
        raise ValueError(f"{path}: fewer points than its header says")
    return vertices


def read_ply(path):
    """The vertices of a PLY file (ascii or binary little-endian) as a structured array."""
    with open(path, "rb") as file:
        return _read_vertices(file, _read_header(file, path), path)


def read_mesh(path):
    """The vertices of a binary little-endian PLY file, as read_ply gives them, and its triangles,
    (n, 3) int32, as `twoview room` writes them: a list of three ints each, behind the vertices."""
    with open(path, "rb") as file:
        header = _read_header(file, path)
        vertices = _read_vertices(file, header, path)
        faces = next((line.split()[2] for line in header if line.startswith("element face ")), None)
        if faces is None or "format binary_little_endian 1.0" not in header:
            raise ValueError(f"{path}: no binary triangles")
        face = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
        data = file.read(int(faces) * face.itemsize)
    triangles = np.frombuffer(data, face, len(data) // face.itemsize)
    if len(triangles) != int(faces) or (triangles["count"] != 3).any():
        raise ValueError(f"{path}: not {faces} triangles")
    return vertices, triangles["corners"]
