"""Enabling and disabling the add-on as a user would; bpy must be there."""

import importlib
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "bl_ext.user_default.skinwright"


def enable() -> object:
    """Enable the add-on as a user would: from the folder of an extension repository. Gives its package."""
    import addon_utils
    import bpy

    repos = bpy.context.preferences.extensions.repos
    folder = Path(next(repo.directory for repo in repos if repo.module == "user_default")) / "skinwright"
    folder.parent.mkdir(parents=True, exist_ok=True)
    if not folder.exists():
        _lay_out(ROOT / "addon" / "skinwright", folder)
    addon_utils.enable(PACKAGE, default_set=True)
    return importlib.import_module(PACKAGE)


def _lay_out(source: Path, folder: Path) -> None:
    """A link where the system lets everyone make one, else a copy; wine makes links that lead nowhere."""
    try:
        folder.symlink_to(source, target_is_directory=True)
    except (OSError, NotImplementedError):
        shutil.copytree(source, folder)
        return
    if not (folder / "__init__.py").exists():
        folder.unlink(missing_ok=True)
        shutil.copytree(source, folder)


def disable() -> None:
    """Disable it, as the tick box in the preferences does."""
    import addon_utils

    addon_utils.disable(PACKAGE, default_set=True)
