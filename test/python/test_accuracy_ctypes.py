"""tools/accuracy/twoview_ctypes.py: the structs it reads from the headers are the compiler's."""

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    np = None

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path.insert(0, os.path.join(ROOT, "tools", "accuracy"))
if np is not None:
    import twoview_ctypes as tv


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


class TestHeaders(unittest.TestCase):
    def test_structs_have_the_compilers_layout(self):
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            self.skipTest("no C compiler")
        lines = []
        for name, struct in tv.STRUCTS.items():
            lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
            lines += [f'printf("{name}.{field} %zu\\n", offsetof({name}, {field}));'
                      for field, _ in struct._fields_]
        for values in tv.ENUMS.values():
            lines += [f'printf("{value} %d\\n", (int){value});' for value in values]
        program = ('#include <stddef.h>\n#include <stdio.h>\n#include "twoview/twoview.h"\n'
                   "int main(void) {" + "\n".join(lines) + "return 0; }\n")
        with tempfile.TemporaryDirectory() as folder:
            source, binary = os.path.join(folder, "a.c"), os.path.join(folder, "a")
            with open(source, "w", encoding="utf-8") as f:
                f.write(program)
            subprocess.run([compiler, "-std=c99", "-I", os.path.join(ROOT, "lib", "include"),
                            source, "-o", binary], check=True)
            text = subprocess.run([binary], stdout=subprocess.PIPE, check=True,
                                  universal_newlines=True).stdout
        compiled = dict(line.split() for line in text.splitlines())
        for name, struct in tv.STRUCTS.items():
            self.assertEqual(int(compiled[name]), ctypes.sizeof(struct), name)
            for field, _ in struct._fields_:
                self.assertEqual(int(compiled[f"{name}.{field}"]), getattr(struct, field).offset,
                                 f"{name}.{field}")
        for values in tv.ENUMS.values():
            for value, number in values.items():
                self.assertEqual(int(compiled[value]), number, value)

    def test_array_elements_have_the_same_size_in_numpy(self):
        self.assertEqual(tv.KEYPOINT.itemsize, ctypes.sizeof(tv.STRUCTS["tv_keypoint"]))
        self.assertEqual(tv.CORRESPONDENCE.itemsize,
                         ctypes.sizeof(tv.STRUCTS["tv_correspondence"]))

    def test_options_may_be_text(self):
        options = tv.STRUCTS["tv_feature_options"]()
        tv.set_options(options, {"arc": "9", "scale-factor": "1.5", "orientation": "gradient"})
        self.assertEqual((options.arc, options.scale_factor, options.orientation), (9, 1.5, 1))
        with self.assertRaises(tv.TwoviewError):
            tv.set_options(options, {"arcs": 9})
        with self.assertRaises(tv.TwoviewError):
            tv.set_options(options, {"orientation": "sideways"})


class TestLibrary(unittest.TestCase):
    def test_extracts_and_matches_an_image_with_itself(self):
        if not os.path.isfile(tv.DEFAULT_LIBRARY):
            self.skipTest("build/release is not built")
        library = tv.Library()
        noise = np.random.default_rng(5).integers(0, 256, (198, 262))
        image = sum(noise[y:y + 192, x:x + 256] for y in range(7) for x in range(7)) // 49
        image = np.ascontiguousarray((image - image.min()) * 255 // np.ptp(image)).astype(np.uint8)
        context = tv.Context(library, max_width=256, max_height=192)
        keypoints, descriptors = context.extract(image)
        self.assertGreater(len(keypoints), 20)
        self.assertEqual(descriptors.shape, (len(keypoints), 128))
        links = context.match(descriptors, descriptors)
        np.testing.assert_array_equal(links["idx0"], links["idx1"])
        self.assertTrue((links["dist_sq"] == 0).all())


if __name__ == "__main__":
    unittest.main()
