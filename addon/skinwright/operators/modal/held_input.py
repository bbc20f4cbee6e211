"""Whether a brush is down: no operator sees the release that ends a stroke, but all see which operators are running."""

from bpy.types import Context, Operator


def by_another(context: Context, operator: type[Operator]) -> bool:
    """Whether an operator other than this one holds the input, in any window."""
    windows = context.window_manager.windows
    names = {running.bl_idname for window in windows for running in window.modal_operators}
    return bool(names - {operator.__name__})
