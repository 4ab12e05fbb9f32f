"""Text for terminals that do not know all characters: ω is written omega there, µ is u, … is three dots."""

import codecs
import io
import sys
import unicodedata

READABLE = "spinlev-readable"
"""Name of the error handler for encodings: it writes what an encoding lacks in ASCII instead of raising an error."""
DASHES, QUOTES, APOSTROPHES = dict.fromkeys("−–—‐‑", "-"), dict.fromkeys("“”„", '"'), dict.fromkeys("‘’", "'")
SIGNS = {"±": "+-", "×": "x", "·": ".", "•": "*", "⁄": "/", "≤": "<=", "≥": ">=", "≠": "!=", "≈": "~", "→": "->"}
UNITS = {"°": "deg", "µ": "u", "μ": "u", "∞": "inf", "√": "sqrt", "∂": "d", "ß": "ss", "ø": "o", "Ø": "O"}
ASCII = DASHES | QUOTES | APOSTROPHES | SIGNS | UNITS
GREEK = {"LAMDA": "lambda"}


def make_readable() -> None:
    """Let standard output and standard error write everything."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=READABLE)


def in_ascii(text: str) -> str:
    """The same in ASCII: Greek letters by their names, accents left out, ? for what has no name here."""
    parts = unicodedata.normalize("NFKD", "".join(ASCII.get(character, character) for character in text))
    return "".join(_character(part) for part in parts if not unicodedata.combining(part))


def _character(character: str) -> str:
    if character.isascii():
        return character
    kind, _, letter = unicodedata.name(character, "").partition(" LETTER ")
    if kind in ("GREEK SMALL", "GREEK CAPITAL"):
        name = GREEK.get(letter.split()[-1], letter.split()[-1].lower())
        return name if kind == "GREEK SMALL" else name.capitalize()
    return ASCII.get(character, "?")


def _readable(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return in_ascii(error.object[error.start : error.end]), error.end


codecs.register_error(READABLE, _readable)
