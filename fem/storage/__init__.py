"""How is a file kept whole, found again, and known to be damaged?"""

from .cache import (
    TableFileError as TableFileError,
    cache_folder as cache_folder,
    from_cache as from_cache,
    make_room as make_room,
    owned as owned,
    temporary_home as temporary_home,
)
from .checked_files import (
    described as described,
    read_checked as read_checked,
    write_checked as write_checked,
)
from .compiled_code import compiled as compiled, compiled_later as compiled_later
from .foreign import hdf5_fault as hdf5_fault, is_hdf5 as is_hdf5
from .program_text import digest_of as digest_of, program_of as program_of
from .runtime_numbers import RuntimeNumbers as RuntimeNumbers
from .whole_files import seal as seal, unsealed as unsealed, write_whole as write_whole
