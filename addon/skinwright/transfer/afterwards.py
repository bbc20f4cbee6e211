"""What is worth a look once the weights are written: only the result tells."""

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import csr
from ..scene import armature, places, shapes, vertex_groups
from ..scene.error import SceneError
from . import near_borders
from .compute import Result
from .inputs import Body, Garment

# Points of a surface that are looked at: a few centimetres apart on a body.
_MOST_POINTS = 2000
_MOST_OF_BODY = 8000
_MOST_OF_PART = 200
# The share of a target that is worth a word.
_MUCH = 0.05
_A_PART = 0.15
# A loose part is long beyond this share of the source's diagonal, and astray if this much of its weights is elsewhere.
_LONG = 0.1
_ASTRAY = 0.25


def warnings(body: Body, garment: Garment, result: Result) -> list[str]:
    """The sentences."""
    found = (
        _short_rows(body, garment, result),
        _over_hidden(body, garment, result),
        _on_other_parts(body, garment, result),
        _hung_on_one_place(body, garment, result),
        near_borders.warning(garment),
    )
    return [sentence for sentence in found if sentence]


def _short_rows(body: Body, garment: Garment, result: Result) -> str:
    """Vertices that follow nothing but locked bones, which the lock keeps from them, or bones that were not chosen."""
    if not garment.held.any() and not body.is_partial:
        return ""
    sums = csr.row_sums(vertex_groups.read(garment.object, garment.names))[result.written]
    short = int((sums < 1 - 1e-3).sum())
    if not short:
        return ""
    said = f"The weights of {short} vertices of {garment.object.name} sum to less than 1, as "
    if garment.held.any():
        locked = ", ".join(sorted(garment.locks & set(garment.names)))
        return f"{said}they would follow locked groups: unlock {locked}"
    return f"{said}only some bones were transferred and they follow others: set Groups to Deform Bones"


def _over_hidden(body: Body, garment: Garment, result: Result) -> str:
    """Vertices next to a part of the body that a Mask modifier hides, often because a garment covers it."""
    if body.hidden is None:
        return ""
    mask, hidden = body.hidden
    points = _some(garment.shape.geometry.positions, _MOST_POINTS)
    there, here = (places.nearest(surface, points) for surface in (hidden, body.geometry.positions))
    share = float(((there < _reach(result)) & (there < here)).mean())
    if share < _MUCH:
        return ""
    return (
        f"{share:.0%} of {garment.object.name} lies next to what {mask} hides, where nothing can match: "
        "turn it off in the viewport for the transfer if this is the skin below"
    )


def _on_other_parts(body: Body, garment: Garment, result: Result) -> str:
    """Vertices out of reach of the source that lie on another mesh on its armature: a part of the body, perhaps."""
    free, others = np.flatnonzero(result.written & ~result.matched), _others(body, garment)
    if not others or len(free) < _A_PART * len(result.written):
        return ""
    positions = garment.shape.geometry.positions
    points, share = _some(positions[free], _MOST_POINTS), len(free) / len(positions)
    reach = _reach(result)
    points_far = places.nearest(_some(body.geometry.positions, _MOST_OF_BODY), points) > reach
    if share * points_far.mean() < _A_PART:
        return ""
    shares: dict[str, float] = {}
    for other in others:
        try:
            with shapes.looked_at([other], "AS_SHOWN"):
                surface = _some(shapes.read_target(other, "AS_SHOWN").geometry.positions, _MOST_OF_BODY)
        except SceneError:  # it has no surface that could be meant
            continue
        near = places.nearest(surface, points[points_far]) < 0.5 * reach
        shares[other.name] = share * float(points_far.mean()) * float(near.mean())
    if max(shares.values(), default=0) < _A_PART:
        return ""
    name = max(shares, key=shares.__getitem__)
    return (
        f"{shares[name]:.0%} of {garment.object.name} lies on {name} and out of reach of {body.name}: "
        "set Body to All on Its Armature if it is a part of the body"
    )


def _others(body: Body, garment: Garment) -> list[bpy.types.Object]:
    """The other meshes with weights on the body's armatures, hidden ones too."""
    known = {*body.objects, garment.object}
    meshes = (obj for obj in bpy.context.scene.objects if obj.type == "MESH" and obj not in known)
    return [o for o in meshes if set(armature.rigs(o)) & set(body.rigs) and o.vertex_groups and o.data.polygons]


def _hung_on_one_place(body: Body, garment: Garment, result: Result) -> str:
    """Long loose parts that lie along the source but match nowhere, as edges of ribbons, and so do not bend with it."""
    if result.islands is None or not body.bones:
        return ""
    least = _LONG * float(np.linalg.norm(body.geometry.size))
    parts = [_some(vertices, _MOST_OF_PART) for vertices in _unmatched_parts(garment, result, result.islands, least)]
    astray = _astray(body, garment, result, parts) if parts else 0
    if not astray:
        return ""
    name = garment.object.name
    what = f"{astray} loose parts of {name} match" if astray > 1 else f"A loose part of {name} matches"
    return (
        f"{what} nowhere, although near {body.name} all along, and will not bend with it: set Loose Parts to Nearest "
        "if this is no stiff thing"
    )


def _unmatched_parts(
    garment: Garment, result: Result, islands: NDArray[np.uint32], least: float
) -> list[NDArray[np.int64]]:
    """The vertices of every loose part that is written, matches nowhere and is longer than `least`."""
    parts = islands if result.matched.any() else np.zeros_like(islands)
    order = np.argsort(parts, kind="stable")
    starts = np.flatnonzero(np.diff(parts[order].astype(np.int64), prepend=-1))
    positions, free = garment.shape.geometry.positions[order], (result.written & ~result.matched)[order]
    sides = np.maximum.reduceat(positions, starts) - np.minimum.reduceat(positions, starts)
    chosen = np.logical_and.reduceat(free, starts) & (np.linalg.norm(sides, axis=1) > least)
    ends = np.append(starts[1:], len(order))
    return [order[start:end] for start, end in zip(starts[chosen], ends[chosen], strict=True)]


def _astray(body: Body, garment: Garment, result: Result, parts: list[NDArray[np.int64]]) -> int:
    """How many parts lie mostly within reach and follow other bones than what is closest to them."""
    vertices = np.concatenate(parts)
    closest, distance = places.closest(body.geometry.positions, garment.shape.geometry.positions[vertices])
    is_bone = np.isin(result.names, body.bones)
    number = {name: column for column, name in enumerate(body.bones)}
    columns = np.array([number[name] for name in result.names if name in number], np.uint32)
    mine = csr.take_rows(csr.take_columns(result.rows, is_bone), vertices)
    elsewhere = csr.half_l1(mine._replace(bones=columns[mine.bones]), csr.take_rows(body.bone_weights, closest))
    near, ends = distance <= _reach(result), np.cumsum([len(part) for part in parts], dtype=np.int64)[:-1]
    split = zip(np.split(near, ends), np.split(elsewhere, ends), strict=True)
    return sum(bool(within.mean() >= 0.5 and away[within].mean() > _ASTRAY) for within, away in split)


def _reach(result: Result) -> float:
    """The distance in force, world units."""
    return float(result.report["max_distance"])


def _some(values: NDArray, most: int) -> NDArray:
    """At most so many of them, evenly chosen."""
    n = len(values)
    return values if n <= most else values[np.linspace(0, n - 1, most).astype(np.int64)]
