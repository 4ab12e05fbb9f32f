"""Words in place of which the field has others: in the program's strings, and in the documentation."""

import re

EVERYWHERE = {
    r"hangs?|in step with|stays? up|still up": "levitates; frequency-locked",
    r"ledgers?": "energy balance",
    r"(small|slowest) motions?": "mode; least stable mode",
    r"flew|flown": "simulated",
    r"e-fold in": "e-folding time",
    r"true fields?": "field of the finite magnets",
}
"""Neither in README and docs nor in what the program prints: a regular expression, and what to write."""
DOCUMENTATION = {
    r"fl(y|ies|ying|ights?)": "trajectory, simulated",
    r"floats?|held|holds? (the|a|another) (floater|ball|magnet)": "levitates, supports",
    r"caught": "captured",
    r"bounces?": "axial mode",
    r"asides?": "lateral offset",
    r"answers?|answered": "response; result",
    r"(its|their|the plate's|with a) memory": "relaxation of the eddy currents",
    r"hears?|heard|told|felt": "response; reported",
    r"side by side|lanes?": "SIMD batch",
    r"e-folds?": "e-folding time",
    r"dies? out|died out": "decays",
    r"undo(es|ne)?": "destabilises",
    r"at home|taken along": "canonical pose",
    r"(by|of|at) -?[\d.]+ /s": "s⁻¹",
}
"""Not in README and docs; the program's strings still have some."""


def pattern(*tables):
    """One regular expression, of whole words in any case."""
    return re.compile(r"\b(?:" + "|".join(key for table in tables for key in table) + r")(?!\w)", re.IGNORECASE)


PROGRAM, PROSE = pattern(EVERYWHERE), pattern(EVERYWHERE, DOCUMENTATION)
CODE = re.compile(r"```.*?```|^ {4,}[^\n]*|`[^`\n]*`|\]\([^)]*\)|^\|? ?<!--.*?-->", re.DOTALL | re.MULTILINE)
"""Of a page in Markdown: blocks, spans, addresses of links; what is in them is the program's, not prose."""


def left_column(text):
    """The words of a page in Markdown, each with its line, for which the field has others."""
    prose = CODE.sub(lambda found: "\n" * found[0].count("\n"), text)
    return [(prose.count("\n", 0, found.start()) + 1, found[0]) for found in PROSE.finditer(prose)]


OF_CODE = re.compile(
    r"\b(?:told|heard|hears?|felt|flew|flown|lanes?|at home|taken along|stays? up|still up|ledgers?|in step with|"
    r"true fields?|(?:slowest|small) motions?|undoes|side by side|caught|hangs?|answers to|e-fold in|"
    r"(?<![`\w./\"-])flights?(?![`\w/\"]|\.\w| :|, \w+ :))(?!\w)",
    re.IGNORECASE,
)
"""Not in comments and docstrings of the program either; `flights` is a room, and flight a name in code and data."""
NAMES = re.compile(r"_?(told|heard|hears|felt|flown|asked|shaken|aside|booked|carried|lanes?)", re.IGNORECASE)
"""Names of variables, functions and classes that say how something came about instead of what it is."""
