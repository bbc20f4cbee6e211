"""What artists do around sessions, long work and previews: other data, scenes, windows, views, files, undo."""

import os
import sys
import tempfile
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy
import dress
import sessions
from driver import EXTENSION, Steps, Window, disable, enable, start, until
from painting import begin_painting, look, painting
from sculpting import begin, character, positions, session
from sessions import LATER, brushes, click, left_nothing, modal, nothing_is_left, sculpted, state


def part(name: str):
    """A module of the add-on."""
    return import_module(f"{EXTENSION}.{name}")


def said() -> str:
    """The last result in the panel, with its warnings."""
    last = part("reporting").last
    return " ".join((last.sentence, *last.warnings)) if last else ""


def operator(window: Window, name: str, *arguments, **options) -> set[str]:
    """One of Blender's, as a menu calls it."""
    with window.context():
        module, function = name.split(".")
        return getattr(getattr(bpy.ops, module), function)("EXEC_DEFAULT", True, *arguments, **options)


def mode(window: Window, name: str) -> Steps:
    operator(window, "object.mode_set", mode=name)
    window.event("MOUSEMOVE")
    yield 0.2


def a_copy_made_meanwhile_is_no_session(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window)
    yield from mode(window, "OBJECT")
    operator(window, "object.duplicate")
    bpy.context.view_layer.objects.active = bpy.data.objects["Body"]
    yield from mode(window, "SCULPT")
    assert session()
    click(window, keep=True)
    yield from left_nothing(window)
    assert "Body.001" in bpy.data.objects
    kept = state()
    bpy.data.objects["Body"].location.x = 1
    operator(window, "ed.undo_push", message="Move")
    window.key("Z", ctrl=True)
    yield 0.8
    assert state() == kept and bpy.data.objects["Body"].location.x == 0
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare and nothing_is_left())


def a_marked_object_from_another_file(window: Window) -> Steps:
    """Such as a file that Blender has saved by itself in the middle of a session."""
    bare = state()
    copy = bpy.data.objects["Body"].copy()
    copy.data, copy.name = copy.data.copy(), "Foreign"
    bpy.context.collection.objects.link(copy)
    copy.skinwright.sculpting = copy.skinwright.painting = True
    path = os.path.join(tempfile.mkdtemp(), "foreign.blend")
    bpy.data.libraries.write(path, {copy})
    bpy.data.objects.remove(copy)
    for number in range(3):
        bpy.data.objects["Body"].location.x = number
        operator(window, "ed.undo_push", message="Move")
    operator(window, "wm.append", filepath=f"{path}/Object/Foreign", directory=f"{path}/Object/", filename="Foreign")
    assert bpy.data.objects["Foreign"].skinwright.sculpting, "the mark has not come along, so nothing is tried"
    bpy.data.objects["Body"].location.x = 3
    operator(window, "ed.undo_push", message="Move")
    window.key("Z", ctrl=True)
    yield 1.0
    assert bpy.data.objects["Body"].location.x == 2 and "Foreign" in bpy.data.objects, "undo went too far"
    bpy.context.view_layer.objects.active = bpy.data.objects["Body"]
    yield from begin(window, size=40)
    window.key("ESC")
    yield from until(lambda: not brushes())
    assert state() == bare
    bpy.data.objects.remove(bpy.data.objects["Foreign"])
    yield from left_nothing(window)


def a_mesh_of_two_objects(window: Window) -> Steps:
    bare = state()
    twin = bpy.data.objects["Body"].copy()
    twin.name, twin.location.x = "Twin", 1.5
    bpy.context.collection.objects.link(twin)
    operator(window, "ed.undo_push", message="Twin")
    yield from sculpted(window)
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare == state("Twin")
    yield from sculpted(window)
    click(window, keep=True)
    yield from left_nothing(window)
    assert state()[1] != bare[1] and state() == state("Twin") and state()[2] == bare[2]
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == bare == state("Twin"))


