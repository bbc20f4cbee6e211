"""Characters that are refined: meshes, weights and skeletons of .glb files, and poses on them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from support.glb import contents

# The names of a Rigify character's deform bones, by those of the shared poses.
_RIGIFY = {
    "hips": "DEF-hips",
    "spine1": "DEF-spine.001",
    "spine2": "DEF-spine.002",
    "spine3": "DEF-spine.003",
    "neck": "DEF-neck",
    "head": "DEF-head",
}
for _side in ("l", "r"):
    for _name, _bone in (
        ("shoulder", "shoulder"),
        ("arm", "upper_arm"),
        ("fore", "forearm"),
        ("hand", "hand"),
        ("leg", "thigh"),
        ("shin", "shin"),
        ("foot", "foot"),
    ):
        _RIGIFY[f"{_name}_{_side}"] = f"DEF-{_bone}.{_side.upper()}"


@dataclass
class Character:
    """positions (V, 3), triangles (T, 3), weights (V, B) dense, and B bones: names, parents, segments (B, 2, 3)."""

    name: str
    positions: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    bones: list[str]
    parents: np.ndarray
    segments: np.ndarray
    scene: dict
    accessor: Callable[[int], np.ndarray]


def read(path: Path) -> Character:
    """All skinned meshes of a file as one; equal positions with equal weights stay apart, as in the file."""
    scene, accessor = contents(path)
    skinned = [node for node in scene["nodes"] if "mesh" in node and "skin" in node]
    skin = scene["skins"][skinned[0]["skin"]]
    positions, triangles, weights, start = [], [], [], 0
    for node in skinned:
        for part in scene["meshes"][node["mesh"]]["primitives"]:
            attributes = part["attributes"]
            positions.append(accessor(attributes["POSITION"]))
            triangles.append(accessor(part["indices"]).reshape(-1, 3).astype(np.int64) + start)
            weights.append(_weights(accessor, attributes, len(positions[-1]), len(skin["joints"])))
            start += len(positions[-1])
    bones = [scene["nodes"][j].get("name", str(j)) for j in skin["joints"]]
    parents = _parents(scene, skin["joints"])
    heads = np.linalg.inv(accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1).astype(float))
    segments = _segments(heads[:, :3, 3], parents)
    arrays = np.vstack(positions).astype(np.float32), np.vstack(triangles).astype(np.uint32), np.vstack(weights)
    return Character(path.stem, *arrays, bones, parents, segments, scene, accessor)


def _weights(accessor, attributes: dict, vertices: int, bones: int) -> np.ndarray:
    dense = np.zeros((vertices, bones), np.float32)
    for k in range(sum(name.startswith("JOINTS_") for name in attributes)):
        joints, shares = accessor(attributes[f"JOINTS_{k}"]), accessor(attributes[f"WEIGHTS_{k}"])
        np.add.at(dense, (np.arange(vertices)[:, None], joints), shares)
    return dense


def _parents(scene: dict, joints: list[int]) -> np.ndarray:
    above = {child: i for i, node in enumerate(scene["nodes"]) for child in node.get("children", [])}
    index = {node: j for j, node in enumerate(joints)}

    def parent(node: int) -> int:
        while node in above:
            node = above[node]
            if node in index:
                return index[node]
        return -1

    return np.array([parent(node) for node in joints], np.int32)


def _segments(heads: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """From each head to the child's that goes straightest on; leaves go on as their parent does."""
    tails = np.empty_like(heads)
    for j, head in enumerate(heads):
        children = np.flatnonzero(parents == j)
        onward = head - heads[parents[j]] if parents[j] >= 0 else np.array([0.0, 1.0, 0.0])
        onward = onward / max(np.linalg.norm(onward), 1e-9)
        arms = heads[children] - head
        lengths = np.linalg.norm(arms, axis=1)
        if (lengths > 1e-6).any():
            straight = np.where(lengths > 1e-6, arms @ onward / np.maximum(lengths, 1e-9), -2)
            tails[j] = heads[children[straight.argmax()]]
        else:
            length = np.linalg.norm(head - heads[parents[j]]) if parents[j] >= 0 else 0.1
            tails[j] = head + onward * max(length, 1e-3) * 0.5
    return np.stack([heads, tails], 1)


def pose(character: Character, ops: dict, conventions: dict) -> np.ndarray:
    """(B, 4, 4) pose_from_rest of one of the shared poses."""
    joint = _canonical(character.bones, conventions["bone_names"] | {"rigify": _RIGIFY})
    heads, parents = character.segments[:, 0], character.parents
    turns = {}
    for name, op in ops.items():
        if name in joint:
            turns[joint[name]] = (name, op)
    result = np.tile(np.eye(4), (len(parents), 1, 1))
    depth = np.array([_depth(parents, j) for j in range(len(parents))])
    for j in np.argsort(depth, kind="stable"):
        matrix = result[parents[j]] if parents[j] >= 0 else np.eye(4)
        if j in turns:
            matrix = _about(_apply(matrix, heads[j]), _rotation(turns[j], joint, heads, matrix, conventions)) @ matrix
        result[j] = matrix
    return result


