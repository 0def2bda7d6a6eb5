#!/usr/bin/env python3
"""Tests of packaging/ and scripts/release: which package holds which file, equal bytes of the
source archives, the glibc that a wheel's tag promises, manual pages, completion, SPDX lists and
versions. The whole of it, on bare systems, is scripts/test_packages.

usage: test_packaging.py SOURCE_DIR BUILD_DIR CMAKE SOVERSION
"""

import fnmatch
import hashlib
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

SOURCE, BUILD = (pathlib.Path(path) for path in sys.argv[1:3])
CMAKE, SOVERSION = sys.argv[3:5]
PACKAGING = SOURCE / "packaging"
PROGRAM = BUILD / "bin" / "twoview"
VERSION = re.search(r'TV_VERSION_STRING "([^"]+)"',
                    (SOURCE / "lib/include/twoview/version.h").read_text()).group(1)


def run(*command, **options):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True,
                          **options).stdout


class Case(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = pathlib.Path(holder.name)

    def sdist(self, name, **environment):
        """Makes the source distribution in a folder of that name; its path."""
        folder = self.folder / name
        run(sys.executable, PACKAGING / "sdist.py", SOURCE, folder,
            env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000", **environment})
        return folder / f"twoview-{VERSION}.tar.gz"


class Versions(Case):
    def test_the_name_of_the_librarys_package_is_its_soname(self):
        control = (PACKAGING / "debian/control").read_text()
        names = re.findall(r"(?m)^Package: (.*)$", control)
        self.assertEqual(names, [f"libtwoview{SOVERSION}", f"libtwoview-drivers{SOVERSION}",
                                 "libtwoview-dev", "twoview", "python3-twoview"])

    def test_python_loads_the_library_of_this_soname(self):
        abi = (SOURCE / "python/twoview/_abi.py").read_text()
        self.assertIn(f'\nSONAME = "libtwoview.so.{SOVERSION}"\n', abi)

    def test_every_recipe_has_the_librarys_version(self):
        port = json.loads((PACKAGING / "vcpkg/twoview/vcpkg.json").read_text())
        self.assertEqual(port["version"], VERSION)
        self.assertTrue((PACKAGING / f"yocto/twoview_{VERSION}.bb").is_file())
        self.assertIn(f"\nTWOVIEW_VERSION = {VERSION}\n",
                      (PACKAGING / "buildroot/twoview.mk").read_text())

    def test_every_recipe_can_leave_out_the_dense_cloud_odometry_and_room(self):
        cmake = (SOURCE / "CMakeLists.txt").read_text()
        for recipe in ("conan/conanfile.py", "vcpkg/twoview/portfile.cmake",
                       f"yocto/twoview_{VERSION}.bb", "buildroot/twoview.mk"):
            text = (PACKAGING / recipe).read_text()
            for option in ("TWOVIEW_DENSE", "TWOVIEW_ODOMETRY", "TWOVIEW_ROOM"):
                self.assertIn(f"option({option} ", cmake)
                self.assertIn(option, text, recipe)
        port = json.loads((PACKAGING / "vcpkg/twoview/vcpkg.json").read_text())
        self.assertEqual(set(port["default-features"]), set(port["features"]))

    def test_the_maintainer_is_the_licences_holder(self):
        licence = (SOURCE / "LICENSE").read_text()
        holder = re.search(r"Copyright \(c\) \d+, (.*)", licence).group(1)
        control = (PACKAGING / "debian/control").read_text()
        self.assertEqual(re.findall(r"(?m)^Maintainer: (.*) <", control), [holder])
        self.assertRegex((PACKAGING / "debian/copyright").read_text(),
                         rf"(?m)^Copyright: \d+, {holder}$")

    def test_yoctos_sum_is_that_of_the_licence(self):
        found = hashlib.md5((SOURCE / "LICENSE").read_bytes()).hexdigest()
        self.assertIn(f"md5={found}", (PACKAGING / f"yocto/twoview_{VERSION}.bb").read_text())


class Debian(Case):
    def test_each_installed_file_belongs_to_one_package(self):
        # As packaging/debian/rules installs; a triplet stands for Debian's library folder.
        run(CMAKE, "--install", BUILD, "--prefix", self.folder / "usr")
        libdir = next((self.folder / "usr").rglob("libtwoview.a")).parent
        triplet = self.folder / "usr/lib/triplet"
        if libdir != triplet:
            moved = self.folder / "libdir"
            libdir.rename(moved)
            triplet.parent.mkdir(parents=True, exist_ok=True)
            moved.rename(triplet)
        rules = (PACKAGING / "debian/rules").read_text()
        for left_out in re.findall(r"rm -r debian/tmp/(\S+)", rules):
            shutil.rmtree(self.folder / left_out)
        files = [str(path.relative_to(self.folder)) for path in self.folder.rglob("*")
                 if not path.is_dir() or path.is_symlink()]
        self.assertGreater(len(files), 60)
        owners = {name: [] for name in files}
        for listing in sorted((PACKAGING / "debian").glob("*.install")):
            for line in listing.read_text().splitlines():
                pattern = line.split()[0]
                if not pattern.startswith("usr/"):
                    self.assertTrue((SOURCE / pattern).exists(), pattern)
                    continue
                depth = pattern.count("/") + 1
                taken = [name for name in files
                         if fnmatch.fnmatch("/".join(name.split("/")[:depth]), pattern)]
                self.assertTrue(taken, f"{listing.name}: {pattern} matches nothing")
                for name in taken:
                    owners[name].append(listing.stem)
        # libtwoview_*.so.* is below the pattern libtwoview.so.* of no other package.
        wrong = {name: found for name, found in owners.items() if len(found) != 1}
        self.assertEqual(wrong, {})
        self.assertEqual(owners["usr/bin/twoview"], ["twoview"])
        self.assertEqual(owners[f"usr/lib/triplet/libtwoview.so.{VERSION}"],
                         [f"libtwoview{SOVERSION}"])
        self.assertEqual(owners["usr/lib/triplet/libtwoview.so"], ["libtwoview-dev"])

    def test_every_verb_has_a_manual_page_with_every_option(self):
        def run_help(*words):
            return run(PROGRAM, *words, "--help").decode()

        run(sys.executable, PACKAGING / "man_pages.py", "-o", self.folder, SOURCE / "docs/cli.md",
            "--", PROGRAM, env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000",
                                "TWOVIEW_PYTHON": "/no/python"})  # a build system has no numpy
        verbs = re.findall(r"(?m)^  ([a-z]+) ", run_help().split("Subcommands:")[1])
        self.assertGreaterEqual(len(verbs), 9)
        pages = {page.name: page.read_text() for page in self.folder.glob("*.1")}
        self.assertEqual(set(pages), {"twoview.1", *(f"twoview-{verb}.1" for verb in verbs)})
        num_options = 0
        for verb in verbs:
            self.assertIn(f"twoview {verb}", pages["twoview.1"])
            if verb in ("compare", "colmap", "import", "export", "rerun"):
                continue
            shown = pages[f"twoview-{verb}.1"].replace("\\-", "-")
            helps = [run_help(verb)]
            if "Subcommands:" in helps[0]:
                helps += [run_help(verb, name) for name in
                          re.findall(r"(?m)^  ([a-z]+) ", helps[0].split("Subcommands:")[1])]
            for option in re.findall(r"(?m)^ +(?:-\w,)?(--[a-z0-9-]+)", "".join(helps)):
                num_options += 1
                self.assertIn(option, shown, verb)
        self.assertGreater(num_options, 100)
        for name, page in pages.items():
            self.assertRegex(page, r'^\.TH "TWOVIEW[^"]*" "1" "2023-11-14" "twoview ', name)
            self.assertNotIn("`", page.split(".SH OPTIONS")[0], name)  # Markdown that is left
            for line in page.splitlines():  # a text line must not begin as a request does
                if line.startswith((".", "'")):
                    self.assertRegex(line, r"^\.(TH|SH|PP|TP|IP|RS|RE|nf|fi|sp)\b", name)

    def test_bash_completes_verbs_and_options(self):
        def complete(*words):
            text = ("source $1; shift; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); _twoview; "
                    "printf '%s\\n' \"${COMPREPLY[@]}\"")
            return set(run("bash", "-c", text, "bash", PACKAGING / "completion/twoview", PROGRAM,
                           *words).decode().split())

        self.assertEqual(complete("re"), {"reconstruct", "rerun"})
        self.assertLessEqual({"detect", "match", "colmap"}, complete(""))
        self.assertEqual(complete("match", "--max-k"), {"--max-keypoints"})
        self.assertEqual(complete("match", "a.png", "--ra"), {"--ratio"})
        self.assertEqual(complete("match", ""), set())  # then bash offers files


class Sources(Case):
    def test_the_source_distribution_has_the_same_bytes_at_any_place_and_time(self):
        first = self.sdist("first").read_bytes()
        second = self.sdist("second", TZ="Pacific/Kiritimati", LC_ALL="C").read_bytes()
        self.assertEqual(first, second)
        self.assertNotEqual(first, self.sdist("third", SOURCE_DATE_EPOCH="1700000001").read_bytes())

    def test_the_source_distribution_configures_by_fetchcontent(self):
        with tarfile.open(self.sdist("dist")) as archive:
            archive.extractall(self.folder)  # our own file
        root = self.folder / f"twoview-{VERSION}"
        settings = (root / "pyproject.toml").read_text()
        for option in ("cmake.source-dir", "input"):
            path = re.search(rf'(?m)^{option} = "(.*)"$', settings).group(1)
            self.assertTrue((root / path).exists(), path)
        self.assertTrue((root / "python/twoview/__init__.py").is_file())
        self.assertIn(f"\nVersion: {VERSION}\n", (root / "PKG-INFO").read_text())
        defines = re.findall(r'(?m)^(TWOVIEW_\w+|BUILD_TESTING) = "(\w+)"$', settings)
        self.assertIn(("BUILD_TESTING", "OFF"), defines)
        # A project that takes it by FetchContent; Python's build takes the folder itself.
        (self.folder / "CMakeLists.txt").write_text(f"""cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES C CXX)
include(FetchContent)
FetchContent_Declare(twoview SOURCE_DIR "{root}")
FetchContent_MakeAvailable(twoview)
foreach(target twoview twoview_static)
  add_executable(with_${{target}} "{SOURCE}/test/install/consumer.c")
  target_link_libraries(with_${{target}} PRIVATE twoview::${{target}})
endforeach()
""")
        run(CMAKE, "-G", "Ninja", "-S", self.folder, "-B", self.folder / "build",
            *(f"-D{name}={value}" for name, value in defines))

    def test_the_source_archive_has_the_same_bytes_and_every_committed_file(self):
        if not shutil.which("git") or not (SOURCE / ".git").exists():
            self.skipTest("no git repository")
        release = (SOURCE / "scripts/release").read_text()
        command = re.search(r"git archive [^|]*(?=\| *\n *xz -9 -T1 )", release)  # xz takes seconds
        shell = command.group(0).replace("$version", VERSION).replace("$commit", "HEAD")
        first, second = (run("sh", "-c", shell, cwd=SOURCE, env={**os.environ, "TZ": zone})
                         for zone in ("UTC", "Pacific/Kiritimati"))
        self.assertEqual(first, second)
        with tarfile.open(fileobj=io.BytesIO(first)) as archive:
            names = {entry.name for entry in archive if not entry.isdir()}
        committed = run("git", "ls-tree", "-r", "--name-only", "-z", "HEAD", cwd=SOURCE).decode()
        self.assertEqual(names, {f"twoview-{VERSION}/{name}"
                                 for name in committed.split("\0") if name})


class Wheels(Case):
    def test_the_library_needs_no_younger_glibc_than_the_wheels_tag_says(self):
        platform = re.search(r"(?m)^platform=manylinux_(\d+)_(\d+)$",
                             (PACKAGING / "build_wheels").read_text())
        promised = tuple(map(int, platform.groups()))
        libraries = [BUILD / "lib" / f"libtwoview.so.{VERSION}",
                     *(BUILD / "determinism").glob("a*-gcc-O2/lib/libtwoview.so." + VERSION)]
        for library in libraries:
            text = run("readelf", "--dyn-syms", "--wide", library).decode()
            needed = {tuple(map(int, found)) for found in re.findall(r"@GLIBC_(\d+)\.(\d+)", text)}
            self.assertTrue(needed, library)
            self.assertLessEqual(max(needed), promised, library)


class Spdx(Case):
    def test_the_list_has_every_file_with_its_sum(self):
        archive = self.sdist("dist")
        run(sys.executable, PACKAGING / "spdx.py", "--commit", "abc", "--epoch", "1700000000",
            archive.parent)
        listed = json.loads((archive.parent / f"{archive.name}.spdx.json").read_text())
        files = {entry["fileName"]: {c["algorithm"]: c["checksumValue"] for c in entry["checksums"]}
                 for entry in listed["files"]}
        with tarfile.open(archive) as opened:
            for entry in opened:
                data = opened.extractfile(entry).read()
                self.assertEqual(files.pop("./" + entry.name),
                                 {"SHA1": hashlib.sha1(data).hexdigest(),
                                  "SHA256": hashlib.sha256(data).hexdigest()})
        self.assertEqual(files, {})
        package = listed["packages"][0]
        sums = sorted(c["checksumValue"] for entry in listed["files"] for c in entry["checksums"]
                      if c["algorithm"] == "SHA1")
        self.assertEqual(package["packageVerificationCode"]["packageVerificationCodeValue"],
                         hashlib.sha1("".join(sums).encode()).hexdigest())
        self.assertEqual(package["checksums"][0]["checksumValue"],
                         hashlib.sha256(archive.read_bytes()).hexdigest())
        self.assertEqual(listed["creationInfo"]["created"], "2023-11-14T22:13:20Z")

    def test_each_package_lists_what_is_compiled_into_it(self):
        if not shutil.which("dpkg-deb"):
            self.skipTest("no dpkg-deb")
        expected = {f"libtwoview{SOVERSION}": {"Eigen"},
                    f"libtwoview-drivers{SOVERSION}": {"MAVLink"},
                    "libtwoview-dev": {"Eigen", "MAVLink"},
                    "twoview": {"CLI11", "nlohmann-json", "MAVLink"}}
        for name in expected:
            (self.folder / name / "DEBIAN").mkdir(parents=True)
            (self.folder / name / "DEBIAN/control").write_text(
                f"Package: {name}\nVersion: 1\nArchitecture: amd64\nMaintainer: x <x@y.z>\n"
                "Description: x\n")
            run("dpkg-deb", "--build", "--root-owner-group", self.folder / name,
                self.folder / f"{name}_1_amd64.deb")
            shutil.rmtree(self.folder / name)
        (self.folder / "components.txt").write_text(
            "libeigen3-dev 3\nlibcli11-dev 2\nnlohmann-json3-dev 4\npymavlink 5\n")
        run(sys.executable, PACKAGING / "spdx.py", "--commit", "abc", "--epoch", "1700000000",
            self.folder)
        for name, components in expected.items():
            listed = json.loads((self.folder / f"{name}_1_amd64.deb.spdx.json").read_text())
            found = {package["name"]: package["versionInfo"] for package in listed["packages"][1:]}
            self.assertEqual(set(found), components, name)
            self.assertNotIn("NOASSERTION", found.values())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[5:]], verbosity=2)
