"""Sculpt to weights: begin, stroke, undo, redo, commit, cancel. No event, no window.

The artist sculpts the posed mesh with Blender's own brushes, which move rest positions. `stroke` puts them back and
changes the weights of these vertices such that the pose shows what was sculpted (spec-sculpt). The object is found by
name each time, as Blender's undo replaces it.
"""

from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Quaternion
from numpy.typing import NDArray

from .. import csr, native
from ..desparsify import DesparsifyParams, desparsify
from ..reporting import SculptReport
from ..scene import armature, corrective, deform_array, mesh, poses, rest_shape, sculpting, vertex_groups, weight_state
from ..scene.error import SceneError
from .params import SculptParams as SculptOptions

# Every keyframe costs a pass over the mesh when a session begins.
MOST_GUARD_FRAMES = 24


@dataclass(frozen=True)
class Outcome:
    """A stroke: how many vertices it moved, and how much of it weights reach."""

    vertices: int
    reachability: float


# The session of the modal operator.
current: "SculptSession | None" = None


class SculptSession:
    """A character whose sculpts become weights, from `begin` on to `commit` or `cancel`."""

    def __init__(self, obj: bpy.types.Object, options: SculptOptions | None = None) -> None:
        """Begin. Raises SceneError or native.NativeError with the scene as it was."""
        self.options = options or SculptOptions()
        rig = sculpting.check(obj)
        self.target_name, self.rig_name = obj.name, rig.name
        self._weights_before = weight_state.capture(obj)
        self._shape = rest_shape.read(obj)
        self._rotations: dict[int, dict[str, Quaternion]] = {}
        self._guarded: set[int] = set()
        self._reached: list[float] = []
        try:
            if self.options.candidates:
                params = DesparsifyParams(self.options.candidates, self.options.method, threads=self.options.threads)
                desparsify(obj, params)
            self._prepare(obj, rig)
        except BaseException:
            self._restore(obj)
            raise

    def _prepare(self, obj: bpy.types.Object, rig: bpy.types.Object) -> None:
        deforming, locked = armature.deform_bones(rig), vertex_groups.locked(obj)
        self.names = [group.name for group in obj.vertex_groups if group.name in deforming]
        self._rows = vertex_groups.read(obj, self.names)
        self._solver = native.SculptSolver(
            obj.name,
            mesh.rest_positions(obj.data),
            self._rows,
            len(self.names),
            locked=np.isin(self.names, sorted(locked)),
            kappa=self.options.kappa,
            passes=self.options.passes,
            threads=self.options.threads,
        )
        if self.options.guard == "ACTION":
            for _ in poses.keyframes(rig, MOST_GUARD_FRAMES):
                self._solver.guard(armature.pose_from_rest(obj, rig, self.names), self.options.guard_alpha)

    def target(self) -> bpy.types.Object | None:
        """The sculpted object, None where it or its armature is gone."""
        rig = bpy.data.objects.get(self.rig_name)
        obj = bpy.data.objects.get(self.target_name)
        return obj if rig and obj and obj.type == "MESH" else None

    def set_strength(self, kappa: float) -> None:
        """Says how far the next strokes may change weights."""
        if kappa != self.options.kappa:
            self._solver.set_options(kappa, self.options.passes)
            self.options = replace(self.options, kappa=kappa)

    def expect_stroke(self) -> None:
        """Have what a stroke's write begins with done before it ends: Blender gives the mesh weights of its own."""
        deform_array.unshare(self._found().data)

    def stroke(self) -> Outcome | None:
        """Turn what a brush has moved since the last time into weights; None if nothing has moved.

        The rest positions are back in any case. Raises SceneError or native.NativeError with the weights as they were.
        """
        obj = self._found()
        vertices, moved = rest_shape.moved(obj, self._shape)
        if not vertices.size:
            return None
        try:
            if np.abs(moved - self._shape.positions[vertices]).max() <= self._shape.rounding:
                return None
            self._enter_pose(obj)
            return self._solve(obj, vertices, self._solver.posed(vertices, moved))
        finally:
            rest_shape.restore(obj, self._shape)
            obj.data.update()

    def sculpt(self, vertices: NDArray[np.integer], positions: NDArray[np.floating]) -> Outcome:
        """The same for vertices (n,) that are to be at `positions` (n, 3, the mesh' space) in the present pose."""
        obj = self._found()
        self._enter_pose(obj)
        outcome = self._solve(obj, vertices, positions)
        obj.data.update()
        return outcome

    def _enter_pose(self, obj: bpy.types.Object) -> None:
        rig = bpy.data.objects[self.rig_name]
        matrices = armature.pose_from_rest(obj, rig, self.names)
        if np.allclose(matrices, matrices[0], rtol=0, atol=1e-6):
            raise SceneError(
                f"{self.rig_name} is at rest, where weights change nothing: pose it, then sculpt {self.target_name}"
            )
        number = self._solver.add_pose(matrices)
        if number not in self._rotations:
            self._rotations[number] = armature.local_rotations(rig)

    def _solve(self, obj: bpy.types.Object, vertices: NDArray, targets: NDArray) -> Outcome:
        if self.options.guard == "RANGE":
            self._guard_joints(obj, vertices)
        del self._reached[self.stroke_count :]
        rows, reachability, _ = self._solver.stroke(vertices, targets)
        self._reached.append(reachability)
        vertex_groups.write(obj, self.names, rows, vertices)
        return Outcome(len(vertices), reachability)

    def _guard_joints(self, obj: bpy.types.Object, vertices: NDArray) -> None:
        """The joints that a stroke touches for the first time."""
        rows = self._solver.rows(vertices)
        joints = set(rows.bones[rows.values > 0].tolist()) - self._guarded
        if joints:
            rig = bpy.data.objects[self.rig_name]
            heads = armature.segments(obj, rig, self.names)[:, 0]
            parents = armature.parents(rig, self.names)
            self._solver.guard_range_of_motion(
                parents, np.ascontiguousarray(heads), np.array(sorted(joints), np.uint32), self.options.guard_alpha
            )
            self._guarded |= joints

    def undo(self) -> bool:
        """Take the last stroke back, weights and memory; False if there is none."""
        return self._write_back(self._solver.undo())

    def redo(self) -> bool:
        """Do the stroke again that was last taken back; False if there is none."""
        return self._write_back(self._solver.redo())

    def _write_back(self, vertices: NDArray | None) -> bool:
        if vertices is not None:
            vertex_groups.write(self._found(), self.names, self._solver.rows(vertices), vertices)
        return vertices is not None

    def assert_state(self) -> None:
        """Write weights and rest positions of the session again, after something else has changed them."""
        obj = self._found()
        vertex_groups.write(obj, self.names, self._solver.rows())
        rest_shape.restore(obj, self._shape)
        obj.data.update()

    @property
    def stroke_count(self) -> int:
        """Number of strokes that count."""
        return self._solver.stroke_count

    @property
    def pose_count(self) -> int:
        """Number of poses that were sculpted in."""
        return len(self._rotations)

    @property
    def reachability(self) -> float | None:
        """Of the last stroke that counts."""
        return self._solver.reachability

    def commit(self) -> SculptReport:
        """Keep the weights, and what they cannot reach if that is wanted."""
        obj = self._found()
        keys: list[str] = []
        warnings: list[str] = []
        if self.options.residual == "SHAPE_KEY":
            for pose in sorted(self._rotations):
                keys += self._correct(obj, pose, warnings)
        changed = self._rows.values != self._solver.rows().values
        vertices = len(np.unique(csr.entry_vertices(self._rows)[changed]))
        reached = self._reached[: self.stroke_count]
        return SculptReport(obj.name, self.stroke_count, self.pose_count, vertices, reached, keys, warnings)

    def cancel(self) -> None:
        """Bring back positions, weights and groups as they were at the beginning, bit for bit."""
        obj = self.target()
        if obj:
            self._restore(obj)

    def _restore(self, obj: bpy.types.Object) -> None:
        weight_state.apply(obj, self._weights_before)
        rest_shape.restore(obj, self._shape)
        obj.data.update()

    def _found(self) -> bpy.types.Object:
        obj = self.target()
        if obj is None:
            raise SceneError(f"{self.target_name} or {self.rig_name} is gone: undo what removed it")
        return obj

    def _correct(self, obj: bpy.types.Object, pose: int, warnings: list[str]) -> list[str]:
        """A shape key for what is left in a pose."""
        vertices, offsets = self._solver.rest_residuals(pose)
        if not offsets.any():
            return []
        rig, rotations = bpy.data.objects[self.rig_name], self._rotations[pose]
        rows = self._solver.rows(vertices)
        share = dict(zip(self.names, np.bincount(rows.bones, rows.values, len(self.names)).tolist(), strict=True))
        bone = corrective.joint(rig, share, rotations)
        key = corrective.add(obj, f"Corrective {bone or 'Pose'}", vertices, offsets)
        if bone:
            corrective.drive(key, rig, bone, rotations[bone])
        else:
            warnings.append(f"{key.name} of {obj.name} has no driver, as no bone of {rig.name} had turned")
        return [key.name]
