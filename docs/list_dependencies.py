"""Writes docs/dependencies.md: every dependency with its reason and its licence.

From the repository's root: python docs/list_dependencies.py. Reasons are the comments in pyproject.toml, licences what
the installed packages say of themselves.
"""

import re
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

ROOT = Path(__file__).parent.parent
DIRECT = re.compile(r'^  "([\w.-]+)[^"]*",\s*(?:# (.+))?$', re.MULTILINE)
INDIRECT = re.compile(r"^([\w.-]+)==.*?(?=^\S|\Z)", re.MULTILINE | re.DOTALL)
KNOWN = {"matplotlib": "PSF-based (BSD compatible)", "dynesty": "MIT"}
"""What a package's text says in many words."""
HEAD = """# Dependencies

Written by `docs/list_dependencies.py` from `pyproject.toml`, `requirements-dev.txt` and what the packages say of their
licences; `tests/whole/test_documentation.py` keeps it up to date. spinlev itself has the MIT licence. Licences with a
condition on changed copies of the library are LGPL (NGSolve, Netgen and Open CASCADE) and MPL (heyoka and some small
ones); all are used unchanged, as separate packages.
"""


def reasons(text):
    """Name and reason of each dependency of a part of pyproject.toml."""
    return {name: reason or "" for name, reason in DIRECT.findall(text)}


def licence(name):
    """What an installed package says of its licence, short."""
    try:
        found = metadata(name)
    except PackageNotFoundError:
        return "not installed here"
    classified = [c.split("::")[-1].strip() for c in found.get_all("Classifier") or () if c.startswith("License ::")]
    said = (found.get("License") or "").strip()
    short = said if said and "\n" not in said and len(said) < 30 else ""
    text = KNOWN.get(name) or found.get("License-Expression") or ", ".join(classified) or short or "see its files"
    return text.replace(" License", "")


def needed_by(text):
    """Name of each pinned package, and the packages that need it."""
    found = {}
    for match in INDIRECT.finditer(text):
        via = match[0].partition("# via")[2].replace("#", " ").split()
        found[match[1]] = [name for name in via if not name.startswith("spinlev")]
    return found


def page():
    """The whole page."""
    run, _, rest = (ROOT / "pyproject.toml").read_text("utf-8").partition("[project.optional-dependencies]")
    extras = re.split(r"^(\w+) = \[$", rest.partition("[project.urls]")[0], flags=re.MULTILINE)[1:]
    groups = {"To run": reasons(run.partition("dependencies = [")[2])}
    groups |= {f"Extra `{name}`": reasons(lines) for name, lines in zip(extras[::2], extras[1::2], strict=True)}
    pinned = needed_by((ROOT / "requirements-dev.txt").read_text("utf-8"))
    lines = [HEAD]
    for title, names in groups.items():
        lines += [f"## {title}", "", "| package | for | licence |", "| --- | --- | --- |"]
        lines += [f"| {name} | {reason} | {licence(name)} |" for name, reason in names.items()]
        lines += [""]
    lines += ["## What these need", "", "| package | needed by | licence |", "| --- | --- | --- |"]
    others = sorted(set(pinned).difference(*groups.values()))
    lines += [f"| {name} | {', '.join(pinned[name])} | {licence(name)} |" for name in others]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    (ROOT / "docs" / "dependencies.md").write_text(page(), "utf-8")
