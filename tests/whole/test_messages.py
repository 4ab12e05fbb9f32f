"""All messages of the program, in two grammars: of bad input, and of a computation that found no answer.

Input X must be RULE; instead received VALUE.  Way out.
What happened, as a sentence.  Way out.
"""

import ast
import builtins
import io
import re
import tokenize
from importlib import import_module

from places import ROOT, modules
from words import NAMES, OF_CODE, PROGRAM

from spinlev.geometry.common import ComputationError

INPUT = re.compile(r"(\{\}: )?Input \S.* must .+; instead[ :].+", re.DOTALL)
SENTENCE = re.compile(r"[A-Z].*[.}]", re.DOTALL)
RELAYED = {
    "error.faults": "scene/files: those of scene/making, beside the text in which they have lines",
    "faults": "scene/making: found by the rules between keys and by overlaps, whose sentences are literals here too",
    "described_faults(error.errors())": "scene/making: sentences of scene/messages",
    "refusal(plate, frequency, rtol, best)": "plate_network/reaction: a sentence of limits",
    "str(error)": "an error's own sentence, with another class",
    "[fault]": "scene/files: one of the sentences about what is no TOML, literals there",
    "[str(error)]": "scene/making: the sentence of step_file about a magnet's file",
    "no_argument(function.__name__, name, missing)": "geometry/common: a sentence there",
    "no_argument(function.__name__, name, known)": "geometry/common: a sentence there",
    "needed": "console: what to install for a library that is missing",
    "name": "late: as Python has it of a module that is not installed",
    "str(path)": "whole_files: the system's own error, with the name of the file",
    "str(answer[1])": "basics/apart: the text of a library's error",
    "said": "figures/renderer: the end of the note that no pictures can be drawn",
    "answer": "figures/renderer: the same, from the process that draws",
    "reason": "bodies/step_file: one of ENDS, or what OpenCASCADE says",
    "f\"holds {counted(named, 'solid')}{unread}\" if named else f\"holds none, and {counted(faces, 'open face')}\"": (
        "bodies/step_file: the end of a sentence"
    ),
    "{'least': f'{least:g}'}": "scene/schema: what goes into a rule of scene/messages",
    "way_out(scene, table, known, memory=memory)": "simulation: says what would levitate",
}


ENDS = (
    "does not come to an end with it",
    "crashes on it",
    "needs more than {} GB of memory for it",
    "holds one of {} mm, where {} to {} mm are allowed",
    "holds one whose numbers are not finite",
    "holds one whose surface does not close",
)
"""Of sentences that bodies/step_file and storage/foreign begin with the name of a file."""


