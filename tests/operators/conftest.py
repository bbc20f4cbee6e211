"""What most tests of operators start from."""

from functools import partial

import pytest
import transferring


@pytest.fixture
def plain(addon):
    """The plain function with settings by name; gives its report."""
    return partial(transferring.transfer, addon)
