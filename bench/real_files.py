"""How far seams open: real garments cut into panels, and once through glTF, transferred and posed.

Makes bench/real_files.md. The garments are read from the folder that SKINWRIGHT_DATA names.
"""

import argparse
import importlib
import json
import os
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
POSES = ("arms up", "sit", "squat", "stride")
PANELS = 12


def main() -> None:
    """Measure every garment, or some, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=os.environ.get("SKINWRIGHT_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--only", default="", help="measure the garments whose name holds this")
    parser.add_argument("--out", type=Path, default=ROOT / "bench" / "real_files.md")
    options = parser.parse_args()
    addon = _addon()
    cases = [case for case in json.loads((options.data / "cases.json").read_text()) if options.only in case["id"]]
    rows = [row for case in cases for row in [_measure(addon, options.data, case)] if row]
    options.out.write_text(_table(rows))
    print(options.out)


def _addon():
    sys.path.insert(0, str(ROOT / "addon"))
    addon = importlib.import_module("skinwright")
    addon.register()
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    return addon


def _measure(addon, data: Path, case: dict) -> dict | None:
    """The largest opening (mm) with and without welding, for panels and for a file that was flat-shaded."""
    row = {"garment": case["id"]}
    for kind, split in (("panels", _panels), ("glTF", _through_gltf)):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        source = max(_import(data / case["body"]), key=lambda obj: len(obj.data.vertices))
        garment = split(_welded(_import(data / case["garment"]), case.get("mesh", "")))
        row[f"{kind} vertices"] = len(garment.data.vertices)
        for welded, tolerance in ((False, 0.0), (True, 1e-6)):
            params = addon.transfer.TransferParams(source_scope="ARMATURE", relative_weld_tolerance=tolerance)
            addon.transfer.transfer_weights(bpy.context, source, [garment], params)
            row[f"{kind} {'welded' if welded else 'split'}"] = 1000 * _opening(addon, garment)
    print(row, flush=True)
    return row


def _import(path: Path) -> list[bpy.types.Object]:
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(path))
    made = [obj for obj in bpy.data.objects if obj not in before]
    return [obj for obj in made if obj.type == "MESH" and obj.name in bpy.context.view_layer.objects]


def _welded(objects: list[bpy.types.Object], name: str) -> tuple[np.ndarray, np.ndarray]:
    """World positions (V, 3) and triangles (T, 3) of the objects, or of the one of this name, each place once.

    The objects go.
    """
    positions, triangles, start = [], [], 0
    for obj in [obj for obj in objects if name in ("", obj.name, obj.data.name)] or objects:
        obj.data.calc_loop_triangles()
        world = np.array(obj.matrix_world)
        local = np.array([vertex.co[:] for vertex in obj.data.vertices])
        positions.append(local @ world[:3, :3].T + world[:3, 3])
        triangles.append(np.array([t.vertices[:] for t in obj.data.loop_triangles]) + start)
        start += len(local)
    rigs = {modifier.object for obj in objects for modifier in obj.modifiers if modifier.type == "ARMATURE"}
    for obj in [*objects, *(rig for rig in rigs if rig)]:
        bpy.data.objects.remove(obj)
    places, number = np.unique(np.concatenate(positions).astype(np.float32), axis=0, return_inverse=True)
    faces = number.reshape(-1)[np.concatenate(triangles)]
    return places, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


def _mesh(positions: np.ndarray, triangles: np.ndarray) -> bpy.types.Object:
    data = bpy.data.meshes.new("Garment")
    data.from_pydata(positions.tolist(), [], triangles.tolist())
    obj = bpy.data.objects.new("Garment", data)
    bpy.context.collection.objects.link(obj)
    return obj


def _panels(mesh: tuple[np.ndarray, np.ndarray]) -> bpy.types.Object:
    """Cut between panels: each face belongs to the nearest of some points spread over the garment."""
    positions, triangles = mesh
    centres = positions[triangles].mean(axis=1)
    seeds = [int(centres[:, 2].argmax())]
    while len(seeds) < PANELS:
        seeds.append(int(np.linalg.norm(centres[:, None] - centres[seeds], axis=2).min(axis=1).argmax()))
    panel = np.linalg.norm(centres[:, None] - centres[seeds], axis=2).argmin(axis=1)
    corner = triangles + panel[:, None] * len(positions)
    used, number = np.unique(corner, return_inverse=True)
    return _mesh(positions[used % len(positions)], number.reshape(-1, 3))


def _through_gltf(mesh: tuple[np.ndarray, np.ndarray]) -> bpy.types.Object:
    """Out to a file and in again: flat shading gives every face vertices of its own."""
    obj = _mesh(*mesh)
    bpy.context.view_layer.update()  # else its list holds what is gone
    for other in bpy.context.view_layer.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "garment.glb"
        bpy.ops.export_scene.gltf(filepath=str(path), use_selection=True)
        bpy.data.objects.remove(obj)
        (made,) = _import(path)
    return made


def _opening(addon, garment: bpy.types.Object) -> float:
    """The largest distance in a pose between vertices that lie at one place at rest, world units."""
    rest = np.array([garment.matrix_world @ vertex.co for vertex in garment.data.vertices], np.float32)
    _, first, same = np.unique(rest, axis=0, return_index=True, return_inverse=True)
    twin = first[same.reshape(-1)]
    skeleton = addon.scene.skeleton.read(addon.scene.armature.rigs(garment))
    largest = 0.0
    for pose in addon.check.poses.whole_body(skeleton, addon.check.body_plan.find(skeleton)):
        if pose.name in POSES:
            addon.scene.poses.take(garment, skeleton.names, pose.pose_from_rest)
            shown = garment.evaluated_get(bpy.context.evaluated_depsgraph_get())
            now = np.array([shown.matrix_world @ vertex.co for vertex in shown.data.vertices])
            largest = max(largest, float(np.linalg.norm(now - now[twin], axis=1).max()))
    for bone in addon.scene.armature.rigs(garment)[0].pose.bones:
        bone.matrix_basis.identity()
        bone.location, bone.rotation_quaternion, bone.scale = (0, 0, 0), (1, 0, 0, 0), (1, 1, 1)
    bpy.context.view_layer.update()
    return largest


def _table(rows: list[dict]) -> str:
    head = (
        "# How far seams open\n\n"
        f"Largest distance in millimetres, in the poses {', '.join(POSES)}, between vertices that lie at one place at\n"
        "rest. *split* solves the file as it is, *welded* is what the add-on does. Made by `make real-files`.\n\n"
        "| garment | vertices in panels | split | welded | vertices through glTF | split | welded |\n"
        "| --- | --- | --- | --- | --- | --- | --- |\n"
    )
    body = "".join(
        f"| {row['garment']} | {row['panels vertices']} | {row['panels split']:.0f} | {row['panels welded']:.3f} "
        f"| {row['glTF vertices']} | {row['glTF split']:.0f} | {row['glTF welded']:.3f} |\n"
        for row in rows
    )
    kinds = [f"{kind} {how}" for kind in ("panels", "glTF") for how in ("split", "welded")]
    worst = {kind: max(row[kind] for row in rows) for kind in kinds}
    return (
        head
        + body
        + (
            f"| **worst** | | {worst['panels split']:.0f} | {worst['panels welded']:.3f} "
            f"| | {worst['glTF split']:.0f} | {worst['glTF welded']:.3f} |\n"
        )
    )


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
