"""Drives a Blender window from inside: a test is a generator that yields the seconds to let the window live."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import traceback
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

SHARE = Path(os.environ["SKINWRIGHT_GUI_SHARE"])
sys.path.insert(0, str(SHARE / "site"))

import addon_utils  # noqa: E402
import bpy  # noqa: E402

EXTENSION = "bl_ext.user_default.skinwright"
Steps = Generator[float, None, None]
record: dict[str, Any] = {"version": bpy.app.version_string}


def enable() -> None:
    # Without default_set=True Blender 5 keeps no preferences for the add-on.
    if addon_utils.enable(EXTENSION, default_set=True) is None:
        raise RuntimeError("the add-on could not be enabled; the log says why")


def disable() -> None:
    addon_utils.disable(EXTENSION, default_set=True)


class Window:
    """The one window with its 3D view; coordinates have their origin at the bottom left, in pixels."""

    @property
    def window(self) -> bpy.types.Window:
        return bpy.context.window_manager.windows[0]

    @property
    def area(self) -> bpy.types.Area:
        views = [area for area in self.window.screen.areas if area.type == "VIEW_3D"]
        return max(views, key=lambda area: area.width * area.height)

    def region(self, kind: str = "WINDOW") -> bpy.types.Region:
        return next(region for region in self.area.regions if region.type == kind)

    def context(self, **more: Any) -> Any:
        return bpy.context.temp_override(
            window=self.window, screen=self.window.screen, area=self.area, region=self.region(), **more
        )

    def centre(self) -> tuple[int, int]:
        region = self.region()
        return region.x + region.width // 2, region.y + region.height // 2

    def event(self, kind: str, value: str = "NOTHING", at: tuple[int, int] | None = None, **more: Any) -> None:
        x, y = at or self.centre()
        self.window.event_simulate(type=kind, value=value, x=int(x), y=int(y), **more)

    def key(self, kind: str, **modifiers: bool) -> None:
        self.event(kind, "PRESS", **modifiers)
        self.event(kind, "RELEASE", **modifiers)

    def stroke(self, points: list[tuple[float, float]], settle: float = 0.4) -> Steps:
        """A brush stroke through the points, given from the view's centre in pixels."""
        x, y = self.centre()
        path = [(int(x + dx), int(y + dy)) for dx, dy in points]
        self.event("MOUSEMOVE", at=(path[0][0] - 4, path[0][1] - 4))
        yield 0.1
        self.event("MOUSEMOVE", at=path[0])
        yield 0.15
        self.event("LEFTMOUSE", "PRESS", at=path[0])
        yield 0.05
        for point in path[1:]:
            self.event("MOUSEMOVE", at=point)
            yield 0.03
        self.event("LEFTMOUSE", "RELEASE", at=path[-1])
        yield 0.02
        self.event("MOUSEMOVE", at=(path[-1][0] + 3, path[-1][1] + 3))
        yield settle

    def show_tab(self, category: str) -> Steps:
        """Opens the sidebar at a tab; the region must be drawn once before its tabs exist."""
        self.area.spaces.active.show_region_ui = True
        self.area.tag_redraw()
        yield 0.6
        self.region("UI").active_panel_category = category
        self.area.tag_redraw()
        yield 0.4

    def at_rest(self) -> Steps:
        """Until the view has not been drawn for a while: then Blender's loop sleeps between its timers."""
        drawings, seen = [0], -1

        def count() -> None:
            drawings[0] += 1

        handle = bpy.types.SpaceView3D.draw_handler_add(count, (), "WINDOW", "POST_PIXEL")
        while seen != drawings[0]:
            seen = drawings[0]
            yield 0.6
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")

    def screenshot(self, name: str) -> Steps:
        for area in self.window.screen.areas:
            area.tag_redraw()
        yield 0.4
        self.shoot(name)

    def shoot(self, name: str) -> None:
        """What is on the screen now."""
        # Blender's own screenshot operator reads black from a window on a virtual screen.
        if shutil.which("import"):
            subprocess.run(["import", "-window", "root", str(SHARE / "out" / f"{name}.png")], check=True)


def until(condition: Callable[[], object], seconds: float = 20.0) -> Steps:
    for _ in range(int(seconds / 0.05)):
        if condition():
            return
        yield 0.05
    raise AssertionError(f"waited {seconds} s in vain")


def start(steps: Callable[[Window], Steps]) -> None:
    """Runs the steps once the window stands; writes the record and ends Blender with 0, or with 3 on an exception."""
    bpy.context.preferences.view.show_splash = False
    running = steps(Window())

    def turn() -> float | None:
        try:
            return next(running)
        except StopIteration:
            (SHARE / "out" / "record.json").write_text(json.dumps(record, indent=1))
            code = 0
        except BaseException:
            traceback.print_exc()
            code = 3
        sys.stdout.flush()
        sys.stderr.flush()
        # An orderly quit may stumble over what a failed step left running.
        os._exit(code)

    # Persistent, or loading a file would end the test.
    bpy.app.timers.register(turn, first_interval=1.0, persistent=True)
