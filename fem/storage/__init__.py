"""How is a file kept whole, found again, and known to be damaged?"""

from .cache import from_cache
from .checked_files import TableFileError, described, read_checked, write_checked
from .compiled_code import compiled
from .program_text import digest_of, program_of
from .whole_files import write_whole

__all__ = [
    "TableFileError",
    "compiled",
    "described",
    "digest_of",
    "from_cache",
    "program_of",
    "read_checked",
    "write_checked",
    "write_whole",
]
