"""Every panel of the tab, opened, at the sidebar's default width: a screenshot each to look at."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
from driver import EXTENSION, Steps, Window, enable, record, start
from live_refine import only
from painting import look

PACKAGE = f"{EXTENSION}.ui."
MODULES = ("panel", "match_panel", "sculpt_panel", "stored_panel", "retarget_panel", "refine_panel")


def ours() -> list[type]:
    """The registered panels, those within others last."""
    found = [c for c in bpy.types.Panel.__subclasses__() if c.is_registered and c.__module__.startswith(PACKAGE)]
    return sorted(found, key=lambda cls: hasattr(cls, "bl_parent_id"))


def open_only(name: str, panels: list[type]) -> None:
    """The panels of one module without their arrows closed, and none else of ours."""
    for cls in reversed([cls for cls in panels if cls.is_registered]):
        bpy.utils.unregister_class(cls)
    for cls in panels:
        if cls.__module__ == PACKAGE + name:
            cls.bl_options = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
            bpy.utils.register_class(cls)


def scene(window: Window) -> None:
    """A garment with weights, a mask, stored states, a check, another rig to retarget from, and a key to bake."""
    with window.context():
        armature, figure, garment = dress.build(900, 4)
        settings = bpy.context.scene.skinwright
        settings.transfer.source, settings.retarget.source = figure, armature
        only(garment)
        look(window)
        bpy.ops.skinwright.transfer_weights()
        bpy.ops.skinwright.store_weights()
        bpy.ops.skinwright.edit_match_mask(action="FROM_MATCH")
        bpy.ops.skinwright.check_weights()
        settings.overlay.kind = "INFLUENCES"


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    scene(window)
    panels = ours()
    for name in MODULES:  # what has been drawn once keeps its arrow
        open_only(name, panels)
        yield from window.show_tab("Weights")
        yield from window.screenshot(name)
    record["width"] = window.region("UI").width
    record["panels"] = len(panels)


if __name__ == "__main__":
    start(steps)