def linked_and_overridden(window: Window) -> Steps:
    path = os.path.join(tempfile.mkdtemp(), "library.blend")
    bpy.data.libraries.write(path, {bpy.data.objects["Body"], bpy.data.objects["Rig"]})
    for name in ("Body", "Rig"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects = ["Body", "Rig"]
    linked = bpy.data.objects["Body"]
    for obj in (linked, bpy.data.objects["Rig"]):
        bpy.context.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = linked
    yield 0.2
    yield from refused(window, "linked from")
    override = linked.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
    for obj in [obj for obj in bpy.context.view_layer.objects if obj.library]:
        bpy.context.collection.objects.unlink(obj)
    body = next(obj for obj in bpy.data.objects if obj.name == "Body" and obj.library is None)
    assert override and body.override_library
    bpy.context.view_layer.objects.active = body
    yield 0.2
    yield from refused(window, "Body")
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    yield from left_nothing(window)


def refused(window: Window, why: str) -> Steps:
    with window.context():
        try:
            outcome = bpy.ops.skinwright.sculpt_weights("INVOKE_DEFAULT")
        except RuntimeError as error:
            outcome = str(error)
    assert why in str(outcome) or (outcome == {"CANCELLED"} and why in said()), (outcome, said())
    window.event("MOUSEMOVE")
    yield 0.3
    window.key("ESC")
    yield from left_nothing(window)


def the_scene_is_left(window: Window) -> Steps:
    """The session waits; it can be kept from there, or gone on with."""
    bare, first = state(), bpy.context.scene.name
    bpy.data.scenes.new("Other")
    operator(window, "ed.undo_push", message="Other scene")
    for kept_from_there in (True, False):
        yield from sculpted(window)
        window.window.scene = bpy.data.scenes["Other"]
        window.event("MOUSEMOVE")
        yield 0.6
        if kept_from_there:
            click(window, keep=True)
            yield from until(nothing_is_left)
            assert bpy.data.objects["Body"].mode == "OBJECT", "left under the brush in the other scene"
        window.window.scene = bpy.data.scenes[first]
        window.event("MOUSEMOVE")
        yield 0.5
        assert (brushes() is not None) == (bpy.data.objects["Body"].mode == "SCULPT"), said()
        if not kept_from_there:
            yield from window.stroke(LATER, settle=0.05)
            yield from until(lambda: session().stroke_count == 2)
            window.key("RET")
        yield from left_nothing(window)
        assert state()[2] == bare[2] and state()[1] != bare[1]
        window.key("Z", ctrl=True)
        yield from until(lambda: state() == bare and nothing_is_left())
    bpy.data.scenes.remove(bpy.data.scenes["Other"])


def painting_and_another_scene(window: Window) -> Steps:
    yield from a_dress(window)
    bare, first = state("Dress"), bpy.context.scene
    other = bpy.data.scenes.new("Other")
    yield from begin_painting(window)
    window.window.scene = other
    window.event("MOUSEMOVE")
    yield from until(nothing_is_left)
    window.window.scene = first
    yield 0.3
    assert bpy.data.objects["Dress"].mode == "OBJECT", "left under the brush in the other scene"
    assert first.skinwright.overlay.kind == other.skinwright.overlay.kind == "NONE", "the overlay stays on"
    window.event("MOUSEMOVE")
    window.key("Z", ctrl=True)
    yield from until(lambda: state("Dress") == bare and nothing_is_left())
    for scene in [scene for scene in bpy.data.scenes if scene.name == "Other"]:
        bpy.data.scenes.remove(scene)


def undo_right_after_painting_began(window: Window) -> Steps:
    yield from a_dress(window)
    yield from begin_painting(window)
    window.key("RET")
    yield from until(nothing_is_left)
    obj = bpy.data.objects["Dress"]
    obj.vertex_groups.active = obj.vertex_groups[obj.skinwright.mask_group]
    operator(window, "ed.undo_push", message="Mask is active")
    bare = state("Dress")
    bpy.context.scene.skinwright.transfer.softness = 3
    bpy.context.scene.skinwright.transfer.relative_max_distance = 0.01
    yield from begin_painting(window)
    assert state("Dress") != bare, "nothing was solved"
    window.key("Z", ctrl=True)
    window.event("MOUSEMOVE")
    yield from until(nothing_is_left)
    assert state("Dress") == bare


def a_dress(window: Window) -> Steps:
    _, figure, _ = dress.build(900)
    bpy.context.scene.skinwright.transfer.source = figure
    look(window)
    operator(window, "ed.undo_push", message="Scene")
    yield 0.4


def hidden_objects(window: Window) -> Steps:
    bare = state()
    bpy.data.objects["Body"].hide_set(True)
    yield 0.2
    with window.context():
        assert not bpy.ops.skinwright.sculpt_weights.poll(), "the brush cannot be on a hidden mesh"
    bpy.data.objects["Body"].hide_set(False)
    operator(window, "ed.undo_push", message="Shown")
    yield 0.2
    yield from sculpted(window)
    yield from mode(window, "OBJECT")
    bpy.data.objects["Body"].hide_set(True)
    operator(window, "ed.undo_push", message="Hide")
    window.event("MOUSEMOVE")
    yield 0.3
    assert session()
    click(window, keep=False)
    yield from left_nothing(window)
    assert state() == bare, said()
    bpy.data.objects["Body"].hide_set(False)


def local_view(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window)
    operator(window, "view3d.localview")
    window.event("MOUSEMOVE")
    yield 0.4
    yield from window.stroke(LATER, settle=0.05)
    yield from until(lambda: session().stroke_count == 2)
    operator(window, "view3d.localview")
    window.event("MOUSEMOVE")
    yield 0.4
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare


def tab_into_edit_mode(window: Window) -> Steps:
    bare = state()
    yield from sculpted(window)
    window.key("TAB")
    yield 0.6
    if bpy.context.mode != "EDIT_MESH":
        yield from mode(window, "EDIT")
    yield from until(nothing_is_left)
    assert bpy.context.mode in ("EDIT_MESH", "OBJECT") and "kept" in said(), (bpy.context.mode, said())
    if bpy.context.mode == "EDIT_MESH":
        yield from mode(window, "OBJECT")
    assert state()[2] == bare[2] and state()[1] != bare[1]
    for _ in range(8):
        window.key("Z", ctrl=True)
        yield 0.5
        if state() == bare:
            break
    yield from until(lambda: state() == bare and nothing_is_left())
    assert bpy.context.mode == "OBJECT"


def storms_around_keep(window: Window) -> Steps:
    bare = state()
    for pause in (0.0, 0.06):
        yield from sculpted(window, 2)
        window.key("RET")
        for _ in range(4):
            window.key("Z", ctrl=True)
            yield pause
        yield from until(nothing_is_left)
        yield 0.8
        for _ in range(12):
            window.key("Z", ctrl=True, shift=True)
            yield pause
        yield 1.0
        yield from until(nothing_is_left)
        assert bpy.context.mode == "OBJECT" and positions().tobytes() == bare[2]
        kept = state()
        assert kept[1] != bare[1]
        window.key("Z", ctrl=True)
        yield from until(lambda: state() == bare and nothing_is_left())
        window.key("Z", ctrl=True, shift=True)
        yield from until(lambda kept=kept: state() == kept and nothing_is_left())
        window.key("Z", ctrl=True)
        yield from until(lambda: state() == bare and nothing_is_left())


def reverted(window: Window) -> Steps:
    bare = state()
    path = os.path.join(tempfile.mkdtemp(), "revert.blend")
    operator(window, "wm.save_as_mainfile", filepath=path)
    yield from sculpted(window)
    with window.context():
        bpy.ops.wm.revert_mainfile("EXEC_DEFAULT", use_scripts=False)
    yield 1.0
    yield from left_nothing(window)
    assert state() == bare
    look(window)
    yield from sculpted(window)
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare


def appended_meanwhile(window: Window) -> Steps:
    bare = state()
    path = os.path.join(tempfile.mkdtemp(), "prop.blend")
    prop = bpy.data.objects.new("Prop", bpy.data.meshes.new("Prop"))
    bpy.data.libraries.write(path, {prop})
    bpy.data.objects.remove(prop)
    yield from sculpted(window)
    yield from mode(window, "OBJECT")
    operator(window, "wm.append", filepath=f"{path}/Object/Prop", directory=f"{path}/Object/", filename="Prop")
    window.event("MOUSEMOVE")
    yield 0.4
    assert session(), said()
    bpy.context.view_layer.objects.active = bpy.data.objects["Body"]
    yield from mode(window, "SCULPT")
    yield from window.stroke(LATER, settle=0.05)
    yield from until(lambda: session().stroke_count == 2)
    window.key("ESC")
    yield from left_nothing(window)
    assert state() == bare


def disabled_while_painting(window: Window) -> Steps:
    yield from a_dress(window)
    yield from begin_painting(window)
    assert painting()
    disable()
    yield 0.5
    assert bpy.context.mode == "OBJECT", "the artist is left in Weight Paint mode"
    assert not modal()
    enable()
    yield 0.3
    yield from left_nothing(window)


def limb(window: Window) -> Steps:
    """Refined while it is posed."""
    from live_refine import build, only

    obj, rig, sleeve = build()
    bpy.data.objects.remove(sleeve)
    bpy.context.view_layer.update()
    rig.pose.bones["Lower"].rotation_euler[2] = 1.5
    only(obj)
    look(window)
    operator(window, "ed.undo_push", message="Scene")
    yield 0.3


def preview() -> list[bpy.types.Object]:
    """Its stand-ins."""
    return [obj for obj in bpy.data.objects if "skinwright_preview_of" in obj]


def a_preview_in_views_and_renders(window: Window) -> Steps:
    yield from limb(window)
    scene, obj = bpy.context.scene, bpy.data.objects["Limb"]
    second = scene.view_layers.new("Second")
    other = bpy.data.scenes.new("Other")
    other.collection.objects.link(obj)
    obj.hide_set(True, view_layer=second)
    operator(window, "view3d.localview")
    yield 0.3
    operator(window, "skinwright.live_refine")
    yield 0.4
    (stand_in,) = preview()
    view = window.area.spaces.active
    with window.context():
        # In 4.3 the original objects do not know.
        evaluated = stand_in.evaluated_get(bpy.context.evaluated_depsgraph_get())
    assert view.local_view and evaluated.visible_in_viewport_get(view), "not in the local view"
    assert obj.hide_get(view_layer=other.view_layers[0]), "both are shown in the other scene"
    operator(window, "view3d.localview")
    assert stand_in.hide_render and not obj.hide_render, "rendered twice"
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.filepath = os.path.join(tempfile.mkdtemp(), "frame")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera, scene.frame_end = camera, 6
    bone = bpy.data.objects["Rig"].pose.bones["Lower"]
    for frame, angle in ((1, 0.0), (6, 1.5)):
        bone.rotation_euler[2] = angle
        bone.keyframe_insert("rotation_euler", frame=frame)
    for animation in (False, True):
        with window.context():
            bpy.ops.render.render("INVOKE_DEFAULT", animation=animation)
        yield from until(lambda: bpy.app.is_job_running("RENDER"), 5)
        yield from until(lambda: not bpy.app.is_job_running("RENDER"), 60)
        yield 0.5
    for extra in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=extra):
            bpy.ops.wm.window_close()
    yield 0.5
    assert part("refine.live").current, said()
    scene.frame_set(4)
    yield 0.5
    assert part("refine.live").current and len(preview()) == 1, said()
    window.window.scene = other
    yield 0.4
    operator(window, "skinwright.live_refine")
    assert not preview() and not part("refine.live").current
    assert not obj.hide_get(view_layer=scene.view_layers[0]) and not obj.hide_get(view_layer=other.view_layers[0])
    assert obj.hide_get(view_layer=second), "hidden by the artist, shown by the preview"
    window.window.scene = scene
    bpy.data.scenes.remove(other)
    yield 0.3