def literal(node):
    """A string as it stands in the source, with {} for what is put in; None if it is no string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    if isinstance(node, ast.List) and len(node.elts) == 1:
        return literal(node.elts[0])
    return None


def calls_of(tree):
    """Every call of a plain name that a module makes: the name, the last argument and the line."""
    return [
        (node.func.id, node.args[-1], node.lineno)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args
    ]


def meant(path, name):
    """What a module means by a name; it is loaded for that."""
    module = import_module(".".join(("spinlev", *path.relative_to(ROOT).with_suffix("").parts)))
    return getattr(module, name, getattr(builtins, name, None))


def test_every_error_has_a_message_of_its_kind():
    """Errors are known by their names: every other call is of something else."""
    names, wrong = set(), []
    for path, calls in ((path, calls_of(tree)) for path, tree in modules().items()):
        for name in {name for name, *_ in calls}:
            kind = meant(path, name)
            if (isinstance(kind, type) and issubclass(kind, Exception)) != name.endswith(("Error", "Warning")):
                wrong.append(f"{path}: {name} has the name of an error and is none, or the other way round")
        for name, message, line in (call for call in calls if call[0].endswith(("Error", "Warning"))):
            names.add(name)
            if said := fault(meant(path, name), message):
                wrong.append(f"{path}:{line}: {said}")
    assert wrong == []
    assert {"InputError", "SceneError", "RangeError", "TableFileError", "EquilibriumError"} <= names


def fault(kind, message):
    """What is wrong with the message that an error of some kind is given, or nothing."""
    text = literal(message)
    if text is None:
        source = ast.unparse(message)
        return "" if source in RELAYED else f"{source} is not among RELAYED"
    if text == "{}: {}" or text in ENDS:  # the file's name before a sentence
        return ""
    about_input = issubclass(kind, ValueError | TypeError) or text.startswith("Input ")
    if not about_input and not issubclass(kind, ComputationError):
        return f"{kind.__name__} is no error for a user"
    return "" if (INPUT if about_input else SENTENCE).fullmatch(text) else text


def test_a_message_of_another_grammar_is_found():
    def of(kind, source):
        return fault(kind, ast.parse(source, mode="eval").body)

    assert of(ValueError, "'Bad frequency.'") == "Bad frequency."
    assert of(ComputationError, "'no answer'") == "no answer"
    assert of(RuntimeError, "'It failed.'") == "RuntimeError is no error for a user"
    assert of(ValueError, "some_text") == "some_text is not among RELAYED"
    assert of(ValueError, "f'Input {key} must be positive; instead received {value}.'") == ""


def test_every_sentence_about_input_follows_the_grammar():
    """Also those that functions give back to be raised elsewhere."""
    found, wrong = 0, []
    for path, tree in modules().items():
        inner = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in ast.walk(tree):
            text = None if node in inner else literal(node)
            if text and text.startswith("Input "):
                found += 1
                if not INPUT.fullmatch(text):
                    wrong.append(f"{path}:{node.lineno}: {text}")
    assert wrong == []
    assert found > 100


def test_the_words_are_those_of_the_field():
    """All strings with a space, and of docstrings those that are help."""
    wrong = []
    for path, tree in modules().items():
        owners = (ast.FunctionDef, ast.ClassDef, ast.Module)
        docstrings = {id(node.body[0].value) for node in ast.walk(tree)
                      if isinstance(node, owners) and node.body and isinstance(node.body[0], ast.Expr)}  # fmt: skip
        for node in ast.walk(tree):
            text = literal(node) or ""
            if " " in text and PROGRAM.search(text) and (id(node) not in docstrings or path.name == "commands.py"):
                wrong.append(f"{path}:{node.lineno}: {text}")
    assert wrong == []


def test_comments_and_docstrings_are_in_the_words_of_the_field():
    """Not yet those of the page."""
    wrong = []
    for path, tree in ((path, tree) for path, tree in modules().items() if path.parent.name != "page"):
        text = path.read_text()
        inner = [child for node in ast.walk(tree) for child in ast.iter_child_nodes(node)]
        strings = {(n.value.lineno, n.value.col_offset) for n in inner
                   if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)}  # fmt: skip
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            prose = token.type == tokenize.COMMENT or (token.type == tokenize.STRING and token.start in strings)
            found = OF_CODE.search(token.string) if prose else None
            if found and ">>> " not in token.string:
                wrong.append(f"{path}:{token.start[0]}: {found[0]}")
    assert wrong == []


def test_names_say_what_a_thing_is():
    """Not yet those of the page."""
    wrong = []
    for path, tree in modules().items():
        for node in ast.walk(tree) if path.parent.name != "page" else ():
            name = next((getattr(node, key) for key in ("id", "arg", "name") if getattr(node, key, None)), "")
            if isinstance(name, str) and NAMES.fullmatch(name):
                wrong.append(f"{path}:{node.lineno}: {name}")
    assert wrong == []


def test_words_and_names_of_another_field_are_found():
    assert OF_CODE.search("watch : is told the progress")
    assert OF_CODE.search("how long a flight lasts")
    assert not OF_CODE.search("in `dynamics/flights/batch.py`, see `flight`")
    assert NAMES.fullmatch("_told")
    assert not NAMES.fullmatch("carried_on")
