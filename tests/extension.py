"""Enabling and disabling the add-on as a user would; bpy must be there."""

import importlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "bl_ext.user_default.skinwright"


def enable() -> object:
    """Enable the add-on as a user would: from the folder of an extension repository. Gives its package."""
    import addon_utils
    import bpy

    repos = bpy.context.preferences.extensions.repos
    folder = Path(next(repo.directory for repo in repos if repo.module == "user_default")) / "skinwright"
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not folder.exists():
        folder.symlink_to(ROOT / "addon" / "skinwright", target_is_directory=True)
    addon_utils.enable(PACKAGE, default_set=True)
    return importlib.import_module(PACKAGE)


def disable() -> None:
    """Disable it, as the tick box in the preferences does."""
    import addon_utils

    addon_utils.disable(PACKAGE, default_set=True)