def a_preview_that_loses_its_objects(window: Window) -> Steps:
    for how in ("stand-in", "rig", "rename", "undo to before", "disable"):
        yield from limb(window)
        operator(window, "skinwright.live_refine")
        yield 0.3
        assert len(preview()) == 1
        if how == "stand-in":
            bpy.data.objects.remove(preview()[0])
        elif how == "rig":
            bpy.data.objects.remove(bpy.data.objects["Rig"])
        elif how == "rename":
            bpy.data.objects["Limb"].name = "Arm"
        elif how == "undo to before":
            for _ in range(4):
                with window.context():
                    if bpy.ops.ed.undo.poll():
                        bpy.ops.ed.undo()
                yield 0.2
        else:
            disable()
            yield 0.4
            enable()
        bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
        rig = bpy.data.objects.get("Rig")
        if rig and "Lower" in rig.pose.bones:
            rig.pose.bones["Lower"].rotation_euler[2] = 0.5
        window.event("MOUSEMOVE")
        yield 0.6
        running = part("refine.live").current
        assert len(preview()) == (running is not None), (how, said())
        names = [obj.name for obj in bpy.data.objects if obj.type == "MESH" and obj not in preview()]
        assert all(bpy.data.objects[name].visible_get() != bool(running) for name in names), (how, said())
        assert running or how in ("undo to before", "disable") or "preview" in said(), (how, said())
        if running:
            operator(window, "skinwright.live_refine")
        assert not preview()


