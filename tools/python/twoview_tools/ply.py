"""Clouds of points in PLY files (cloud.ply)."""

import numpy as np

_TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "uchar": "u1",
          "uint8": "u1", "char": "i1", "int8": "i1", "short": "<i2", "int16": "<i2",
          "ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4",
          "uint32": "<u4"}


def read_ply(path):
    """The vertices of a PLY file (ascii or binary little-endian) as a structured array."""
    with open(path, "rb") as file:
        header = []
        while not header or header[-1] != "end_header":
            line = file.readline()
            if not line or len(header) > 200:
                raise ValueError(f"{path}: no PLY header")
            header.append(line.decode("ascii", "replace").strip())
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
