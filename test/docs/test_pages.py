"""Checks that what README.md, CHANGELOG.md, examples/README.md and docs/ name exists.

- A relative link leads to a file, and its anchor to a heading.
- A path that begins with a folder of the project names a file, exactly or without its extension, or
  a test. `{a,b}` names several; a path with a star or in capitals is a pattern.
- A test in docs/contract.md is one that ctest knows, or a file of test/fuzz; a test function is
  found in some source file.
- The word after `twoview` is a verb of the program, and an option after it is an option of that
  verb.
- A decision that a comment names is a page of docs/decisions.
- A page on an algorithm has its six parts: problem, formula, where it is valid, paper, file, test,
  under headings, with formulas as blocks of math.
"""

import itertools
import os
import pathlib
import re
import subprocess
import unittest

from twoview_tools import ROOT
from twoview_tools.docs import markdown_pages

FOLDERS = "lib|drivers|examples|tools|python|bench|test|docs|scripts|cmake"
PROGRAM = os.environ.get("TWOVIEW_PROGRAM", "")


def braces(path):
    """The paths that a path with braces stands for: a/{b,c}.{h,cc} gives four."""
    pieces = re.split(r"\{([^}]*)\}", path)
    choices = [piece.split(",") if k % 2 else [piece] for k, piece in enumerate(pieces)]
    return ["".join(choice) for choice in itertools.product(*choices)]


def exists(path):
    path = ROOT / path.rstrip("/")
    return (
        path.exists()
        or any(path.parent.glob(path.name + ".*"))
        or any(path.parent.glob(f"test_{path.name}.*"))
    )


