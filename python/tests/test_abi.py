"""Checks that struct layouts, enum values and defaults are those of the C headers and library."""

import ctypes
import dataclasses
import functools
import inspect
import os
import re
import shutil
import subprocess
import sys

import pytest
import twoview as tv
from conftest import ROOT
from twoview import _abi, enums, options

INCLUDE = ROOT / "lib" / "include"


def compiled(tmp_path, lines):
    """{word: number} printed by a C program that is compiled against the headers."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if not compiler:
        pytest.skip("no C compiler")
    source, program = tmp_path / "a.c", tmp_path / "a"
    source.write_text('#include <stddef.h>\n#include <stdio.h>\n#include "twoview/twoview.h"\n'
                      "int main(void) {" + "\n".join(lines) + "return 0; }\n")
    subprocess.run([compiler, "-std=c99", "-I", INCLUDE, source, "-o", program], check=True)
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return {word: int(number) for word, number in (line.split() for line in text.splitlines())}


def print_number(word, expression):
    return f'printf("{word} %lld\\n", (long long)({expression}));'


def header_text():
    text = "".join(p.read_text() for p in sorted((INCLUDE / "twoview").glob("*.h")))
    return re.sub(r"/\*.*?\*/", " ", text, flags=re.S)


def test_structs_have_the_compilers_layout(tmp_path):
    lines, expected = [], {}
    for struct in _abi.STRUCTS:
        name = struct.__name__
        lines.append(print_number(name, f"sizeof({name})"))
        expected[name] = ctypes.sizeof(struct)
        for field, kind in struct._fields_:
            member = f"(({name} *)0)->{field}"
            lines.append(print_number(f"{name}.{field}", f"offsetof({name}, {field})"))
            lines.append(print_number(f"{name}.{field}.size", f"sizeof {member}"))
            expected[f"{name}.{field}"] = getattr(struct, field).offset
            expected[f"{name}.{field}.size"] = ctypes.sizeof(kind)
    lines.append(print_number("descriptor", "TV_DESCRIPTOR_BYTES"))
    lines.append(print_number("alignment", "TV_CONTEXT_ALIGNMENT"))
    expected["descriptor"], expected["alignment"] = _abi.DESCRIPTOR_BYTES, _abi.CONTEXT_ALIGNMENT
    assert compiled(tmp_path, lines) == expected


def test_every_struct_and_its_fields_are_the_headers():
    declared = dict(re.findall(r"typedef struct (\w+)\s*\{(.*?)\}\s*\1\s*;", header_text(), re.S))
    assert sorted(s.__name__ for s in _abi.STRUCTS) == sorted(declared)
    for struct in _abi.STRUCTS:
        names = [re.match(r"[\s*]*(\w+)", part)[1]
                 for line in declared[struct.__name__].split(";") if line.strip()
                 for part in re.sub(r"^\s*(const\s+)?\w+", "", line, count=1).split(",")]
        assert [name for name, _ in struct._fields_] == names, struct.__name__


def test_enums_are_the_headers(tmp_path):
    expected = {prefix + member.name: member.value
                for kind, prefix in enums.C_PREFIXES.items()
                for member in kind.__members__.values()}  # __members__ has combined flags, too
    lines = [print_number(name, name) for name in expected]
    assert compiled(tmp_path, lines) == expected
    declared = set()
    for body in re.findall(r"typedef enum \w+\s*\{(.*?)\}", header_text(), re.S):
        declared |= set(re.findall(r"\b(TV_\w+)\s*(?:=|,|$)", body))
    assert declared - set(expected) == set()


# Arrays, which a method takes as its own argument.
ARRAYS_OF_OPTIONS = {"RoomMeshOptions": ["planes", "num_planes"],
                     "RoomInferOptions": ["planes", "num_planes"],
                     "DenseOptions": ["num_sparse", "sparse"]}


@pytest.mark.parametrize("kind", list(options._STRUCTS), ids=lambda kind: kind.__name__)
def test_option_defaults_are_the_librarys(kind):
    library = tv.default_library()
    wanted = options._STRUCTS[kind]
    if not hasattr(library.lib, wanted.__name__ + "_init_sized"):
        pytest.skip(f"the library was built without {kind.__name__}")
    struct = library.make(wanted)
    fields = dataclasses.fields(kind)
    arrays = ["reserved", *ARRAYS_OF_OPTIONS.get(kind.__name__, [])]
    assert [f.name for f in fields] == [name for name, _ in struct._fields_[1:]
                                        if name not in arrays]
    assert not any(getattr(struct, name, 0) for name in arrays)
    for field in fields:
        value = getattr(struct, field.name)
        if isinstance(value, ctypes.Array):
            value = tuple(value)
        if isinstance(value, _abi.tv_calibration):
            value = (value.focal_sigma, value.center_sigma, value.refine)
        if field.name != "seed":
            assert field.default == pytest.approx(value, rel=1e-6), field.name


def test_flags_are_bools_and_nothing_is_reserved():
    flags = {"subpixel", "pooling", "hold_pose", "measured_only"}
    for kind in options._STRUCTS:
        for field in dataclasses.fields(kind):
            assert field.name != "reserved", kind.__name__
            assert isinstance(field.default, bool) == (field.name in flags), field.name


def test_limits_and_reconstruct_defaults_are_the_librarys():
    def defaults(function):
        return {name: p.default for name, p in inspect.signature(function).parameters.items()}

    limits = tv.default_library().make(_abi.tv_limits)
    for name, _ in limits._fields_[1:]:
        assert defaults(tv.Context)[name] == getattr(limits, name), name
    wanted = tv.default_library().make(_abi.tv_reconstruct_options)
    for name in ("triangulation", "guided_matching", "bundle_adjustment", "sigma_by_size",
                 "align_matches"):
        assert defaults(tv.reconstruct)[name] == getattr(wanted, name), name


def test_every_status_has_an_exception():
    for status in tv.Status:
        if status != tv.Status.OK:
            kind = getattr(tv, "TV_" + status.name)
            assert issubclass(kind, tv.StatusError) and kind.status == status


def test_every_function_of_the_headers_is_bound_or_known_to_be_left_out():
    """Fails for a new C function until it is bound or listed here as left out."""
    functions = set(re.findall(r"TV_API [^;(]*?\*?(tv_\w+)\(", header_text()))
    inside = {"tv_context_init", "tv_context_size", "tv_context_kernels", "tv_context_high_water",
              "tv_status_string",
              "tv_adjust_window_size", "tv_odometry_init", "tv_odometry_size",
              "tv_odometry_save_size", "tv_dense_size",
              "tv_depth_size",
              "tv_depth_map_camera", "tv_room_init", "tv_room_get_state",
              "tv_room_infer_size"}
    inside |= {f for f in functions if f.endswith("_init_sized")}
    # C functions without a Python function. The first two take one point; Python has those that
    # take arrays.
    left_out = {"tv_camera_project", "tv_camera_unproject",
                # Python has corrected_camera, of one camera, and Path.add.
                "tv_corrected_pair", "tv_path_record",
                # Measure stage times.
                "tv_context_set_clock", "tv_context_take_times", "tv_odometry_set_clock",
                "tv_odometry_take_times",
                "tv_kernels_string", "tv_kind_string", "tv_verdict_string",
                # Python uses the names of its enums.
                "tv_reason_string", "tv_odometry_status_string"}
    bound = {f for f in functions if hasattr(tv, f[len("tv_"):])}
    bound |= {"tv_odometry_" + method for method in vars(tv.Odometry)} & functions
    bound |= {"tv_room_" + method for method in vars(tv.Room)} & functions
    bound |= {"tv_path_" + method for method in vars(tv.Path)} & functions
    assert functions - bound - inside == left_out


def test_a_function_that_the_library_lacks_is_named():
    library = tv.default_library()
    with pytest.raises(NotImplementedError, match="has no tv_densify_all.*TWOVIEW_DENSE=OFF"):
        library.call("tv_densify_all")
    with pytest.raises(NotImplementedError, match="has no tv_odometry_fly.*TWOVIEW_ODOMETRY=OFF"):
        library.call("tv_odometry_fly")


def test_without_a_library_of_its_own_it_is_the_systems(tmp_path):
    version = re.search(r'TV_VERSION_STRING "(\d+\.\d+)',
                        (ROOT / "lib/include/twoview/version.h").read_text()).group(1)
    assert _abi.SONAME == f"libtwoview.so.{version}"
    shutil.copytree(ROOT / "python/twoview", tmp_path / "twoview")
    (tmp_path / "lib").mkdir()
    program = "import twoview as tv; print(tv.default_library().path, tv.version_string())"
    kept = {k: v for k, v in os.environ.items() if not k.startswith("TWOVIEW")}
    environment = dict(kept, PYTHONPATH=str(tmp_path), LD_LIBRARY_PATH=str(tmp_path / "lib"))
    start = functools.partial(subprocess.run, [sys.executable, "-B", "-c", program], text=True,
                              capture_output=True, env=environment, cwd=tmp_path, check=False)
    run = start()
    assert run.returncode == 1 and "ImportError: no library at" in run.stderr
    shutil.copy(os.environ["TWOVIEW_LIBRARY"], tmp_path / "lib" / _abi.SONAME)
    run = start()
    assert run.stdout.split() == [_abi.SONAME, tv.version_string()], run.stderr


def test_the_package_has_the_librarys_version():
    header = (INCLUDE / "twoview" / "version.h").read_text()
    assert tv.version_string() == re.search(r'VERSION_STRING "([^"]+)"', header)[1]
    assert os.path.isfile(tv.default_library().path)
