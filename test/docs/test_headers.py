"""Every public symbol is documented, by rules that a program can check.

- A header, type, struct, field, enum, constant, macro and function has a comment of its own, before
  it or after it on its line; one comment serves the names of one statement. Fields of a struct
  whose comment says "Private" need none.
- A function's comment names each pointer parameter, unless its type says what it is
  (`tv_camera *camera0`), or it is the object that the function works on (its first parameter).
- The comment of a function that returns a status says which statuses it returns.
- Where a comment refers to another function ("as tv_detect"), that function's comment counts too.
- A floating-point field has its unit in its name or comment.
- A header of an algorithm or of a protocol names its source: the page under docs/ that has papers,
  formulas and tests.

A function has at most eight parameters, in the order of docs/conventions.md: what belongs together
is a struct.
"""

import pathlib
import re
import unittest

from twoview_tools.docs import headers

MOST_PARAMETERS = 8
STATUS = re.compile(r"\bTVS?_(?:OK|NONE|END|ERR_\w+)\b|\b(?:Returns|Statuses) (?:also |as )")
UNIT_NAME = re.compile(
    r"_(?:px|rad|deg|mdeg|ns|ms|s|us|m|mm|cm|pa|mg|mv|dc|kb|percent|celsius|bytes|sq|sigma|hz)\b"
)
UNIT_WORD = re.compile(
    r"\b(?:px|pixels?|radians?|rad|degrees?|deg|metres?|m/s|rad/s|nanoseconds|"
    r"seconds|ms|milli\w+|percent|per cent|share|"
    r"fractions?|ratio|factor|units?|unitless|hertz|pascals?|squares?|"
    r"distance|distortion|rotation|direction|unit\b|"
    r"quaternion|matrix|row-major|norm|grey|counts?)\b|\|t\||[\[(][-0-9]"
)


def undocumented(symbols):
    documented = {symbol.name for symbol in symbols if symbol.comment}
    for symbol in symbols:
        private = symbol.kind == "field" and "rivate" in symbol.parent.comment
        # Of a macro that is defined in both #if and #else, one definition needs a comment.
        either = symbol.kind == "macro" and symbol.name in documented
        if not symbol.comment and not private and not either:
            yield symbol


def said(function, functions):
    """The words of a function's comment, and of the comments of the functions that it refers to."""
    texts = [function.comment]
    for name in re.findall(r"\bas\s+(?:for )?(\w+)", function.comment):
        if name in functions:
            texts.append(functions[name].comment)
    return "\n".join(texts)


def unnamed_parameters(function, functions):
    text = said(function, functions)
    for index, (kind, name, points) in enumerate(headers.parameters(function)):
        stem = name.rstrip("01")
        object_of_call = index == 0 and kind.split()[-1:] != ["void"] and "_" in kind
        if points and not object_of_call and not kind.endswith(stem) and \
                not re.search(rf"\b{stem}(?:[01]|0/1)?\b", text):
            yield name


def without_statuses(function, functions):
    return re.match(r"(TV_API |static inline )tvs?_status ", function.code) and \
        not STATUS.search(said(function, functions))


def without_unit(symbol):
    return symbol.kind == "field" and re.match(r"(float|double) ", symbol.code) and \
        "rivate" not in symbol.parent.comment and not UNIT_NAME.search(symbol.name + " ") and \
        not UNIT_WORD.search(symbol.comment)


class TestHeaders(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.headers = headers.all_symbols()
        cls.functions = {
            s.name: s for symbols in cls.headers.values() for s in symbols if s.kind == "function"
        }

    def report(self, found, what):
        lines = [
            f"{path.relative_to(headers.ROOT)}:{symbol.line}: {text}"
            for path, symbol, text in found
        ]
        if lines:
            self.fail(f"{len(lines)} {what}:\n" + "\n".join(lines))

    def each(self, kind=None):
        for path, symbols in self.headers.items():
            for symbol in symbols:
                if kind in (None, symbol.kind):
                    yield path, symbol

    def test_the_parser_finds_what_the_library_exports(self):
        exported = set()
        for path in headers.public_headers():
            exported |= set(re.findall(r"^TV_API [^;]*?(\w+)\(", path.read_text(), re.M))
        self.assertGreater(len(exported), 100)
        self.assertEqual(exported - set(self.functions), set())

    def test_every_symbol_has_a_comment(self):
        self.report(
            [
                (path, symbol, f"{symbol.kind} {symbol}")
                for path, symbols in self.headers.items()
                for symbol in undocumented(symbols)
            ],
            "symbols without a comment",
        )

    def test_every_pointer_is_named(self):
        self.report(
            [
                (path, function, f"{function.name}: {name}")
                for path, function in self.each("function")
                for name in unnamed_parameters(function, self.functions)
            ],
            "pointers that the function's comment does not name",
        )

    def test_a_function_has_at_most_eight_parameters(self):
        counted = [
            (path, function, len(list(headers.parameters(function))))
            for path, function in self.each("function")
        ]
        self.report(
            [
                (path, function, f"{function.name}: {count}")
                for path, function, count in counted
                if count > MOST_PARAMETERS
            ],
            f"functions of more than {MOST_PARAMETERS} parameters",
        )

    def test_every_status_is_said(self):
        self.report(
            [
                (path, function, function.name)
                for path, function in self.each("function")
                if without_statuses(function, self.functions)
            ],
            "functions that do not say their statuses",
        )

    def test_every_source_is_named(self):
        named = set()
        for path, header in self.each("file"):
            pages = re.findall(r"docs/[\w/]+\.md", header.comment)
            self.assertTrue(all((headers.ROOT / page).exists() for page in pages), pages)
            named |= {pathlib.Path(page).stem for page in pages}
            if path.name in ("at.h", "navdata.h", "pave.h", "config.h"):
                self.assertIn("docs/drivers.md", pages, path)
        algorithms = {path.stem for path in (headers.ROOT / "docs" / "algorithms").glob("*.md")} - {
            "math",
            "focal_length",
        }  # about internal code, and about the program: no public header names them
        self.assertEqual(algorithms - named, set())

    def test_the_reference_lists_every_header(self):
        from twoview_tools.docs import reference
        known = {str(path.relative_to(folder).with_suffix(""))
                 for folder in headers.FOLDERS for path in folder.rglob("*.h")}
        listed = {f"twoview/{name}" for name in reference.LIBRARY} | {
            f"twoview_drivers/{name}" for name in reference.DRIVERS}
        self.assertEqual(listed, known - {"twoview/twoview"})

    def test_every_quantity_has_a_unit(self):
        self.report(
            [
                (path, symbol, str(symbol))
                for path, symbol in self.each("field")
                if without_unit(symbol)
            ],
            "fields without a unit",
        )


if __name__ == "__main__":
    unittest.main()
