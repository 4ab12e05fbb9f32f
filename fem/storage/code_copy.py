"""A second copy of the compiled code that heyoka keeps in an SQLite file, so that a flipped bit does not run.

heyoka compares the source of an entry with what is asked, but runs the machine code as it finds it, and SQLite keeps no
checksums: one bit in a constant is a wrong number.  Triggers write the copy in the transaction that writes the code,
whichever process does it.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

STATEMENTS = (
    "CREATE TABLE twin (hash INTEGER PRIMARY KEY, obj BLOB NOT NULL)",
    "CREATE TRIGGER twin_made AFTER INSERT ON cache BEGIN INSERT OR REPLACE INTO twin VALUES (new.hash, new.obj); END",
    "CREATE TRIGGER twin_changed AFTER UPDATE OF hash, obj ON cache BEGIN DELETE FROM twin WHERE hash = old.hash;"
    " INSERT OR REPLACE INTO twin VALUES (new.hash, new.obj); END",
    "CREATE TRIGGER twin_gone AFTER DELETE ON cache BEGIN DELETE FROM twin WHERE hash = old.hash; END",
)


def add_copy(file: Path) -> None:
    """Have every entry of heyoka's new file copied. Raises sqlite3.Error."""
    with closing(sqlite3.connect(file)) as database:
        for statement in STATEMENTS:
            database.execute(statement)
        database.commit()


def sound(file: Path) -> bool:
    """Whether all code in the file is as it was written. Raises sqlite3.Error if others do not let go of it."""
    try:
        with closing(sqlite3.connect(file, timeout=60)) as database:
            database.execute("PRAGMA mmap_size = 1073741824")  # 0.1 s for 0.5 GB, by reading 0.6 s
            known = {row[0] for row in database.execute("SELECT sql FROM sqlite_master")}
            whole = database.execute("PRAGMA integrity_check(1)").fetchone() == ("ok",)
            other = "SELECT EXISTS (SELECT * FROM cache LEFT JOIN twin USING (hash) WHERE twin.obj IS NOT cache.obj)"
            return known.issuperset(STATEMENTS) and whole and database.execute(other).fetchone() == (0,)
    except (sqlite3.Error, UnicodeError) as error:
        if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
            raise
        return False
