"""How far two states of an object's weights are apart, per vertex."""

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..csr import Rows
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
    return csr.half_l1(_rows(a, column), _rows(b, column))


def _rows(state: WeightState, column: dict[str, int]) -> Rows:
    """The weights over the columns of these groups."""
    columns = np.array([column.get(name, -1) for name in state.names], np.int64)
    bones = columns[state.groups.astype(np.int64)] if len(columns) else np.zeros(0, np.int64)
    kept = csr.keep_entries(Rows(state.indptr, state.groups, state.values), bones >= 0)
    return kept._replace(bones=bones[bones >= 0].astype(np.uint32))