def heavy(window: Window) -> Steps:
    """A transfer that takes some seconds, under way."""
    _, figure, garment = dress.build(60_000, 30)
    bpy.context.scene.skinwright.transfer.source = figure
    bpy.context.scene.skinwright.transfer.smoothing_iterations = 150
    figure.display_type = garment.display_type = "BOUNDS"
    operator(window, "ed.undo_push", message="Scene")
    yield 0.3
    yield from heavy_again(window)


def heavy_again(window: Window) -> Steps:
    with window.context():
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    assert part("jobs").running
    yield 0.1


def long_work_and_files(window: Window) -> Steps:
    path = os.path.join(tempfile.mkdtemp(), "heavy.blend")
    yield from heavy(window)
    operator(window, "wm.save_as_mainfile", filepath=path)
    yield from until(lambda: part("jobs").running is None, 90)
    assert bpy.data.objects["Dress"].vertex_groups, said()
    window.event("MOUSEMOVE")
    window.key("Z", ctrl=True)
    yield from until(lambda: not bpy.data.objects["Dress"].vertex_groups)
    yield from heavy_again(window)
    with window.context():
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    yield 1.0
    assert part("jobs").running is None and nothing_is_left(), modal()
    assert not bpy.data.objects["Dress"].vertex_groups
    operator(window, "ed.undo_push", message="Loaded")
    yield from heavy_again(window)
    with window.context():
        bpy.ops.ed.undo()
    yield from until(lambda: part("jobs").running is None, 90)
    yield 0.3
    window.key("ESC")
    yield 0.3
    assert nothing_is_left(), modal()


