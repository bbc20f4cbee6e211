"""Skinwright: transfer skin weights, steer the transfer with a mask, turn sculpts into weights."""

from . import operators, preferences, settings, translations, ui
from .headless import command_line
from .overlay import draw
from .scene import changes

MODULES = (translations, preferences, settings, changes, *operators.MODULES, *ui.MODULES, draw, command_line)


def register() -> None:
    """Register every part, in an order in which each finds what it needs."""
    for module in MODULES:
        module.register()


def unregister() -> None:
    """Take everything away again, last first."""
    for module in reversed(MODULES):
        module.unregister()
