"""Times reading and writing vertex groups, ours against Blender's public API alone, in nanoseconds a vertex.

    python bench/vertex_groups.py [VERTICES ...]      (a Python with bpy; 10000 100000 1000000 by default)

60 groups, 4 influences a vertex; medians of five rounds, the ways taking turns, answers checked equal first.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "addon"))

import bpy
import numpy as np
from numpy.typing import NDArray
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
    return Rows(row_starts(n), bones.ravel(), values.ravel())


def row_starts(n: int) -> NDArray[np.uint32]:
    return (np.arange(n + 1) * INFLUENCES).astype(np.uint32)


def read_by_bmesh(obj: bpy.types.Object) -> None:
    import bmesh  # there only once bpy is loaded

    mesh = bmesh.new()
    mesh.from_mesh(obj.data)
    layer = mesh.verts.layers.deform.active
    [vertex[layer].items() for vertex in mesh.verts]
    mesh.free()


def write_by_bmesh(obj: bpy.types.Object, rows: Rows) -> None:
    import bmesh

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


@contextmanager
def public_api_only() -> Iterator[None]:
    """With the memory views refused, as on a Blender they do not fit."""
    deform_array.open_array = lambda mesh, indices: None
    try:
        yield
    finally:
        deform_array.open_array = open_array


WAYS: dict[str, Callable[[], AbstractContextManager]] = {"ours": nullcontext, "public API": public_api_only}


@dataclass(frozen=True)
class Task:
    """`prepare` is not timed; `bmesh` is Blender's other way, where it has one."""

    name: str
    n_vertices: int
    prepare: Callable[[], object]
    ours: Callable[[], object]
    bmesh: Callable[[], object] | None = None


def make_tasks(obj: bpy.types.Object) -> list[Task]:
    n = len(obj.data.vertices)
    rows, others, moved = make_rows(n, 0), make_rows(n, 1), make_rows(n, 2, shift=1)
    check_equal(obj, rows, others)
    some = np.sort(np.random.default_rng(3).choice(n, min(CHANGED, n), replace=False))
    same, patch = patch_of(rows, some), make_rows(len(some), 4)

    def clear() -> None:
        obj.vertex_groups.clear()

    def fill() -> None:
        clear()
        vertex_groups.write(obj, NAMES, rows)

    def task(name: str, prepare: Callable[[], object], new: Rows) -> Task:
        ours = partial(vertex_groups.write, obj, NAMES, new)
        return Task(name, n, prepare, ours, partial(write_by_bmesh, obj, new))

    return [
        Task("read all", n, fill, partial(vertex_groups.read, obj, NAMES), partial(read_by_bmesh, obj)),
        task("write all, none before", clear, rows),
        task("write all, same bones", fill, others),
        task("write all, other bones", fill, moved),
        Task("write some, same bones", len(some), fill, partial(vertex_groups.write, obj, NAMES, same, some)),
        Task("write some, any bones", len(some), fill, partial(vertex_groups.write, obj, NAMES, patch, some)),
    ]


def seconds(work: Callable[[], object], task: Task, way: Callable[[], AbstractContextManager]) -> float:
    task.prepare()
    with way():
        start = time.perf_counter()
        work()
        return time.perf_counter() - start


def measure(task: Task) -> dict[str, float]:
    """Way -> median seconds."""
    times: dict[str, list[float]] = {}
    for _ in range(ROUNDS if task.n_vertices <= 200_000 else 3):
        for name, way in WAYS.items():
            times.setdefault(name, []).append(seconds(task.ours, task, way))
        if task.bmesh:
            times.setdefault("bmesh", []).append(seconds(task.bmesh, task, nullcontext))
    return {name: statistics.median(values) for name, values in times.items()}


def patch_of(rows: Rows, some: np.ndarray) -> Rows:
    """The rows of some vertices with their values turned round."""
    bones = rows.bones.reshape(-1, INFLUENCES)[some]
    values = rows.values.reshape(-1, INFLUENCES)[some, ::-1]
    return Rows(row_starts(len(some)), bones.ravel(), values.ravel())


def check_equal(obj: bpy.types.Object, rows: Rows, others: Rows) -> None:
    for wanted in (rows, others):
        for writing in WAYS.values():
            with writing():
                vertex_groups.write(obj, NAMES, wanted)
            for reading in WAYS.values():
                with reading():
                    got = vertex_groups.read(obj, NAMES)
                assert all(np.array_equal(a, b) for a, b in zip(got, wanted, strict=True))


def main(sizes: list[int]) -> None:
    trusted = "memory views in use" if deform_array.find_layout() else "memory views refused"
    print(f"\nBlender {bpy.app.version_string}, numpy {np.__version__}, {trusted}\n")
    print("| task | vertices | ours ms | ours ns/v | public API ns/v | bmesh ns/v |\n|---|---|---|---|---|---|")
    for size in sizes:
        obj = make_object(size)
        for task in make_tasks(obj):
            ways = measure(task)
            cells = [f"{ways[way] / task.n_vertices * 1e9:.0f}" if way in ways else "" for way in (*WAYS, "bmesh")]
            first = f"| {task.name} | {task.n_vertices} of {size} | {ways['ours'] * 1e3:.1f} | "
            print(first + " | ".join(cells) + " |", flush=True)
        bpy.data.meshes.remove(obj.data)


if __name__ == "__main__":
    main([int(size) for size in sys.argv[1:]] or [10_000, 100_000, 1_000_000])
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 hangs in Python's ordinary exit once a class was registered
