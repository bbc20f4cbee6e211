"""Sculpt to weights: begin, stroke, undo, redo, commit, cancel. No event, no window.

The artist sculpts the posed mesh with Blender's own brushes, which move rest positions. `stroke` puts them back and
changes the weights of these vertices such that the pose shows what was sculpted. The object is found by
name each time, as Blender's undo replaces it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Quaternion
from numpy.typing import NDArray

from .. import csr, native
from ..reporting import SculptReport
from ..scene import (
    armature,
    bendy,
    corrective,
    deform_array,
    identity,
    mesh,
    poses,
    rest_shape,
    sculpting,
    shape_keys,
    switched,
    vertex_groups,
    weight_state,
)
from ..scene.error import SceneError
from .candidates import choose
from .copies import Copies
from .mirror import Mirror
from .params import SculptParams as SculptOptions

# Every keyframe costs a pass over the mesh when a session begins.
MOST_GUARD_FRAMES = 24
# Below this share of a sculpt reached, weights are not what is missing.
POOR = 0.3
ADVICE = "Weights can do no more: bend the joint further, lower Stiffness, or set Leftover to Shape Key"
# Of a stroke where driven shape keys change the rest shape.
_PASSES = 6


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
        """Prepare; nothing is written until a stroke or `open`. Raises SceneError or native.NativeError."""
        self.options = options or SculptOptions()
        rig = sculpting.check(obj)
        self.object, self.rig = identity.of(obj), identity.of(rig)
        self._weights_before = weight_state.capture(obj)
        self._shape = rest_shape.read(obj)
        self._switches = switched.needed(obj)
        self._is_open = False
        self._rotations: dict[int, dict[str, Quaternion]] = {}
        self._guarded: set[int] = set()
        self._reached: list[float] = []
        self._prepare(obj, rig)

    def _prepare(self, obj: bpy.types.Object, rig: bpy.types.Object) -> None:
        self._bones = [bone.name for bone in rig.data.bones]
        options = self.options
        chosen = choose(obj, rig, options)
        self.names, self._before, self._cut = chosen.names, chosen.before, chosen.cut
        # Seams cut the surface along which candidates are looked for, but copies have the same.
        self._copies = Copies(mesh.rest_positions(obj.data), chosen.before)
        rows = csr.take_rows(chosen.rows, self._copies.leader)
        self._columns, self._rows = bendy.split(obj, rig, self.names, rows)
        self._ruled = sculpting.ruled(obj)
        self._basis, self._mixed = mesh.rest_positions(obj.data), shape_keys.mixed(obj)
        locked = np.isin(self.names, sorted(vertex_groups.locked(obj)))
        self._solver = native.SculptSolver(
            obj.name,
            self._mixed,
            self._rows,
            len(self._columns.bone),
            locked=locked[self._columns.bone],
            kappa=options.kappa,
            passes=options.passes,
            threads=options.threads,
        )
        self._mirror = Mirror(obj, self.names, self._columns, self._basis) if options.mirror else None
        # How many of the solver's strokes each stroke of the artist is, those taken back last.
        self._steps: list[int] = []
        self._taken_back: list[int] = []
        if options.guard == "ACTION":
            for _ in poses.keyframes(rig, MOST_GUARD_FRAMES):
                self._solver.guard(bendy.matrices(obj, rig, self.names, self._columns), options.guard_alpha)

    def open(self) -> None:
        """Write the bones that vertices have to choose from as members of weight 0, so that strokes only set values."""
        obj = self._found()
        self._switch(obj, during=True)
        self._write_all(obj)
        obj.data.update()

    def _switch(self, obj: bpy.types.Object, *, during: bool) -> None:
        if during != self._is_open:
            self._is_open = during
            for switch in self._switches:
                switch.turn(obj, during=during)

    def _present(self, vertices: NDArray | None = None) -> csr.Rows:
        """The solver's rows over the bones."""
        return self._columns.names_only(self._solver.rows(vertices))

    def _write_all(self, obj: bpy.types.Object) -> None:
        """The present rows; where a vertex follows more bones than the solver takes, not before it is sculpted."""
        vertices = np.flatnonzero(~self._cut | self._changed())
        vertex_groups.write(obj, self.names, csr.take_rows(self._present(), vertices), vertices)

    def _changed(self) -> NDArray[np.bool_]:
        """(V,) the vertices whose weights strokes have changed."""
        changed = np.zeros(len(self._cut), bool)
        changed[csr.entry_vertices(self._rows)[self._rows.values != self._solver.rows().values]] = True
        return changed

    @property
    def target_name(self) -> str:
        """The object's present name."""
        self.object.find()
        return self.object.name

    def target(self) -> bpy.types.Object | None:
        """The sculpted object, None where it or its armature is gone."""
        obj = self.object.find()
        return obj if obj and obj.type == "MESH" and self.rig.find() else None

    def problem(self, obj: bpy.types.Object) -> str:
        """Why no stroke can become weights any more, or nothing. Bones that were renamed are followed."""
        rig = self._found_rig()
        bones = [bone.name for bone in rig.data.bones]
        if bones == self._bones:
            return ""
        if len(bones) != len(self._bones):
            return f"{rig.name} has other bones than before"
        renamed = dict(zip(self._bones, bones, strict=True))
        self._bones = bones
        self.names = [renamed[name] for name in self.names]
        before = self._weights_before
        names = [renamed.get(name, name) for name in before.names]
        self._weights_before = replace(before, names=names, active=renamed.get(before.active, before.active))
        return ""

    def has_other_vertices(self, obj: bpy.types.Object) -> bool:
        """Whether the mesh is no longer the one that is sculpted."""
        return len(obj.data.vertices) != len(self._shape.positions)

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
            ruled = self._ruled[vertices]
            if not ruled.any():
                raise SceneError(f"No Armature modifier moves these vertices of {obj.name} in full")
            self._enter_pose(obj)
            return self._sculpt_from_rest(obj, vertices[ruled], moved[ruled])
        finally:
            rest_shape.restore(obj, self._shape)
            obj.data.update()

    def _sculpt_from_rest(self, obj: bpy.types.Object, vertices: NDArray, moved: NDArray[np.float32]) -> Outcome:
        """A brush has moved the Basis to `moved`; shape keys in use move along."""
        mixed = shape_keys.mixed(obj)[vertices] if obj.data.shape_keys else moved
        vertices, mixed = self._copies.join(vertices, mixed)
        return self._solve(obj, vertices, self._solver.posed(vertices, mixed))

    def sculpt(self, vertices: NDArray[np.integer], positions: NDArray[np.floating]) -> Outcome:
        """The same for vertices (n,) that are to be at `positions` (n, 3, the mesh' space) in the present pose."""
        obj = self._found()
        self._switch(obj, during=True)
        self._enter_pose(obj)
        ruled = self._ruled[vertices]
        vertices, positions = self._copies.join(vertices[ruled], positions[ruled])
        outcome = self._solve(obj, vertices, positions)
        obj.data.update()
        return outcome

    def _enter_pose(self, obj: bpy.types.Object) -> None:
        rig = self.rig.find()
        matrices = self._matrices = bendy.matrices(obj, rig, self.names, self._columns)
        if np.allclose(matrices, matrices[0], rtol=0, atol=1e-6):
            raise SceneError(
                f"{self.rig.name} is at rest, where weights change nothing: pose it, then sculpt {self.target_name}"
            )
        number = self._solver.add_pose(matrices)
        if number not in self._rotations:
            self._rotations[number] = armature.local_rotations(rig)

    def _solve(self, obj: bpy.types.Object, vertices: NDArray, targets: NDArray) -> Outcome:
        if self.options.guard == "RANGE":
            self._guard_joints(obj, vertices)
        del self._reached[self.stroke_count :]
        reachability = self._reach(obj, vertices, targets)
        other = self._reach_mirrored(self._mirror, vertices, targets) if self._mirror else vertices[:0]
        self._reached.append(reachability)
        self._steps.append(1 + bool(other.size))
        self._taken_back.clear()
        touched = np.union1d(vertices, other).astype(np.uint32)
        vertex_groups.write(obj, self.names, self._present(touched), touched)
        return Outcome(len(touched), reachability)

    def _reach_mirrored(self, mirror: Mirror, vertices: NDArray, targets: NDArray) -> NDArray:
        """The same on the other side, in the pose that is this one's mirror image; gives the vertices there."""
        other, mirrored = mirror.of_stroke(vertices, targets)
        if other.size:
            self._solver.add_pose(mirror.of_pose(self._matrices))
            self._solver.stroke(other, mirrored)
            self._solver.add_pose(self._matrices)
        return other

    def _reach(self, obj: bpy.types.Object, vertices: NDArray, targets: NDArray) -> float:
        """Solve; where driven shape keys give this pose another rest shape, targets are corrected for what that adds.

        The solver has one rest shape. The difference d of this pose's adds T(w) d, which is taken off the targets for
        the weights w of the pass before; where d is small against the body, few passes are enough.
        """
        here, usual = shape_keys.mixed(obj, self._basis)[vertices], self._mixed[vertices]
        if np.abs(here - usual).max(initial=0) <= self._shape.rounding:
            return self._solver.stroke(vertices, targets)[1]
        for number in range(_PASSES):
            added = self._solver.posed(vertices, here) - self._solver.posed(vertices, usual)
            if number:
                self._solver.undo()
            reachability = self._solver.stroke(vertices, (targets - added).astype(np.float32))[1]
        return reachability

    def _guard_joints(self, obj: bpy.types.Object, vertices: NDArray) -> None:
        """The joints that a stroke touches for the first time."""
        rows = self._present(vertices)
        joints = set(rows.bones[rows.values > 0].tolist()) - self._guarded
        if joints:
            rig, columns = self.rig.find(), self._columns
            heads = armature.segments(obj, rig, self.names)[columns.bone, 0]
            parents = columns.parents(armature.parents(rig, self.names))
            self._solver.guard_range_of_motion(
                parents,
                np.ascontiguousarray(heads),
                columns.first[sorted(joints)].astype(np.uint32),
                self.options.guard_alpha,
            )
            self._guarded |= joints

    def undo(self) -> bool:
        """Take the last stroke back, weights and memory; False if there is none."""
        return self._step(self._steps, self._taken_back, self._solver.undo)

    def redo(self) -> bool:
        """Do the stroke again that was last taken back; False if there is none."""
        return self._step(self._taken_back, self._steps, self._solver.redo)

    def _step(self, taken: list[int], given: list[int], step: Callable[[], NDArray | None]) -> bool:
        if not taken:
            return False
        given.append(taken.pop())
        touched: list[NDArray] = []
        for _ in range(given[-1]):
            stepped = step()
            assert stepped is not None  # the solver has as many strokes as the lists count
            touched.append(stepped)
        vertices = np.unique(np.concatenate(touched)).astype(np.uint32)
        vertex_groups.write(self._found(), self.names, self._present(vertices), vertices)
        return True

    def assert_state(self) -> None:
        """Write weights and rest positions of the session again, after something else has changed them."""
        obj = self._found()
        self._switch(obj, during=True)
        self._write_all(obj)
        rest_shape.restore(obj, self._shape)
        obj.data.update()

    @property
    def stroke_count(self) -> int:
        """Number of strokes that count."""
        return len(self._steps)

    @property
    def pose_count(self) -> int:
        """Number of poses that were sculpted in."""
        return len(self._rotations)

    @property
    def reachability(self) -> float | None:
        """Of the last stroke that counts."""
        return self._reached[self.stroke_count - 1] if self._steps else None

    def commit(self) -> SculptReport:
        """Keep the weights, and what they cannot reach if that is wanted. Raises SceneError for another mesh."""
        obj = self._found()
        keys: list[str] = []
        warnings = [switch.reason for switch in self._switches if switch.reason and self._is_open]
        vertices = self.tidy()
        if self.options.residual == "SHAPE_KEY":
            for pose in sorted(self._rotations):
                keys += self._correct(obj, pose, warnings)
        reached = self._reached[: self.stroke_count]
        return SculptReport(obj.name, self.stroke_count, self.pose_count, len(vertices), reached, keys, warnings)

    def tidy(self) -> NDArray[np.integer]:
        """Leave the new weights and the shape at rest, but no member of weight 0 and no group that strokes do not need.

        Gives the vertices whose weights have changed. Raises SceneError for another mesh.
        """
        obj = self._found()
        self._check_vertices(obj)
        vertices = np.flatnonzero(self._changed())
        rows = csr.replace_rows(self._before, vertices, self._without_spare(vertices))
        used = np.isin(np.arange(len(self.names), dtype=np.int64), rows.bones)
        used |= np.isin(self.names, self._weights_before.names)
        vertex_groups.write(obj, self.names, rows)
        vertex_groups.remove(obj, [name for name, is_used in zip(self.names, used, strict=True) if not is_used])
        rest_shape.restore(obj, self._shape)
        self._switch(obj, during=False)
        obj.data.update()
        return vertices

    def _without_spare(self, vertices: NDArray[np.integer]) -> csr.Rows:
        """The present rows of these vertices; of the members of weight 0 only those that were there as such before."""
        rows, before = csr.take_rows(self._present(), vertices), csr.take_rows(self._before, vertices)
        place, place_before = (csr.entry_vertices(r) * len(self.names) + r.bones for r in (rows, before))
        return csr.keep_entries(rows, (rows.values > 0) | np.isin(place, place_before[before.values == 0]))

    def cancel(self) -> None:
        """Bring back positions, weights and groups as they were at the beginning, bit for bit."""
        obj = self.target()
        if obj:
            self._restore(obj)

    def _restore(self, obj: bpy.types.Object) -> None:
        self._check_vertices(obj)
        weight_state.apply(obj, self._weights_before)
        rest_shape.restore(obj, self._shape)
        self._switch(obj, during=False)
        obj.data.update()

    def _check_vertices(self, obj: bpy.types.Object) -> None:
        if self.has_other_vertices(obj):
            raise SceneError(f"{obj.name} has another number of vertices than before: undo what changed it")

    def _found(self) -> bpy.types.Object:
        obj = self.target()
        if obj is None:
            raise SceneError(f"{self.target_name} or {self.rig.name} is gone: undo what removed it")
        return obj

    def _found_rig(self) -> bpy.types.Object:
        """Where `target` has just found the object, and so its armature."""
        rig = self.rig.find()
        assert rig is not None
        return rig

    def _correct(self, obj: bpy.types.Object, pose: int, warnings: list[str]) -> list[str]:
        """A shape key for what is left in a pose."""
        vertices, offsets = self._solver.rest_residuals(pose)
        if not offsets.any():
            return []
        rig, rotations = self._found_rig(), self._rotations[pose]
        rows = self._present(vertices)
        share = dict(zip(self.names, np.bincount(rows.bones, rows.values, len(self.names)).tolist(), strict=True))
        bone = corrective.joint(rig, share, rotations)
        key = corrective.add(obj, f"Corrective {bone or 'Pose'}", vertices, offsets)
        if bone:
            corrective.drive(key, rig, bone, rotations[bone])
        else:
            warnings.append(f"{key.name} of {obj.name} has no driver, as no bone of {rig.name} had turned")
        return [key.name]
