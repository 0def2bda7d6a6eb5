"""Finds circles of files: of C and C++ sources of one folder that call each other's functions, and
of Python modules that import each other. check_layers.py reports them beside circles of
includes."""
import ast
import re

COMMENTS = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.S)
# A function's definition at the beginning of a line; its name is the group.
DEFINITION = re.compile(
    r"^(?!static\b|typedef\b|extern\b|else\b|return\b|template\b)[A-Za-z_][\w:<>,\s*&]*?[\s*&]"
    r"(\w+)\([^;{}]*?\)\s*(?:const\s*)?\{", re.M)
# A call, or a function that is given as an argument.
USE = re.compile(r"\b([A-Za-z_]\w*)\s*\(|[(,]\s*&?(\w+)(?=\s*[,)])")


def without_anonymous(text):
    """C++ text without what is in an unnamed namespace, which other files cannot call."""
    kept, end = [], 0
    for start in re.finditer(r"^namespace \{", text, re.M):
        if start.start() < end:
            continue
        kept.append(text[end:start.start()])
        end, depth = start.end(), 1
        while end < len(text) and depth > 0:
            depth += (text[end] == "{") - (text[end] == "}")
            end += 1
    return "".join([*kept, text[end:]])


def calls(sources):
    """Maps each source to the sources of its folder whose functions it calls. sources: text by
    path. A name that several files define leads nowhere, since which one is meant is not known."""
    texts = {name: COMMENTS.sub(" ", text) for name, text in sources.items()}
    definers = {}
    for name, text in texts.items():
        for function in set(DEFINITION.findall(without_anonymous(text))):
            definers.setdefault(function, []).append(name)
    edges = {}
    for name, text in texts.items():
        folder = name.rpartition("/")[0]
        for function in {a or b for a, b in USE.findall(text)} - set(DEFINITION.findall(text)):
            found = definers.get(function, ())
            if len(found) == 1 and found[0] != name and found[0].rpartition("/")[0] == folder:
                edges.setdefault(name, set()).add(found[0])
    return edges


def imports(modules):
    """Maps each Python module to the modules that it imports, wherever in its text. modules: text
    by dotted name. A package is no module: its __init__ only hands names on."""
    edges = {}
    for name, text in modules.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                found = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                parent = name.split(".")[:-node.level] if node.level else []
                base = ".".join(parent + ([node.module] if node.module else []))
                found = [base] + [f"{base}.{alias.name}" for alias in node.names]
            else:
                continue
            edges.setdefault(name, set()).update(m for m in found if m in modules and m != name)
    return edges


def circles_of(edges):
    """One shortest circle through each node that is part of one; each circle is listed once."""
    circles = {}
    for start in sorted(edges):
        paths, seen = [[start]], {start}
        while paths:
            path = paths.pop(0)
            for node in sorted(edges.get(path[-1], ())):
                if node == start:
                    circles.setdefault(frozenset(path), path + [start])
                    paths = []
                    break
                if node not in seen:
                    seen.add(node)
                    paths.append(path + [node])
    return list(circles.values())


def self_check():
    """Each kind of circle must be found, and what is none must not."""
    session = {
        "drivers/a/session.c": 'void tell(int event) {\n}\nint step(void) { return open_it("x"); }',
        "drivers/a/link.c": "int open_it(const char *name) {\n  tell(1);\n  return 0;\n}",
    }
    assert circles_of(calls(session)), "the check misses two C files that call each other"
    # A third file that both call opens the circle. So does a name in a comment or in a string.
    session["drivers/a/event.c"] = "void tell(int event) {\n}"
    session["drivers/a/session.c"] = "int step(void) {\n  tell(2);\n  return open_it(0);\n}"
    session["drivers/a/event.c"] += '/* step() */ const char *name = "step()";'
    assert not circles_of(calls(session)), circles_of(calls(session))
    # A function of an unnamed namespace is not the other file's function of that name.
    cpp = {
        "tools/b/a.cc": "namespace cli {\nnamespace {\nint half(int x) {\n  return x;\n}\n}\n"
                        "int first(int x) {\n  return half(x);\n}\n}",
        "tools/b/b.cc": "namespace cli {\nint second(int x) {\n  return first(x);\n}\n}",
    }
    assert not circles_of(calls(cpp))
    cpp["tools/b/a.cc"] += "\nint last(int x) {\n  return apply(x, second);\n}"
    assert circles_of(calls(cpp)), "the check misses a function that is given as an argument"
    modules = {"p.a": "from . import b\nimport os", "p.b": "def f():\n    from .c import g",
               "p.c": "g = 1", "p.__init__": "from . import a"}
    assert not circles_of(imports(modules))
    modules["p.c"] = "from ..p import a"
    assert circles_of(imports(modules)), "the check misses a circle of imports"
