"""Thousands of operations in one process: memory, threads, files and Blender's lists stay flat.

python tests/fuzz/soak.py [--seconds 300] [--cases 8000]
"""

import contextlib
import gc
import io
import os
import resource
import threading

from findings import Run
from scenes import bpy, builders


def resident():
    """MiB that the process holds now; 0 where the system does not say."""
    try:
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * resource.getpagesize() / 2**20
    except OSError:
        return 0.0


def counts():
    """What must not grow: threads, open files, handlers, classes, data blocks."""
    gc.collect()
    tasks = len(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else threading.active_count()
    files = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    handlers = sum(len(each) for each in lists if isinstance(each, list))
    return {"threads": tasks, "files": files, "handlers": handlers, "meshes": len(bpy.data.meshes)}


def build():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    body = builders.body(10)
    coat = builders.grid("Coat", 12, size=1.5, z=0.02)
    bpy.context.scene.skinwright.transfer.source = body
    builders.select(coat)
    return coat


def operation(rng):
    match int(rng.integers(6)):
        case 0:
            with contextlib.suppress(RuntimeError):  # no transfer has added the armature yet
                bpy.ops.skinwright.desparsify(n=int(rng.integers(1, 5)))
        case 1:
            bpy.ops.skinwright.store_weights()
        case 2:
            with contextlib.suppress(RuntimeError):  # nothing is stored yet
                bpy.ops.skinwright.restore_weights()
        case 3:
            bpy.ops.skinwright.edit_match_mask(action=str(rng.choice(["CLEAR", "FROM_MATCH", "GROW", "INVERT"])))
        case _:
            limit = int(rng.integers(0, 3))
            with contextlib.suppress(RuntimeError):  # a mask may leave nothing to match
                bpy.ops.skinwright.transfer_weights(max_influences=limit, smoothing_iterations=int(rng.integers(3)))
    return "done"


if __name__ == "__main__":
    run = Run("soak", cases=8000)
    build()
    warm, first, most = max(run.n_cases // 10, 20), None, 0.0
    for seed, generator in run.cases():
        if (seed - run.first) % 500 == 0:
            build()
        with contextlib.redirect_stdout(io.StringIO()):
            run.attempt(seed, "operation", operation, generator)
        if seed - run.first == warm:
            build()
            first = counts() | {"MiB": resident()}
        most = max(most, resident())
    build()
    last = counts() | {"MiB": resident()}
    print(f"  after {warm} operations {first}\n  at the end {last}, at most {most:.0f} MiB")
    if first:
        for name in ("threads", "files", "handlers", "meshes"):
            if last[name] > first[name]:
                run.found(run.first, name, f"grew from {first[name]} to {last[name]}")
        if last["MiB"] > first["MiB"] * 1.2 + 30:
            run.found(run.first, "memory", f"grew from {first['MiB']:.0f} to {last['MiB']:.0f} MiB")
    run.end()
