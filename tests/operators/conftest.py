"""What most tests of operators start from."""

from functools import partial

import builders
import figure
import pytest
import transferring


@pytest.fixture
def plain(addon):
    """The plain function with settings by name; gives its report."""
    return partial(transferring.transfer, addon)


@pytest.fixture
def body(scene):
    """A figure with weights and a rig, unless a file has a body of its own."""
    return figure.body()


@pytest.fixture
def rig(body):
    """The armature of `body`."""
    return body.modifiers[0].object


@pytest.fixture
def boot(body):
    """A tube around the left shin."""
    return builders.mesh("Boot", *figure.tube(0.12, 0.05, 0.45, 0.1))
