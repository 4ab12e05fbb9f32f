"""How large the house is: lines, files, rooms, imports, comments, and documented arguments. `make house` prints it.

Blank lines and docstrings count as lines. A public function documents its arguments if its docstring, or its class's
for `__init__`, names each of them, or `documented` writes in what is left out.
"""

import ast
import io
import tokenize
from pathlib import Path

ROOT = Path(__file__).parent.parent
FOLDERS = ("geometry", "fem", "dynamics", "studies", "spinlev")
MANY_ARGUMENTS = 3


def main() -> None:
    """Print a table: what, how much, and the goal."""
    texts = {path: path.read_text() for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))}
    lines = sum(text.count("\n") for text in texts.values())
    trees = [ast.parse(text) for text in texts.values()]
    imports = sum(
        node.end_lineno - node.lineno + 1
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
    )
    comments = sum(
        token.type == tokenize.COMMENT
        for text in texts.values()
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
    )
    named = [known for tree in trees for known in _arguments_named(tree)]
    documented = 100 * sum(named) / len(named)
    rows = (
        ("lines", f"{lines}", "30000"),
        ("MB", f"{sum(len(text.encode()) for text in texts.values()) / 1e6:.2f}", "1.35"),
        ("files", f"{len(texts)}", "180"),
        ("rooms", f"{len({path.parent for path in texts})}", "22"),
        ("imports, % of the lines", f"{100 * imports / lines:.1f}", "5"),
        ("comments in 1000 lines", f"{1000 * comments / lines:.1f}", "at least 20"),
        ("% of public functions of 3 arguments or more that document them", f"{documented:.0f}", "at least 80"),
    )
    for what, number, goal in rows:
        print(f"{what:66} {number:>6}   goal {goal}")


def _arguments_named(tree: ast.Module) -> list[bool]:
    """For each public function of many arguments, whether its docstring names each of them."""
    found = []
    for owner in [tree, *(node for node in tree.body if isinstance(node, ast.ClassDef) and _public(node.name))]:
        for node in owner.body:
            if isinstance(node, ast.FunctionDef) and (_public(node.name) or node.name == "__init__"):
                arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                arguments = [name for name in arguments if name not in ("self", "cls")]
                text = ast.get_docstring(owner if node.name == "__init__" else node) or ""
                if len(arguments) >= MANY_ARGUMENTS:
                    written = "documented" in map(ast.unparse, node.decorator_list)
                    found.append(written or all(name in text for name in arguments))
    return found


def _public(name: str) -> bool:
    return not name.startswith("_")


if __name__ == "__main__":
    main()
