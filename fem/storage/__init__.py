"""How is a file kept whole, found again, and known to be damaged?"""

from .checked_files import TableFileError, described, from_cache, read_checked, write_checked
from .whole_files import write_whole

__all__ = ["TableFileError", "described", "from_cache", "read_checked", "write_checked", "write_whole"]
