"""How far two states of an object's weights are apart, per vertex."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..scene import armature, weight_state
from ..scene.weight_state import WeightState
from .record import Record
from .restoring import align

# What the overlay shows, if anything.
current: "Comparison | None" = None


@dataclass(frozen=True)
class Comparison:
    """`difference` (V,): half the sum of absolute differences over the bones, 0 for equal and 1 for disjoint rows."""

    object_name: str
    state_name: str
    difference: NDArray[np.float64]

    def sentence(self) -> str:
        """The line the artist reads."""
        changed = int((self.difference > 1e-6).sum())
        if not changed:
            return f"{self.object_name} has the weights of {self.state_name}"
        worst = int(self.difference.argmax())
        return (
            f"{self.object_name}: {changed} of {len(self.difference)} vertices differ from {self.state_name}, "
            f"by {self.difference[self.difference > 1e-6].mean():.3f} on average and "
            f"{self.difference[worst]:.3f} at vertex {worst}"
        )


def compare(obj: bpy.types.Object, kept: Record, name: str, threads: int = 0) -> Comparison:
    """The present weights against a state, brought to the present mesh if that has changed."""
    now, before = weight_state.capture(obj), align(obj, kept, threads).state
    rig = armature.find(obj)
    return Comparison(obj.name, name, half_l1(now, before, armature.deform_bones(rig) if rig else None))


def half_l1(a: WeightState, b: WeightState, bones: set[str] | None = None) -> NDArray[np.float64]:
    """(V,) half of sum_j |a_j - b_j| over the groups that are `bones`, all groups if None."""
    names = sorted({*a.names, *b.names} if bones is None else bones & {*a.names, *b.names})
    column = {name: index for index, name in enumerate(names)}
    entries = [_entries(state, column, sign) for state, sign in ((a, 1.0), (b, -1.0))]
    vertex, bone, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    n = len(a.indptr) - 1
    place, inverse = np.unique(vertex * max(len(names), 1) + bone, return_inverse=True)
    total = np.abs(np.bincount(inverse.reshape(-1), value, len(place)))
    return 0.5 * np.bincount(place // max(len(names), 1), total, n)


def _entries(state: WeightState, column: dict[str, int], sign: float) -> tuple[NDArray, NDArray, NDArray]:
    columns = np.array([column.get(name, -1) for name in state.names], np.int64)
    bone = columns[state.groups.astype(np.int64)] if len(columns) else np.zeros(0, np.int64)
    vertex = np.repeat(np.arange(len(state.indptr) - 1, dtype=np.int64), np.diff(state.indptr))
    kept = bone >= 0
    return vertex[kept], bone[kept], sign * state.values[kept].astype(np.float64)
