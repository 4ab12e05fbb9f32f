"""What the documentation names is there: modules, tests, pictures; the dependencies are all accounted for."""

import ast
import doctest
import pkgutil
import re
import runpy
import tomllib
from importlib import import_module

from numpydoc.docscrape import FunctionDoc
from numpydoc.validate import validate
from places import ROOT
from words import left_column

import spinlev as sl
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.cli.console import PACKAGES

PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
NAMED = re.compile(r"(?:`|pytest )((?:geometry|fem|dynamics|studies|tests|benchmarks|scenes|docs)/[\w/.-]*\w)")


def test_files_that_are_named_exist():
    missing = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
        missing += [f"{page.name}: {name}" for name in NAMED.findall(text) if not (ROOT / name).exists()]
        missing += [f"{page.name}: {link}" for link in links if not (page.parent / link).exists()]
    for script in (ROOT / "Makefile", ROOT / "tests" / "try_wheel.sh", *(ROOT / ".ci").iterdir()):
        named = re.findall(r"\b(?:tests|docs|benchmarks)/[\w/]+\.(?:py|sh)", script.read_text(encoding="utf-8"))
        missing += [f"{script.name}: {name}" for name in named if not (ROOT / name).exists()]
    assert missing == []


def test_no_page_is_longer_than_its_readers_patience():
    lengths = {page.name: len(page.read_text(encoding="utf-8").split()) for page in PAGES}
    assert lengths["README.md"] <= 900
    assert {name: length for name, length in lengths.items() if length > 2500} == {}


def test_pictures_are_shown_and_the_code_knows_them():
    """A figure that a study no longer draws, or draws by another name, does not stay on a page."""
    shown = {name for page in PAGES for name in re.findall(r"pictures/([\w-]+)\.", page.read_text(encoding="utf-8"))}
    files = {path.stem for path in (ROOT / "docs" / "pictures").iterdir()}
    drawn = {figure for study in CATALOGUE.values() for figure in study.figures} | {"scene", "compare", "question"}
    others = {"house", "data", "walk", "simulate", "explore", "drive"}  # docs/draw_architecture.py, record_live_page.py
    assert files <= shown
    assert {name for name in files - drawn - others if not name.startswith("peers-")} == set()


def test_modules_that_are_named_exist():
    missing = []
    for page in [*PAGES, *(ROOT / "docs" / "examples").glob("*.py")]:
        for name in set(re.findall(r"\bspinlev(?:\.[A-Za-z_]\w*)+", page.read_text(encoding="utf-8"))):
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError):
                missing.append(f"{page.name}: {name}")
    assert missing == []


def test_the_words_are_those_of_the_field():
    """Also in the gallery; what decisions.md says of earlier days stays."""
    written = [page for page in PAGES if not page.name.startswith(("words.", "decisions"))]
    written += [ROOT / "CITATION.cff", *(ROOT / "docs" / "examples").glob("*.rst")]
    texts = {page.name: page.read_text(encoding="utf-8") for page in written}
    for example in (ROOT / "docs" / "examples").glob("*.py"):
        texts[example.name] = ast.get_docstring(ast.parse(example.read_text(encoding="utf-8")))
    unreleased = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## [")[1]
    texts["CHANGELOG.md"] = unreleased
    assert [f"{name}:{line}: {word}" for name, text in texts.items() for line, word in left_column(text)] == []


def test_words_of_another_field_are_found():
    said = "The floater hangs.\n\n```python\nflight = 1\n```\nA `flight` [flew](flights.md).\n"
    assert left_column(said) == [(1, "hangs"), (6, "flew")]


FUNCTIONS = [name for name in dir(sl) if name.islower() and callable(getattr(sl, name))]
COMPLETE = {"PR01", "PR02", "PR03", "PR04", "PR07", "PR10", "RT01", "RT03"}
"""Numpydoc's faults: a parameter or the returned value is missing, unknown, without a type or without a description."""


def test_the_front_door_has_its_functions():
    assert {"equilibria", "simulate", "sweep", "draw", "load_scene", "tilt", "to_magpylib"} <= set(FUNCTIONS)


def test_every_function_has_an_example_on_its_page():
    program, pages = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("api_examples.py", "api.md"))
    shown = re.findall(r"(?m)^# \[(\w+)\]\n(?!# )", program)
    listed = re.findall(r"(?m)^   (\w+)$", pages)
    assert sorted(shown) == sorted(listed)
    assert set(FUNCTIONS) <= set(listed)
    assert [name for name in FUNCTIONS if f"sl.{name}" not in program] == []


SILENT = {"tilt", "horizontal", "vertical", "magnets", "sphere", "plate", "to_magpylib"}
"""Raise nothing of their own: what they are given is checked with the whole scene."""


def test_numpydoc_finds_parameters_with_types_and_what_is_returned_and_raised():
    wrong = []
    for name in FUNCTIONS:
        wrong += [(name, *fault) for fault in validate(f"spinlev.{name}")["errors"] if fault[0] in COMPLETE]
        raised = FunctionDoc(getattr(sl, name))["Raises"]
        if not (raised or name in SILENT) or not all(text.desc for text in raised):
            wrong.append((name, "does not say what it raises, and when"))
    assert wrong == []


def test_examples_in_the_code_give_what_they_show():
    """In every module that has some."""
    files = [
        path for name in ("spinlev", "geometry", "fem", "dynamics", "studies") for path in (ROOT / name).rglob("*.py")
    ]
    shown = [path for path in files if ">>> " in path.read_text(encoding="utf-8")]
    assert len(shown) > 4
    for path in shown:
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts if parts[0] == "spinlev" else ("spinlev", *parts)).removesuffix(".__init__")
        found = doctest.testmod(import_module(name))
        assert found.attempted
        assert found.failed == 0, f"{path}: its example gives something else"


def test_every_section_of_the_mathematics_names_the_code_that_is_it():
    for name in ("mathematics.md", "mathematics-currents.md"):
        text = (ROOT / "docs" / name).read_text(encoding="utf-8")
        sections = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
        assert len(sections) >= 5
        assert [section.splitlines()[0] for section in sections if not NAMED.search(section)] == []


def test_dependencies_are_listed_with_reason_and_licence():
    """The list is what its script writes; nothing lacks a reason or a licence."""
    listing = runpy.run_path(str(ROOT / "docs" / "list_dependencies.py"))
    said = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    assert said == listing["page"]()
    rows = [line.split(" | ") for line in said.splitlines() if line.startswith("| ") and "---" not in line]
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = {row[0].strip("| ") for row in rows}
    wanted = [*declared["dependencies"], *declared["optional-dependencies"]["dev"]]
    assert {re.split(r"[><=~]", text)[0] for text in wanted} <= names
    assert [row[0] for row in rows if any(not cell.strip(" |") for cell in row)] == []
    assert "see its files" not in said


def test_the_container_has_what_it_copies_and_what_the_program_asks_for():
    recipe = (ROOT / "Containerfile").read_text(encoding="utf-8")
    copied = [name for line in re.findall(r"^COPY (.+)$", recipe, re.MULTILINE) for name in line.split()[:-1]]
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert set(copied) > {"geometry", "fem", "dynamics", "studies", "scenes", "requirements.txt"}
    for command in PACKAGES["Debian or Ubuntu"].values():
        assert set(command.removeprefix("apt-get install ").split()) <= set(recipe.split())
