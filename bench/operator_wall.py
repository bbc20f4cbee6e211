"""Times the operator inside Blender against the native call alone, on the benchmark's meshes.

    python bench/operator_wall.py [SIZE ...]     (a Python with bpy and the native module; 20k 100k by default)

60 bones, garments without weights before; medians of five rounds, the two taking turns. The meshes are those that
`bench/meshes.py` keeps in out/bench: make them first where libigl is not installed beside this bpy.
"""

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "support"))
# Before bpy is imported: the user's own preferences stay out of it.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="skinwright-bench-")

import bpy
import extension
import numpy as np
import skinwright_native

CACHE = Path(__file__).resolve().parent.parent / "out" / "bench"
ROUNDS = 5


def load(name: str) -> dict[str, np.ndarray]:
    path = CACHE / f"{name}.npz"
    if not path.exists():
        from meshes import load as make

        make(name)
    with np.load(path) as arrays:
        return dict(arrays)


def make_object(name: str, mesh: dict[str, np.ndarray]) -> bpy.types.Object:
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh["positions"].tolist(), [], mesh["triangles"].tolist())
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    return obj


def make_rig(bones: list[str]) -> bpy.types.Object:
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in bones:
        rig.data.edit_bones.new(bone).tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def csr(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    indptr = np.concatenate([[0], np.cumsum((dense > 0).sum(1))]).astype(np.uint32)
    return indptr, np.nonzero(dense)[1].astype(np.uint32), dense[dense > 0].astype(np.float32)


def measure(size: str) -> str:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    source, target = load("source"), load(size)
    bones = [f"Bone {bone}" for bone in range(source["weights"].shape[1])]
    body, garment = make_object("Body", source), make_object("Garment", target)
    vertex_groups = sys.modules[f"{extension.PACKAGE}.scene.vertex_groups"]
    rows = sys.modules[f"{extension.PACKAGE}.csr"].Rows(*csr(source["weights"]))
    vertex_groups.write(body, bones, rows)
    body.modifiers.new("Armature", "ARMATURE").object = make_rig(bones)
    bpy.context.scene.skinwright.transfer.source = body
    for obj in (body, garment):
        obj.select_set(obj == garment)
    bpy.context.view_layer.objects.active = garment

    weights = skinwright_native.Weights(rows.indptr, rows.bones, rows.values, len(bones))
    arrays = source["positions"], source["triangles"], weights, target["positions"], target["triangles"]
    # The panel's own numbers: Blender keeps them as f32, and 0.05 is another number there.
    settings = bpy.context.scene.skinwright.transfer.to_params().native()
    walls, calls = [], []
    for _ in range(ROUNDS):
        garment.vertex_groups.clear()
        garment.modifiers.clear()
        walls.append(seconds(bpy.ops.skinwright.transfer_weights))
        calls.append(seconds(lambda: skinwright_native.transfer_weights(*arrays, **settings)))
        answer = skinwright_native.transfer_weights(*arrays, **settings).weights
        written = vertex_groups.read(garment, bones)
        assert np.array_equal(written.indptr, answer.indptr) and np.array_equal(written.bones, answer.bones)
        assert np.array_equal(written.values, answer.values)
    wall, call = statistics.median(walls), statistics.median(calls)
    figures = f"{wall * 1e3:.0f} | {call * 1e3:.0f} | {(wall - call) * 1e3:.0f} | {wall / call:.2f}"
    return f"| {len(target['positions'])} | {figures} |"


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main(sizes: list[str]) -> None:
    extension.enable()
    heading = f"Blender {bpy.app.version_string}, vertices"
    print(f"| {heading} | operator ms | native call ms | Blender's part ms | ratio |\n|---|---|---|---|---|")
    for size in sizes:
        print(measure(size), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["20k", "100k"])
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 hangs in Python's ordinary exit once a class was registered
