"""The interface in other languages: a JSON file per locale, English text to translated text."""

import json
from pathlib import Path

import bpy

# Buttons of operators look their text up in a context of their own.
CONTEXTS = ("*", "Operator")


def tables() -> dict[str, dict[tuple[str, str], str]]:
    """Per locale, (context, English) to the translation, as Blender wants it."""
    found = {}
    for path in sorted(Path(__file__).parent.glob("*.json")):
        texts = json.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = {(context, english): text for english, text in texts.items() for context in CONTEXTS}
    return found


def register() -> None:
    """Hand the tables to Blender."""
    bpy.app.translations.register(__name__, tables())


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(__name__)
