"""The file that is open."""

from pathlib import Path

import bpy


def blend() -> list[Path]:
    """The .blend that is open, which no output of ours replaces; none for one that was never saved."""
    return [Path(bpy.data.filepath)] if bpy.data.filepath else []