def _canonical(bones: list[str], rigs: dict) -> dict[str, int]:
    def mapped(rig: dict) -> dict[str, int]:
        found = {name: [bones.index(b) for b in options.split("|") if b in bones] for name, options in rig.items()}
        return {name: options[0] for name, options in found.items() if options}

    return max((mapped(rig) for rig in rigs.values()), key=len)


def _rotation(turn, joint, heads, matrix, conventions) -> np.ndarray:
    name, op = turn
    limb, _, side = name.partition("_")
    here = _apply(matrix, heads[joint[name]])
    if op[0] == "aim":
        onward = conventions["next_joint"][limb] + (f"_{side}" if side else "")
        if onward not in joint:
            return np.eye(3)
        return between(_apply(matrix, heads[joint[onward]]) - here, np.array(op[1], float))
    if op[0] == "rot":
        return about(np.array(op[1], float), op[2])
    before = conventions["previous_joint"][limb] + (f"_{side}" if side else "")
    if before not in joint:
        return np.eye(3)
    # The axis from the previous joint, which this matrix carries as well.
    return about(here - _apply(matrix, heads[joint[before]]), op[1])


def clip(character: Character, name: str, seconds: float) -> np.ndarray:
    """(B, 4, 4) pose_from_rest of one of the file's animations."""
    scene, accessor = character.scene, character.accessor
    animation = next(a for a in scene["animations"] if a["name"] == name)
    moved = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times, values = accessor(sampler["input"])[:, 0], accessor(sampler["output"])
        k = int(np.clip(np.searchsorted(times, seconds, side="right") - 1, 0, len(times) - 1))
        last = min(k + 1, len(times) - 1)
        share = (seconds - times[k]) / (times[last] - times[k]) if last > k else 0.0
        share = 0.0 if sampler.get("interpolation") == "STEP" else float(np.clip(share, 0, 1))
        before, after = values[k].astype(float), values[last].astype(float)
        after = -after if channel["target"]["path"] == "rotation" and before @ after < 0 else after
        moved[channel["target"]["node"], channel["target"]["path"]] = (1 - share) * before + share * after
    above = {child: i for i, node in enumerate(scene["nodes"]) for child in node.get("children", [])}

    def place(node: int) -> np.ndarray:
        own = _local(scene["nodes"][node], {path: value for (n, path), value in moved.items() if n == node})
        return place(above[node]) @ own if node in above else own

    skin = scene["skins"][next(node["skin"] for node in scene["nodes"] if "skin" in node)]
    inverse = accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
    return np.stack([place(node) for node in skin["joints"]]) @ inverse


def length(character: Character, name: str) -> float:
    """Seconds of one of the file's animations."""
    animation = next(a for a in character.scene["animations"] if a["name"] == name)
    return max(float(character.accessor(sampler["input"]).max()) for sampler in animation["samplers"])


def _local(node: dict, moved: dict[str, np.ndarray]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = (q := np.array(moved.get("rotation", node.get("rotation", [0, 0, 0, 1])), float)) / np.linalg.norm(q)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(moved.get("scale", node.get("scale", [1, 1, 1])), float)
    matrix[:3, 3] = moved.get("translation", node.get("translation", [0, 0, 0]))
    return matrix


def about(axis: np.ndarray, degrees: float) -> np.ndarray:
    """(3, 3) rotation."""
    x, y, z = axis / np.linalg.norm(axis)
    skew, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.radians(degrees)
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def between(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(3, 3) the smallest rotation that takes the direction of u to that of v."""
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    axis = np.cross(u, v)
    if np.linalg.norm(axis) < 1e-9:
        return np.eye(3)
    return about(axis, np.degrees(np.arctan2(np.linalg.norm(axis), u @ v)))


def rotated(character: Character, bone: int, rotation: np.ndarray) -> np.ndarray:
    """(B, 4, 4) one bone and all below it turned about its head."""
    below = np.array([_is_below(character.parents, j, bone) for j in range(len(character.parents))])
    result = np.tile(np.eye(4), (len(below), 1, 1))
    result[below] = _about(character.segments[bone, 0], rotation)
    return result


def _about(centre: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, centre - rotation @ centre
    return matrix


def _apply(matrix: np.ndarray, point: np.ndarray) -> np.ndarray:
    return matrix[:3, :3] @ point + matrix[:3, 3]


def _depth(parents: np.ndarray, j: int) -> int:
    depth = 0
    while parents[j] >= 0:
        j, depth = parents[j], depth + 1
    return depth


def _is_below(parents: np.ndarray, j: int, bone: int) -> bool:
    while j >= 0 and j != bone:
        j = parents[j]
    return j == bone
