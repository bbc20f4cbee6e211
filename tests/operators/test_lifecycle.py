"""Enabling, disabling and enabling again leaves no trace; what is registered keeps Blender's rules."""

import dataclasses
from pathlib import Path

import builders
import extension
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")


@pytest.fixture(autouse=True)
def presets_label(addon, monkeypatch):
    """Blender relabels the class when a preset is executed, saved or removed: the label comes back afterwards."""
    panel = addon.ui.panel.SKINWRIGHT_PT_transfer_presets
    monkeypatch.setattr(panel, "bl_label", panel.bl_label)


def trace():
    """Everything an add-on may leave behind."""
    menus = (
        "VIEW3D_MT_paint_weight",
        "VIEW3D_MT_sculpt",
        "VIEW3D_MT_make_links",
        "MESH_MT_vertex_group_context_menu",
        "VIEW3D_PT_overlay",
    )
    return {
        "types": sorted(set(dir(bpy.types))),
        "operators": sorted(dir(bpy.ops.skinwright)),
        "draw": {name: [str(f) for f in getattr(bpy.types, name).draw._draw_funcs] for name in menus if has_draw(name)},
        "handlers": {
            name: len(value)
            for name in dir(bpy.app.handlers)
            if isinstance(value := getattr(bpy.app.handlers, name), list)
        },
        "properties": [
            sorted(owner.bl_rna.properties.keys())
            for owner in (bpy.types.Scene, bpy.types.Object, bpy.types.WindowManager, bpy.types.Mesh)
        ],
        "presets": bpy.utils.preset_paths("skinwright/transfer_weights"),
        "preferences": "bl_ext.user_default.skinwright" in bpy.context.preferences.addons,
    }


def has_draw(name):
    return hasattr(getattr(bpy.types, name, None), "draw") and hasattr(getattr(bpy.types, name).draw, "_draw_funcs")


def test_enabling_and_disabling_leaves_no_trace(addon):
    extension.disable()
    before = trace()
    for _ in range(3):
        extension.enable()
        assert trace() != before
        extension.disable()
        assert trace() == before
    extension.enable()


@pytest.mark.parametrize("menu", ["VIEW3D_MT_paint_weight", "VIEW3D_MT_make_links"])
def test_menu_entries(addon, menu):
    drawn = getattr(bpy.types, menu).draw._draw_funcs
    assert [f.__module__ for f in drawn].count(f"{addon.__name__}.ui.menus") == 1


def test_the_command_is_taken_away(addon, monkeypatch):
    """Blender has no list of commands to look into: see what is asked of it."""
    taken_away = []
    monkeypatch.setattr(bpy.utils, "register_cli_command", lambda name, function: (name, function))
    monkeypatch.setattr(bpy.utils, "unregister_cli_command", taken_away.append)
    addon.headless.command_line.register()
    addon.headless.command_line.unregister()
    assert taken_away == [("skinwright", addon.headless.command_line.main)]


def skinwright_operators():
    return [getattr(bpy.ops.skinwright, name).get_rna_type() for name in dir(bpy.ops.skinwright)]


def test_names_and_descriptions(addon):
    """Every operator and property says what it is, in a sentence without a full stop."""
    operators = skinwright_operators()
    for rna in operators:
        assert rna.name and rna.description and not rna.description.endswith("."), rna.identifier
    for rna in [*operators, *(cls.bl_rna for cls in addon.settings.CLASSES[:2])]:
        for prop in rna.properties:
            if prop.identifier in ("rna_type", "name") or rna.identifier.endswith("preset_add"):
                continue
            assert prop.name and prop.description and not prop.description.endswith("."), prop.identifier


def test_panel_and_operator_have_the_same_settings(addon):
    operator = bpy.ops.skinwright.transfer_weights.get_rna_type().properties
    panel = bpy.context.scene.skinwright.transfer.bl_rna.properties
    for name in addon.settings.TransferSettings.__annotations__:
        pair = operator[name], panel[name]
        assert len({prop.type for prop in pair}) == len({prop.description for prop in pair}) == 1
        assert pair[0].default == pair[1].default


ENGINES = {"Unity_4": 4, "Unreal_8": 8, "glTF_4": 4, "VRChat_4": 4}


