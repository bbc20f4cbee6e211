"""Why a vertex matches or not: its closest point, the tests it passed or failed, its weights, its worst bend."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ..scene import armature, mask, mesh
from ..transfer.params import TransferParams
from .session import Category, MatchSession

_ANGLES = (-90, -45, 45, 90)
_AXES = "XYZ"


@dataclass(frozen=True)
class Explanation:
    """Lengths and places in the world, angles in radians; `weights` by bone, the largest first."""

    object_name: str
    vertex: int
    position: tuple[float, float, float]
    closest: tuple[float, float, float]
    distance: float
    angle: float
    verdict: str
    weights: list[tuple[str, float]]
    worst: str

    def sentence(self) -> str:
        """The line the artist reads."""
        return f"Vertex {self.vertex} of {self.object_name}: {self.verdict}"


# What the overlay draws, if anything.
current: Explanation | None = None


def explain(obj: bpy.types.Object, session: MatchSession, params: TransferParams, vertex: int) -> Explanation:
    """About one vertex of the session's target; not in Edit mode."""
    position = session.garment.geometry.positions[vertex]
    body = session.body.geometry
    tree = BVHTree.FromPolygons(body.positions.tolist(), body.triangles.tolist())
    closest = tree.find_nearest(Vector(position.tolist()))[0]
    distance, angle = (float(values[vertex]) for values in (session.inpainting.distance, session.inpainting.angle))
    return Explanation(
        object_name=obj.name,
        vertex=vertex,
        position=tuple(position.tolist()),
        closest=tuple(closest or position.tolist()),
        distance=distance,
        angle=angle,
        verdict=_verdict(session, params, vertex, distance, angle),
        weights=_weights(obj, vertex),
        worst=worst_bend(obj, vertex),
    )


def _verdict(session: MatchSession, params: TransferParams, vertex: int, distance: float, angle: float) -> str:
    """The first reason that decides."""
    match = session.match(params)
    category = Category(match.category[vertex])
    if session.mask[vertex] != mask.AUTOMATIC:
        return "the mask forces a match" if category is Category.FORCED_MATCH else "the mask says to inpaint"
    if category is Category.MATCHED:
        return "it matches: near enough, and the surfaces face the same way"
    if not np.isfinite(distance):
        return "it is inpainted: there is nothing on the source to compare with"
    if distance > match.max_distance:
        return f"it is inpainted: {distance:.4g} from the source, and Distance allows {match.max_distance:.4g}"
    facing = min(angle, np.pi - angle) if params.match_flipped_normals else angle
    if facing > match.max_normal_angle:
        allowed = f"{np.degrees(match.max_normal_angle):.0f}°"
        return f"it is inpainted: the surfaces are {np.degrees(facing):.0f}° apart, and Angle allows {allowed}"
    return "it is inpainted: no face of the source is both near and facing the same way"


def _weights(obj: bpy.types.Object, vertex: int) -> list[tuple[str, float]]:
    names = [group.name for group in obj.vertex_groups]
    held = [(names[member.group], member.weight) for member in obj.data.vertices[vertex].groups]
    return sorted(((name, weight) for name, weight in held if weight > 0), key=lambda pair: -pair[1])


def worst_bend(obj: bpy.types.Object, vertex: int) -> str:
    """The turn of one bone that stretches or presses the edges of the vertex most; nothing without an armature."""
    rig = armature.find(obj)
    names = [bone.name for bone in rig.data.bones if bone.name in obj.vertex_groups] if rig else []
    edges = mesh.edges(obj)
    neighbours = np.unique(edges[(edges == vertex).any(axis=1)])
    if not names or len(neighbours) < 2:
        return ""
    shares = _shares(obj, names, neighbours)
    positions = mesh.rest_positions(obj.data)[neighbours].astype(np.float64)
    own = int(np.flatnonzero(neighbours == vertex)[0])
    parents = armature.parents(rig, names)
    heads = armature.segments(obj, rig, names)[:, 0].astype(np.float64)
    found = (1.0, "")
    for bone in np.flatnonzero(_at_work(parents, shares)).tolist():
        turns = _below(parents, bone)
        for axis in range(3):
            for degrees in _ANGLES:
                factor = _stretch(positions, shares, turns, heads[bone], axis, degrees, own)
                if max(factor, 1 / factor) > max(found[0], 1 / found[0]):
                    found = (factor, f"{names[bone]} turned by {degrees:+d}° about {_AXES[axis]}")
    return f"{found[1]}: an edge gets {found[0]:.2f} times as long" if found[1] else ""


def _shares(obj: bpy.types.Object, names: list[str], vertices: NDArray[np.integer]) -> NDArray[np.float64]:
    """(n, J) weights that sum to 1 in every row that has any."""
    index = {group.index: names.index(group.name) for group in obj.vertex_groups if group.name in set(names)}
    shares = np.zeros((len(vertices), len(names)))
    for row, vertex in enumerate(vertices.tolist()):
        for member in obj.data.vertices[vertex].groups:
            if member.group in index:
                shares[row, index[member.group]] = member.weight
    return shares / np.maximum(shares.sum(axis=1, keepdims=True), 1e-12)


def _at_work(parents: NDArray[np.int32], shares: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(J,) the bones that move some of the vertices against others."""
    moved = np.array([shares[:, _below(parents, bone)].sum(axis=1) for bone in range(len(parents))])
    return np.ptp(moved, axis=1) > 1e-6


def _below(parents: NDArray[np.int32], bone: int) -> NDArray[np.bool_]:
    """(J,) the bone and all that hang on it."""
    found = np.arange(len(parents), dtype=np.int64) == bone
    for j in range(len(parents)):
        above, chain = j, []
        while above >= 0 and not found[above]:
            chain.append(above)
            above = int(parents[above])
        if above >= 0:
            found[chain] = True
    return found


def _stretch(positions, shares, turns, head, axis: int, degrees: int, own: int) -> float:
    """How many times as long the edge of vertex `own` gets that changes most."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turned = positions - head
    turned[:, a], turned[:, b] = cos * turned[:, a] - sin * turned[:, b], sin * turned[:, a] + cos * turned[:, b]
    share = shares[:, turns].sum(axis=1)[:, None]
    posed = share * (turned + head) + (1 - share) * positions
    before, after = (np.linalg.norm(np.delete(p, own, axis=0) - p[own], axis=1) for p in (positions, posed))
    ratio = np.maximum(after, 1e-12) / np.maximum(before, 1e-12)
    return float(ratio[np.abs(np.log(ratio)).argmax()])
