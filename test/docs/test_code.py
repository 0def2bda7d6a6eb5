"""Every code block of README.md, examples/README.md and docs/ is sound.

- A block names its language: c, sh, python, yaml, json, math, or text for what is none.
- A formula (math) becomes MathML without an unknown command or an unbalanced brace.
- C with a main function compiles as it is, as C99 without warnings. Other C compiles as the body of
  a function, after the includes of all public headers and the declarations that an HTML comment
  before the block gives: `<!-- given: tv_two_view pose; -->`.
- Shell passes `bash -n`; Python compiles; YAML and JSON are read.
"""

import json
import subprocess
import unittest
from xml.etree import ElementTree

from twoview_tools.docs import headers, markdown_pages

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused", "-fsyntax-only", "-x", "c"]
INCLUDES = [f"-I{folder}" for folder in headers.FOLDERS]


def as_program(page, line, text):
    if "main(" in text:
        return text
    names = [
        str(path.relative_to(folder))
        for folder in headers.FOLDERS
        for path in sorted(folder.rglob("*.h"))
    ]
    given = page.before(line).removeprefix("given:")
    return "".join(f"#include <{name}>\n" for name in names) + \
        f"{given}\nint inside(void);\nint inside(void) {{\n{text}\nreturn 0;\n}}\n"


class TestCode(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.blocks = [
            (page, *block)
            for page in map(markdown_pages.Page, markdown_pages.pages())
            for block in page.blocks
        ]

    def each(self, *languages):
        found = [
            (page, line, text)
            for page, language, line, text in self.blocks
            if language in languages
        ]
        self.assertTrue(found, languages)
        return found

    def test_every_block_names_its_language(self):
        self.assertEqual([f"{page}:{line}" for page, language, line, _ in self.blocks
                          if language not in ("c", "sh", "python", "yaml", "json", "math",
                                              "text")], [])

    def test_formulas_become_mathml(self):
        try:
            from twoview_tools.docs import formulas
        except ImportError as missing:
            self.skipTest(f"{missing}: run scripts/bootstrap test")
        for page, line, text in self.each("math"):
            with self.subTest(page=f"{page}:{line}"):
                drawn = formulas.mathml(text)
                root = ElementTree.fromstring(drawn)
                self.assertEqual(root.get("display"), "block")
                self.assertEqual(text.count("{"), text.count("}"))
                self.assertNotIn("\\", drawn)  # a command that is not known stays as it is
                whole = formulas.rendered(f"before\n\n```math\n{text.rstrip()}\n```\n\nafter")
                self.assertRegex(
                    whole, r'(?s)before\n\n<div class="formula"><math.*</div>\n\nafter')

    def test_c_compiles(self):
        for page, line, text in self.each("c"):
            run = subprocess.run(
                ["cc", *FLAGS, *INCLUDES, "-"],
                input=as_program(page, line, text),
                text=True,
                capture_output=True,
            )
            self.assertEqual(run.returncode, 0, f"{page}:{line}\n{run.stderr}")

    def test_shell_is_shell(self):
        for page, line, text in self.each("sh"):
            run = subprocess.run(["bash", "-n"], input=text, text=True, capture_output=True)
            self.assertEqual((run.returncode, run.stderr), (0, ""), f"{page}:{line}")

    def test_python_compiles(self):
        for page, line, text in self.each("python"):
            compile(text, f"{page}:{line}", "exec")

    def test_data_is_read(self):
        try:
            import yaml
        except ImportError:
            self.skipTest("no PyYAML: run scripts/bootstrap test")
        for _, _, text in self.each("yaml"):
            self.assertIsInstance(yaml.safe_load(text), dict)
        for _, language, _, text in self.blocks:
            if language == "json":
                json.loads(text)


if __name__ == "__main__":
    unittest.main()
