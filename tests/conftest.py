"""What tests of several files share."""

import pytest

from spinlev.studies.rendering import unavailable


@pytest.fixture
def needs_3d():
    """Skips a test where nothing can be drawn in three dimensions, and says why."""
    reason = unavailable()
    if reason:
        pytest.skip(reason)
