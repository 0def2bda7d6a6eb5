"""Formulas of the pages: a block of the language `math` holds one in LaTeX. GitHub draws it itself;
for the site it becomes MathML, which browsers draw without a script."""

import re

import latex2mathml.converter

BLOCK = re.compile(r"(?m)^(?P<indent> *)```math\n(?P<latex>(?:.*\n)*?) *```$")


def mathml(latex):
    """The MathML of a formula, in display style, on one line."""
    return latex2mathml.converter.convert(" ".join(latex.split()), display="block")


def rendered(markdown):
    """Markdown whose formulas are MathML. The blank lines make each a block of HTML, which Markdown
    leaves as it is."""
    def block(found):
        indent = found["indent"]
        return f'{indent}<div class="formula">{mathml(found["latex"])}</div>'
    return BLOCK.sub(block, markdown)