class TestPages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.pages = {path: markdown_pages.Page(path) for path in markdown_pages.pages()}
        cls.helps = {}
        build = pathlib.Path(PROGRAM).parents[1] if PROGRAM else ROOT / "build" / "release"
        listed = subprocess.run(
            ["ctest", "--test-dir", str(build), "-N"], capture_output=True, text=True
        ).stdout
        cls.tests = set(re.findall(r"Test +#\d+: (\S+)", listed))

    def report(self, lines, what):
        if lines:
            self.fail(f"{len(lines)} {what}:\n" + "\n".join(lines))

    def test_every_link_leads_somewhere(self):
        wrong, count = [], 0
        for page in self.pages.values():
            for line, target, anchor in page.links():
                count += 1
                path = (page.path.parent / target).resolve() if target else page.path
                if not path.exists():
                    wrong.append(f"{page}:{line}: no file {target}")
                elif anchor and path in self.pages and anchor not in self.pages[path].anchors():
                    wrong.append(f"{page}:{line}: no heading #{anchor} in {target or page}")
        self.assertGreater(count, 50)
        self.report(wrong, "links that lead nowhere")

    def test_every_path_names_a_file(self):
        wrong = []
        for page in self.pages.values():
            if page.path.name == "CHANGELOG.md":
                continue  # the CHANGELOG may name files that no longer exist
            texts = itertools.chain(page.code(), ((line, text) for _, line, text in page.blocks))
            for line, text in itertools.chain(texts, page.prose):
                for path in re.findall(
                    rf"(?<![\w/.<-])((?:{FOLDERS})/[\w./{{}},*-]*[\w}}*/])", text
                ):
                    if (
                        "*" in path
                        or re.search(r"/[A-Z]{3,}\b(?!\.md)", path)
                        or path.startswith("test/bin")
                    ):
                        continue
                    wrong += [f"{page}:{line}: {one}" for one in braces(path)
                              if one not in self.tests and not exists(one)]
        self.report(sorted(set(wrong)), "paths that name no file")

    def test_every_decision_that_a_comment_names_is_a_page(self):
        wrong, count = [], 0
        for folder in ("lib", "drivers", "tools", "python", "test", "scripts"):
            for path in sorted((ROOT / folder).rglob("*")):
                # the frozen headers of a release name the decisions of their time
                if not path.is_file() or "abi" in path.parts or path.suffix not in (
                        ".c", ".cc", ".h", ".py", ".txt", ""):
                    continue
                for name in re.findall(r"docs/decisions/([\w-]+(?:\.md)?)",
                                       path.read_text(errors="replace")):
                    count += 1
                    if not (ROOT / "docs" / "decisions" / name).is_file():
                        wrong.append(f"{path.relative_to(ROOT)}: docs/decisions/{name}")
        self.assertGreater(count, 20)
        self.report(wrong, "decisions that are no page")

    def test_every_test_of_the_contract_is_known(self):
        if not self.tests:
            self.skipTest("no build: TWOVIEW_PROGRAM names none")
        self.need_the_whole_program()
        page = self.pages[ROOT / "docs" / "contract.md"]
        labels = {name.split("/")[0] for name in self.tests}
        wrong = []
        for line, text in page.code():
            label, _, name = text.partition("/")
            if label in labels and name and re.fullmatch(r"\w+", name) and text not in self.tests:
                wrong.append(f"{page}:{line}: {text}")
            if (
                label == "fuzz"
                and re.fullmatch(r"\w+", name)
                and not (ROOT / f"test/fuzz/fuzz_{name}.cc").exists()
            ):
                wrong.append(f"{page}:{line}: {text}")
        self.report(wrong, "tests that ctest does not know")

    def test_every_test_function_of_the_contract_exists(self):
        sources = "\n".join(path.read_text() for path in ROOT.glob("test/*/test_*.*"))
        page = self.pages[ROOT / "docs" / "contract.md"]
        self.report([f"{page}:{line}: {text}" for line, text in page.code()
                     if re.fullmatch(r"test_\w+", text) and not re.search(rf"\b{text}\b", sources)],
                    "test functions that are in no source")

    def need_the_whole_program(self):
        if not PROGRAM or not os.path.exists(PROGRAM):
            self.skipTest("TWOVIEW_PROGRAM names no program")
        if not re.search(r"(?m)^  odometry ", self.help()):
            self.skipTest("the program was built without TWOVIEW_ODOMETRY")
        if "--dense" not in self.help("reconstruct"):
            self.skipTest("the program was built without TWOVIEW_DENSE")

    def help(self, *verb):
        if verb not in self.helps:
            run = subprocess.run([PROGRAM, *verb, "--help"], capture_output=True, text=True)
            self.helps[verb] = run.stdout if run.returncode == 0 else ""
        return self.helps[verb]

    def test_every_verb_and_option_is_the_programs(self):
        self.need_the_whole_program()
        verbs = set(re.findall(r"^  (\w+) ", self.help(), re.M))
        self.assertIn("reconstruct", verbs)
        wrong, count = [], 0
        for page in self.pages.values():
            shell = [
                (line, text.replace("\\\n", " "))
                for language, line, text in page.blocks
                if language in ("sh", "bash")
            ]
            for first, text in itertools.chain(shell, page.code()):
                for line in text.split("\n"):
                    words = line.split("#")[0].split("|")[0].split()
                    starts = [
                        k
                        for k, word in enumerate(words)
                        if re.fullmatch(r"(.*/bin/)?twoview", word)
                    ]
                    if not starts or starts[0] != 0 or len(words) < 2:
                        continue
                    verb, *rest = words[1:]
                    if not re.fullmatch("[a-z]+", verb):
                        continue
                    count += 1
                    if verb not in verbs:
                        wrong.append(f"{page}:{first}: twoview {verb}")
                        continue
                    if verb in ("compare", "colmap", "import", "export", "rerun"):
                        # These verbs are Python programs. The tests python/compare_*,
                        # python/colmap_*, cli/bags and cli/rerun run their commands.
                        continue
                    path = [verb] + (
                        [rest[0]]
                        if verb in ("drone", "map") and rest and re.fullmatch("[a-z]+", rest[0])
                        else []
                    )
                    for option in re.findall(r"(?<!\S)(--?[a-z][\w-]*)", " ".join(rest)):
                        if not re.search(rf"(?<![\w-]){option}\b(?!-)", self.help(*path)):
                            wrong.append(f"{page}:{first}: twoview {' '.join(path)} {option}")
        self.assertGreater(count, 20)
        self.report(wrong, "verbs or options that the program does not have")

    def test_the_table_of_verbs_has_every_verb(self):
        self.need_the_whole_program()
        verbs = set(re.findall(r"^  (\w+) ", self.help().split("Subcommands:")[1], re.M))
        drone = re.findall(r"^  (\w+) ", self.help("drone").split("Subcommands:")[1], re.M)
        page = (ROOT / "docs" / "cli.md").read_text()
        rows = re.findall(r"(?m)^\| `([^|]*)\|", page.split("## Exit status")[0])
        listed = {row.split()[0].strip("`,") for row in rows}
        self.assertEqual(listed, verbs)
        self.assertEqual([row.split()[1].strip("`,") for row in rows if row.startswith("drone")],
                         drone)
        # each verb has a heading, and each verb of the drone a description under its own
        headings = " ".join(re.findall(r"(?m)^## (.*)$", page)).split()
        self.assertEqual(verbs - set(headings), set())
        described = page.split("## drone\n")[1].split("\n## ")[0]
        self.assertEqual([verb for verb in drone if not re.search(rf"[`*]{verb}\b", described)], [])
        for key in re.findall(r"(?m)^    case '(.)': return", (
                ROOT / "tools" / "twoview" / "drone" / "fly.cc").read_text()):
            self.assertIn("space" if key == " " else f"`{key}`", described)

    def test_levels_and_scale_are_on_a_page_for_users(self):
        page = (ROOT / "docs" / "your_camera.md").read_text()
        for option in ("--levels", "--scale-factor"):
            self.assertIn(option, page)

    def test_an_algorithm_has_its_six_parts(self):
        heading = r"(?m)^##+ (?:%s)\b"
        parts = {
            "problem": heading % "Problem",
            "where it is valid": heading % "Where it is valid|Valid region",
            "paper": heading % "Papers?",
            "file": heading % "Files?",
            "test": heading % "Tests?",
            "formula": heading % "Formulas?" + r"|^ *```math$",
        }
        pages = sorted((ROOT / "docs" / "algorithms").glob("*.md"))
        self.assertGreaterEqual(len(pages), 9)
        self.report([f"{path.name}: no {part}" for path in pages for part, pattern in parts.items()
                     if not re.search(pattern, path.read_text())], "parts that are missing")

    def test_an_algorithm_has_headings_and_formulas_that_are_drawn(self):
        wrong = []
        for path in sorted((ROOT / "docs" / "algorithms").glob("*.md")):
            text = re.sub(r"(?ms)^( *)```.*?^ *```$", "", path.read_text())
            for number, line in enumerate(text.split("\n"), 1):
                if re.match(r"\*\*[^*]+\*\*", line):
                    wrong.append(f"{path.name}: a bold word in place of a heading: {line[:40]}")
                if re.match(r"    \S", line) and not re.match(r"\s+([-*]|\d+\.) ", line):
                    wrong.append(f"{path.name}: a formula as preformatted text: {line[:60]}")
        self.report(wrong, "places that are not drawn")


if __name__ == "__main__":
    unittest.main()
