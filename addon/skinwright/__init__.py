"""Skinwright: transfer skin weights, steer the transfer with a mask, turn sculpts into weights."""

from . import command_line, operators, preferences, properties, ui
from .scene import changes

MODULES = (preferences, properties, changes, *operators.MODULES, *ui.MODULES, command_line)


def register() -> None:
    """Register every part, in an order in which each finds what it needs."""
    for module in MODULES:
        module.register()


def unregister() -> None:
    """Take everything away again, last first."""
    for module in reversed(MODULES):
        module.unregister()