def a_second_window_in_long_work(window: Window) -> Steps:
    yield from heavy(window)
    part("jobs").running.cancel()
    yield from until(lambda: part("jobs").running is None)
    with window.context():
        bpy.ops.wm.window_new()
    yield 0.8
    second = bpy.context.window_manager.windows[1]
    area = max(second.screen.areas, key=lambda area: area.width * area.height)
    area.type = "VIEW_3D"
    yield 0.5
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=second, screen=second.screen, area=area, region=region):
        assert bpy.ops.skinwright.transfer_weights("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    runner = part("jobs").running
    yield 0.1
    with window.context():
        for name in ("transfer_weights", "sculpt_weights", "paint_match_mask", "desparsify", "live_refine"):
            assert not getattr(bpy.ops.skinwright, name).poll(), f"{name} beside other work"
    with bpy.context.temp_override(window=second, screen=second.screen, area=area, region=region):
        bpy.ops.wm.window_close()
    yield from until(lambda: len(bpy.context.window_manager.windows) == 1)
    yield 0.5
    assert part("jobs").running is None and runner.done and nothing_is_left(), modal()
    assert not bpy.data.objects["Dress"].vertex_groups
    with window.context():
        assert bpy.ops.skinwright.transfer_weights.poll()


def keys(name: str = "Limb") -> list[str]:
    """Its shape keys, and whether a cache plays."""
    obj = bpy.data.objects[name]
    blocks = obj.data.shape_keys.key_blocks if obj.data.shape_keys else []
    return [key.name for key in blocks] + [modifier.name for modifier in obj.modifiers]


def baking_is_stopped_and_undone(window: Window) -> Steps:
    yield from limb(window)
    bare = keys()
    folder = tempfile.mkdtemp()
    path = os.path.join(folder, "limb.pc2")
    for name, options in (("bake_correctives", {}), ("bake_refined_cache", {"filepath": path, "frame_end": 8})):
        with window.context():
            assert getattr(bpy.ops.skinwright, name)("INVOKE_DEFAULT", True, **options) == {"RUNNING_MODAL"}
        window.key("ESC")
        yield from until(lambda: part("jobs").running is None, 60)
        yield 0.3
        assert keys() == bare and not os.listdir(folder), "stopped, and something was written"
        with window.context():
            assert getattr(bpy.ops.skinwright, name)("INVOKE_DEFAULT", True, **options) == {"RUNNING_MODAL"}
        yield from until(lambda: part("jobs").running is None, 120)
        yield 0.4
        baked = keys()
        assert baked != bare, said()
        remove = name.replace("bake", "remove")
        operator(window, f"skinwright.{remove}")
        window.event("MOUSEMOVE")
        yield 0.3
        assert [key for key in keys() if key != "Basis"] == bare, (keys(), bare)
        window.key("Z", ctrl=True)
        yield from until(lambda baked=baked: keys() == baked)
        window.key("Z", ctrl=True)
        yield from until(lambda: keys() == bare)


def embedding_is_stopped_and_undone(window: Window) -> Steps:
    armature, _, garment = dress.build(5_000, 4)
    bpy.context.scene.skinwright.retarget.source = armature
    garment.modifiers.clear()
    garment.location.x = 1.5
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == garment)
    bpy.context.view_layer.objects.active = garment
    look(window)
    operator(window, "ed.undo_push", message="Scene")
    yield 0.3
    names = sorted(obj.name for obj in bpy.data.objects)
    with window.context():
        assert bpy.ops.skinwright.embed_armature("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    window.key("ESC")
    yield from until(lambda: part("jobs").running is None, 60)
    yield 0.3
    assert sorted(obj.name for obj in bpy.data.objects) == names
    with window.context():
        assert bpy.ops.skinwright.embed_armature("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield from until(lambda: part("jobs").running is None, 120)
    yield 0.4
    assert len(bpy.data.objects) == len(names) + 1, said()
    window.event("MOUSEMOVE")
    window.key("Z", ctrl=True)
    yield from until(lambda: sorted(obj.name for obj in bpy.data.objects) == names)
    assert not bpy.data.objects["Dress"].modifiers and bpy.data.objects["Dress"].parent is None


def disabled_in_long_work(window: Window) -> Steps:
    yield from heavy(window)
    runner, timers = part("jobs").running, part("operators.modal.timers")._running
    assert timers
    disable()
    yield 0.5
    assert not timers and not modal(), modal()
    assert runner.done and not bpy.data.objects["Dress"].vertex_groups, "the work goes on without the add-on"
    enable()
    yield 0.3
    assert part("jobs").running is None
    yield from left_nothing(window)
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    character(window, 900)
    yield 0.5


def undo_of_stored_weights(window: Window) -> Steps:
    bare = state()
    operator(window, "skinwright.store_weights")
    body = bpy.data.objects["Body"]
    body.vertex_groups["Spine.2"].remove(range(len(body.data.vertices)))
    operator(window, "ed.undo_push", message="Damage")
    damaged = state()
    assert damaged != bare
    number = len(part("stored.keeping").entries(body))
    operator(window, "skinwright.restore_weights")
    yield 0.2
    assert state() == bare, said()
    window.event("MOUSEMOVE")
    window.key("Z", ctrl=True)
    yield from until(lambda: state() == damaged)
    assert len(part("stored.keeping").entries(bpy.data.objects["Body"])) == number
    window.key("Z", ctrl=True, shift=True)
    yield from until(lambda: state() == bare)
    for _ in range(3):
        window.key("Z", ctrl=True)
        yield 0.4
    assert state() == bare and not part("stored.keeping").entries(bpy.data.objects["Body"])


SCENARIOS = (
    a_copy_made_meanwhile_is_no_session,
    a_marked_object_from_another_file,
    a_mesh_of_two_objects,
    the_scene_is_left,
    painting_and_another_scene,
    undo_right_after_painting_began,
    hidden_objects,
    local_view,
    tab_into_edit_mode,
    storms_around_keep,
    reverted,
    appended_meanwhile,
    undo_of_stored_weights,
    a_preview_in_views_and_renders,
    a_preview_that_loses_its_objects,
    disabled_while_painting,
    long_work_and_files,
    baking_is_stopped_and_undone,
    embedding_is_stopped_and_undone,
    disabled_in_long_work,
    linked_and_overridden,
    a_second_window_in_long_work,  # the last, as keys may not reach the first window after it
)


def steps(window: Window) -> Steps:
    yield 0.5
    enable()
    yield from sessions.attempt_all(window, SCENARIOS)


if __name__ == "__main__":
    start(steps)
