"""CPU seconds of a transfer with the paper's method, this checkout against another one, taking turns.

    python bench/paired_transfer.py ../before --native out/develop --other-native ../before/out/develop

First the native module alone on the benchmark's meshes, then a whole transfer in Blender of 100,000 vertices. Each side
is a process of its own with its own add-on and native module; the figures are medians of the turns.
"""

import argparse
import importlib
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NATIVE = ("20k", "100k", "300k")
IN_BLENDER = ("quads", "triangles")
AROUND, ALONG = 400, 250


def main() -> None:
    """Start both sides, let them take turns, and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, nargs="?")
    parser.add_argument("--native", default="", help="folder of this checkout's native module, else the installed one")
    parser.add_argument("--other-native", default="")
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--work", default="", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        (_work_natively if options.work in NATIVE else _work_in_blender)(options.work)
        return
    print(f"load {os.getloadavg()[0]:.1f}")
    for kind in (*NATIVE, *IN_BLENDER):
        sides = [_start(ROOT, options.native, kind), _start(options.other, options.other_native, kind)]
        taken: list[list[float]] = [[], []]
        for _ in range(options.turns):
            for side, seconds in zip(sides, taken, strict=True):
                seconds.append(_turn(side))
        for side in sides:
            side.communicate()
        ours, theirs = (statistics.median(seconds[1:]) for seconds in taken)
        print(f"{kind}: {ours:.3f} s, the other {theirs:.3f} s, ratio {ours / theirs:.3f}", flush=True)


def _start(root: Path, native: str, kind: str) -> subprocess.Popen:
    environment = os.environ | {"PYTHONPATH": native, "SKINWRIGHT_ADDON": str(root / "addon")}
    command = [sys.executable, __file__, "--work", kind]
    return subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )


def _turn(side: subprocess.Popen) -> float:
    assert side.stdin and side.stdout, "pipes were asked for"
    side.stdin.write("go\n")
    side.stdin.flush()
    line = ""
    while not line.startswith("took "):  # Blender writes to the same stream
        line = side.stdout.readline()
        if not line:
            raise SystemExit("one side ended before its turn")
    return float(line.split()[1])


def _work_natively(size: str) -> None:
    """Prepare arrays once, then transfer at every line that comes, from the body's index to the rows."""
    import skinwright_native as native

    sys.path.append(str(ROOT / "tests" / "support"))
    import meshes
    import numpy as np

    body, garment = meshes.load("source"), meshes.load(size)
    vertex, bone = np.nonzero(body.weights)
    indptr = np.searchsorted(vertex, range(len(body.weights) + 1))
    rows = (indptr.astype(np.uint32), bone.astype(np.uint32), body.weights[vertex, bone])
    weights = native.Weights(*rows, body.weights.shape[1])
    for _ in sys.stdin:
        start = time.process_time()
        native.Source(body.positions, body.triangles, weights).transfer(garment.positions, garment.triangles)
        print(f"took {time.process_time() - start:.6f}", flush=True)
    os._exit(0)


def _work_in_blender(kind: str) -> None:
    """Prepare a scene once, then transfer at every line that comes."""
    import bpy

    sys.path.insert(0, os.environ["SKINWRIGHT_ADDON"])
    addon = importlib.import_module("skinwright")
    addon.register()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    source, target = _body(bpy), _garment(bpy, AROUND, ALONG, triangles=kind == "triangles")
    settings = addon.transfer.TransferParams
    params = settings(**{"method": "paper"} if hasattr(settings, "method") else {})  # both sides the same
    for _ in sys.stdin:
        bpy.context.view_layer.update()  # what the turn before has written is evaluated outside the measured time
        start = time.process_time()
        addon.transfer.transfer_weights(bpy.context, source, [target], params)
        print(f"took {time.process_time() - start:.6f}", flush=True)
    os._exit(0)


def _tube(around: int, along: int, radius: float, wave: float):
    """Vertices and quads of a tube of 1.5 m that its waves bring near a body of .1 m and away from it."""
    import numpy as np

    a, z = np.meshgrid(2 * np.pi * np.arange(around) / around, np.linspace(0, 1.5, along))
    r = radius + wave * (1 + np.sin(9 * z + 2 * np.sin(3 * a)))
    positions = np.stack([r * np.cos(a), r * np.sin(a), z], axis=-1).reshape(-1, 3)
    k = np.arange(around * (along - 1))
    right = k // around * around + (k + 1) % around
    return positions, np.stack([k, right, right + around, k + around], axis=1)


def _mesh(bpy, name: str, positions, faces):
    data = bpy.data.meshes.new(name)
    data.from_pydata(positions.tolist(), [], faces.tolist())
    obj = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(obj)
    return obj


def _garment(bpy, around: int, along: int, triangles: bool):
    import numpy as np

    positions, faces = _tube(around, along, 0.11, 0.06)
    if triangles:
        faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    return _mesh(bpy, "Garment", positions, faces)


def _body(bpy, bones: int = 12):
    import numpy as np

    positions, faces = _tube(130, 100, 0.1, 0.0)
    body = _mesh(bpy, "Body", positions, faces)
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    at = np.linspace(0, 1.5, bones + 1)
    for k in range(bones):
        bone = armature.data.edit_bones.new(f"Bone{k}")
        bone.head, bone.tail = (0, 0, at[k]), (0, 0, at[k + 1])
    bpy.ops.object.mode_set(mode="OBJECT")
    share = np.exp(-(((positions[:, 2:] - (at[:-1] + at[1:]) / 2) / 0.1) ** 2))
    share = np.where(share > 0.01, share, 0) / np.where(share > 0.01, share, 0).sum(axis=1, keepdims=True)
    for k in range(bones):
        group = body.vertex_groups.new(name=f"Bone{k}")
        for i in np.flatnonzero(share[:, k]).tolist():
            group.add([i], float(share[i, k]), "REPLACE")
    body.modifiers.new("Armature", "ARMATURE").object = armature
    return body


if __name__ == "__main__":
    main()
