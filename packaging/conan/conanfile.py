"""The library twoview for Conan 2, built from the source tree that this file lies in:
conan create packaging/conan"""

import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")


class Twoview(ConanFile):
    name = "twoview"
    license = "BSD-3-Clause"
    description = "FAST-SIFT matching and two-view geometry, without a heap"
    topics = ("computer-vision", "geometry", "embedded")
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"shared": [True, False], "odometry": [True, False], "dense": [True, False],
               "room": [True, False]}
    default_options = {"shared": False, "odometry": True, "dense": True, "room": True}

    def set_version(self):
        header = load(self, os.path.join(ROOT, "lib", "include", "twoview", "version.h"))
        self.version = re.search(r'TV_VERSION_STRING "([^"]+)"', header).group(1)

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", "cmake/*", "lib/*"):
            copy(self, pattern, ROOT, self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        self.requires("eigen/[>=3.4 <4]", visible=False)  # headers, compiled in

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables.update({
            "TWOVIEW_TOOLS": "OFF", "TWOVIEW_DRIVERS": "OFF", "BUILD_TESTING": "OFF",
            "TWOVIEW_ODOMETRY": bool(self.options.odometry),
            "TWOVIEW_DENSE": bool(self.options.dense),
            "TWOVIEW_ROOM": bool(self.options.room)})
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build(target="twoview" if self.options.shared else "twoview_static")

    def package(self):
        source, build = self.source_folder, self.build_folder
        copy(self, "LICENSE", source, os.path.join(self.package_folder, "licenses"))
        copy(self, "*.h", os.path.join(source, "lib", "include"),
             os.path.join(self.package_folder, "include"))
        for pattern in ("libtwoview.so*",) if self.options.shared else ("libtwoview.a",):
            copy(self, pattern, os.path.join(build, "lib"),
                 os.path.join(self.package_folder, "lib"), keep_path=False)

    def package_info(self):
        target = "twoview" if self.options.shared else "twoview_static"
        self.cpp_info.libs = ["twoview"]
        self.cpp_info.system_libs = ["m"]
        # The targets and the file of the library's own CMake package and pkg-config.
        self.cpp_info.set_property("cmake_file_name", "twoview")
        self.cpp_info.set_property("cmake_target_name", f"twoview::{target}")
        self.cpp_info.set_property("pkg_config_name", "twoview")
