"""All messages of the program, in two grammars: of bad input, and of a computation that found no answer.

Input X must be RULE; instead received VALUE.  Way out.
What happened, as a sentence.  Way out.
"""

import ast
import builtins
import re
from importlib import import_module

import pytest
from places import ROOT

from spinlev.geometry.basics import ComputationError

FILES = sorted(path for folder in ("geometry", "fem", "dynamics", "studies") for path in (ROOT / folder).rglob("*.py"))
INPUT = re.compile(r"(\{\}: )?Input \S.* must .+; instead[ :].+", re.DOTALL)
SENTENCE = re.compile(r"[A-Z].*[.}]", re.DOTALL)
OTHER_FORMS = {
    "Input {} must be a known key; {}.": "of a scene file: the likeliest keys instead of a value",
}
RELAYED = {
    "faults": "scenes/file: found by the rules between keys and by overlaps, whose sentences are literals here too",
    "[describe_fault(detail) for detail in error.errors()]": "scenes/file: sentences of scenes/faults",
    "refusal(plate, frequency, rtol, best)": "plate_network/reaction: a sentence of limits",
    "str(error)": "an error's own sentence, with another class",
    "[str(error)]": "scenes/assembly: the sentence of bodies/step_file about a magnet's file",
    "name": "late: as Python has it of a module that is not installed",
    "str(path)": "whole_files: the system's own error, with the name of the file",
    "str(answer[1])": "basics/apart: the text of a library's error",
    "reason": "bodies/step_file: one of ENDS, or what OpenCASCADE says",
    "f\"holds {counted(named, 'solid')}{unread}\" if named else f\"holds none, and {counted(faces, 'open face')}\"": (
        "bodies/step_file: the end of a sentence"
    ),
    "{'least': f'{least:g}'}": "scenes/schema: what goes into a rule of scenes/faults",
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


def calls(path):
    """Every call of a plain name that a module makes: the name, the last argument and the line."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
            yield node.func.id, node.args[-1], node.lineno


def meant(path, name):
    """What a module means by a name; it is loaded for that."""
    module = import_module(".".join(("spinlev", *path.relative_to(ROOT).with_suffix("").parts)))
    return getattr(module, name, getattr(builtins, name, None))


ERRORS = [(path, *call) for path in FILES for call in calls(path) if call[0].endswith(("Error", "Warning"))]
PLACES = [f"{path.parent.name}/{path.name}:{line}" for path, *_, line in ERRORS]


def test_the_errors_are_found():
    """By their names: every other call is of something else."""
    assert len(ERRORS) > 100
    assert {"InputError", "SceneError", "RangeError", "TableFileError", "EquilibriumError"} <= {e[1] for e in ERRORS}
    named = {(path, name) for path, name, *_ in ERRORS}
    for path in FILES:
        for name in {name for name, *_ in calls(path)}:
            kind = meant(path, name)
            is_error = isinstance(kind, type) and issubclass(kind, Exception)
            assert ((path, name) in named) == is_error, f"{path}: {name}"


@pytest.mark.parametrize(("path", "name", "message", "line"), ERRORS, ids=PLACES)
def test_every_error_has_a_message_of_its_kind(path, name, message, line):
    kind, text, place = meant(path, name), literal(message), f"{path.name}:{line}"
    if text is None:
        assert ast.unparse(message) in RELAYED, f"{place}: {ast.unparse(message)}"
    elif text != "{}: {}" and text not in ENDS:  # the file's name before a sentence
        about_input = issubclass(kind, ValueError | TypeError) or text.startswith("Input ")
        assert about_input or issubclass(kind, ComputationError), f"{place}: {kind.__name__} is no error for a user"
        assert (INPUT if about_input else SENTENCE).fullmatch(text), f"{place}: {text}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_every_sentence_about_input_follows_the_grammar(path):
    """Also those that functions give back to be raised elsewhere."""
    inner = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.JoinedStr):
            inner.update(node.values)
        text = None if node in inner else literal(node)
        if text and text.startswith("Input ") and text not in OTHER_FORMS:
            assert INPUT.fullmatch(text), f"{path.name}:{node.lineno}: {text}"
