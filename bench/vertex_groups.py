"""Times reading and writing vertex groups, ours against Blender's public API alone, in nanoseconds a vertex.

    python bench/vertex_groups.py [VERTICES ...]      (a Python with bpy; 10000 100000 1000000 by default)

60 groups, 4 influences a vertex; medians of five rounds, the ways taking turns, answers checked equal first.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "addon"))

import bmesh  # there only once bpy is loaded
import bpy
import numpy as np
from skinwright.csr import Rows
from skinwright.scene import deform_array, vertex_groups

GROUPS, INFLUENCES, ROUNDS, CHANGED = 60, 4, 5, 2000
NAMES = [f"Bone.{bone:03d}" for bone in range(GROUPS)]
open_array = deform_array.open_array


def make_object(n: int) -> bpy.types.Object:
    mesh = bpy.data.meshes.new("Garment")
    mesh.vertices.add(n)
    obj = bpy.data.objects.new("Garment", mesh)
    bpy.context.collection.objects.link(obj)
    return obj


def make_rows(n: int, seed: int, shift: int = 0) -> Rows:
    """Neighbouring vertices share bones, as on a body; `shift` moves every vertex to other bones."""
    first = np.arange(n) * GROUPS // n + shift
    bones = np.sort((first[:, None] + np.array([0, 1, 7, 13])) % GROUPS, axis=1).astype(np.uint32)
    values = np.random.default_rng(seed).random((n, INFLUENCES), np.float32) + np.float32(0.01)
    values /= values.sum(1, keepdims=True)
    indptr = np.arange(n + 1, dtype=np.uint32) * INFLUENCES
    return Rows(indptr, bones.ravel(), values.ravel())


def read_by_bmesh(obj: bpy.types.Object) -> None:
    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    layer = mesh.verts.layers.deform.active
    [vertex[layer].items() for vertex in mesh.verts]
    mesh.free()


def write_by_bmesh(obj: bpy.types.Object, rows: Rows) -> None:
    vertex_groups.ensure(obj, NAMES)
    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    layer = mesh.verts.layers.deform.verify()
    bones, values = (array.reshape(-1, INFLUENCES).tolist() for array in (rows.bones, rows.values))
    for vertex, row, weights in zip(mesh.verts, bones, values, strict=True):
        influences = vertex[layer]
        influences.clear()
        for bone, weight in zip(row, weights, strict=True):
            influences[bone] = weight
    mesh.to_mesh(obj.data)
    mesh.free()


def by_api(work: Callable[[], object]) -> object:
    """The same with the memory views refused, as on a Blender they do not fit."""
    deform_array.open_array = lambda mesh, indices: None
    try:
        return work()
    finally:
        deform_array.open_array = open_array


def seconds(work: Callable[[], object], prepare: Callable[[], object]) -> float:
    prepare()
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def measure(n: int) -> dict[str, dict[str, float]]:
    """Task -> way -> median seconds."""
    obj = make_object(n)
    rows, others, moved = make_rows(n, 0), make_rows(n, 1), make_rows(n, 2, shift=1)
    some = np.sort(np.random.default_rng(3).choice(n, min(CHANGED, n), replace=False))
    patch = make_rows(len(some), 4)
    check_equal(obj, rows, others)

    def clear() -> None:
        obj.vertex_groups.clear()

    def filled() -> None:
        clear()
        vertex_groups.write(obj, NAMES, rows)

    tasks = {
        "read all": (filled, lambda: vertex_groups.read(obj, NAMES), lambda: read_by_bmesh(obj)),
        "write all, none before": (
            clear,
            lambda: vertex_groups.write(obj, NAMES, rows),
            lambda: write_by_bmesh(obj, rows),
        ),
        "write all, same bones": (
            filled,
            lambda: vertex_groups.write(obj, NAMES, others),
            lambda: write_by_bmesh(obj, others),
        ),
        "write all, other bones": (
            filled,
            lambda: vertex_groups.write(obj, NAMES, moved),
            lambda: write_by_bmesh(obj, moved),
        ),
        f"write {CHANGED}, same bones": (
            filled,
            lambda: vertex_groups.write(obj, NAMES, patch_of(rows, some), some),
            None,
        ),
        f"write {CHANGED}, any bones": (filled, lambda: vertex_groups.write(obj, NAMES, patch, some), None),
    }
    result = {}
    for task, (prepare, ours, peer) in tasks.items():
        ways = {"ours": ours, "public API": lambda ours=ours: by_api(ours)} | ({"bmesh": peer} if peer else {})
        rounds = ROUNDS if n <= 200_000 else 3
        times = {way: [] for way in ways}
        for _ in range(rounds):
            for way, work in ways.items():
                times[way].append(seconds(work, prepare))
        result[task] = {way: statistics.median(values) for way, values in times.items()}
    mesh = obj.data
    bpy.data.objects.remove(obj)
    bpy.data.meshes.remove(mesh)
    return result


def patch_of(rows: Rows, some: np.ndarray) -> Rows:
    """The rows of some vertices with their values turned round."""
    bones = rows.bones.reshape(-1, INFLUENCES)[some]
    values = rows.values.reshape(-1, INFLUENCES)[some, ::-1]
    return Rows(np.arange(len(some) + 1, dtype=np.uint32) * INFLUENCES, bones.ravel(), values.ravel())


def check_equal(obj: bpy.types.Object, rows: Rows, others: Rows) -> None:
    for wanted in (rows, others):
        for way in (lambda work: work(), by_api):
            way(lambda wanted=wanted: vertex_groups.write(obj, NAMES, wanted))
            for read_way in (lambda work: work(), by_api):
                got = read_way(lambda: vertex_groups.read(obj, NAMES))
                assert all(np.array_equal(a, b) for a, b in zip(got, wanted, strict=True))


def main(sizes: list[int]) -> None:
    trusted = "memory views in use" if deform_array.find_layout() else "memory views refused"
    print(f"\nBlender {bpy.app.version_string}, numpy {np.__version__}, {trusted}\n")
    print("| task | vertices | ours ms | ours ns/v | public API ns/v | bmesh ns/v |\n|---|---|---|---|---|---|")
    for n in sizes:
        for task, ways in measure(n).items():
            of = min(CHANGED, n) if task.startswith(f"write {CHANGED}") else n
            cells = [f"{ways[way] / of * 1e9:.0f}" if way in ways else "" for way in ("ours", "public API", "bmesh")]
            print(f"| {task} | {n} | {ways['ours'] * 1e3:.1f} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main([int(size) for size in sys.argv[1:]] or [10_000, 100_000, 1_000_000])
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 hangs in Python's ordinary exit once a class was registered