def presets():
    """Path of every preset that comes with the extension, by its name."""
    (folder,) = map(Path, bpy.utils.preset_paths("skinwright/transfer_weights"))
    return {path.stem: path for path in sorted(folder.glob("*.py"))}


def execute_preset(path):
    bpy.ops.script.execute_preset(filepath=str(path), menu_idname="SKINWRIGHT_PT_transfer_presets")


def test_garment_presets_set_what_they_say(addon, scene):
    """Each sets the same settings, so that changing presets leaves nothing of the last one."""
    garments = {name: path for name, path in presets().items() if name not in {*ENGINES, "Default"}}
    assert len(garments) == 5
    seen = set()
    for preset in garments.values():
        names = tuple(line.split("=")[0] for line in preset.read_text().splitlines() if line.startswith("settings."))
        execute_preset(preset)
        seen.add((names, scene.skinwright.transfer.to_params()))
    assert len(seen) == 5 and len({names for names, _ in seen}) == 1


def test_engine_presets_set_the_limit_and_nothing_else(addon, scene):
    execute_preset(presets()["Skirt_or_dress"])
    before = scene.skinwright.transfer.to_params()
    for name, limit in ENGINES.items():
        execute_preset(presets()[name])
        assert scene.skinwright.transfer.to_params() == dataclasses.replace(before, max_influences=limit)


def test_the_default_preset_and_reset_leave_nothing_set(addon, scene):
    settings = scene.skinwright.transfer
    settings.source = body = builders.body()
    for way in (lambda: execute_preset(presets()["Default"]), bpy.ops.skinwright.reset_settings):
        execute_preset(presets()["Skirt_or_dress"])
        settings.max_influences, settings.mix_factor, settings.distance_mode = 3, 0.5, "ABSOLUTE"
        way()
        assert not any(settings.is_property_set(name) for name in addon.settings.TransferSettings.__annotations__)
        assert settings.source == body


def test_the_settings_last_used_are_the_panels(addon, scene):
    """As after F9: preview, mask and check ask for what the weights were made with."""
    settings = scene.skinwright.transfer
    settings.source, settings.mix_factor = builders.body(), 0.5
    coat = builders.grid("Coat", 9, z=0.02)
    builders.select(coat)
    bpy.ops.skinwright.transfer_weights(max_influences=1, island_policy="RIGID")
    assert (settings.max_influences, settings.island_policy) == (1, "RIGID")
    assert settings.mix_factor == 0.5  # was not given
    coat.location.z = 50
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError):
        bpy.ops.skinwright.transfer_weights(max_influences=7)
    assert settings.max_influences == 1  # refused means unchanged


def test_thresholds_alone_mean_the_method_that_has_them(addon, scene):
    """Of scripts and files that were written when there was one method; whoever names a method gets that."""
    settings, read = scene.skinwright.transfer, addon.transfer.from_json
    settings.source = builders.body()
    builders.select(builders.grid("Coat", 9, z=0.02))
    bpy.ops.skinwright.transfer_weights(smoothing_iterations=1)
    assert settings.method == "CONFIDENCE"
    bpy.ops.skinwright.transfer_weights(max_normal_angle=0.5)
    assert settings.method == "PAPER"
    bpy.ops.skinwright.transfer_weights(max_normal_angle=0.5, method="CONFIDENCE")
    assert settings.method == "CONFIDENCE"
    assert read({}).method == "confidence"
    assert read({"relative_max_distance": 0.1}).method == "paper"
    assert read({"relative_max_distance": 0.1, "method": "confidence"}).method == "confidence"


def test_saving_and_removing_a_preset(addon, scene):
    scene.skinwright.transfer.max_influences = 4
    bpy.ops.skinwright.transfer_preset_add(name="Mine")
    files = [
        path for folder in bpy.utils.preset_paths("skinwright/transfer_weights") for path in Path(folder).iterdir()
    ]
    (mine,) = (path for path in files if path.stem == "Mine")
    scene.skinwright.transfer.max_influences = 0
    bpy.ops.script.execute_preset(filepath=str(mine), menu_idname="SKINWRIGHT_PT_transfer_presets")
    assert scene.skinwright.transfer.max_influences == 4
    bpy.ops.skinwright.transfer_preset_add(name="Mine", remove_name=True)
    assert not mine.exists()
