"""What modifiers look at beside their own mesh: the objects and bones that their settings, inputs and nodes name."""

from collections.abc import Iterator

import bpy


def objects(modifier: bpy.types.Modifier) -> list[bpy.types.Object]:
    """The objects, those of collections too."""
    found = [*_named(modifier, "Object")]
    for collection in _named(modifier, "Collection"):
        found += collection.all_objects
    if modifier.type == "NODES" and modifier.node_group:
        found += _given(modifier)
        for socket in _sockets(modifier.node_group):
            if socket.type == "OBJECT" and socket.default_value:
                found.append(socket.default_value)
            elif socket.type == "COLLECTION" and socket.default_value:
                found += socket.default_value.all_objects
    return list(dict.fromkeys(found))


def names_a_bone(modifier: bpy.types.Modifier) -> bool:
    """Whether it looks at a bone of an armature, and not only at where the armature stands."""
    names = [p.identifier for p in modifier.bl_rna.properties if p.type == "STRING" and "bone" in p.identifier]
    if any(getattr(modifier, name) for name in names) or modifier.type == "HOOK":
        return True
    if modifier.type != "NODES" or not modifier.node_group:
        return False
    return any("Bone" in node.bl_idname for tree in trees(modifier.node_group) for node in tree.nodes)


def trees(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """The tree and those of the groups in it."""
    found = [tree]
    for known in found:  # grows on the way
        inner = (getattr(node, "node_tree", None) for node in known.nodes)
        found += [other for other in dict.fromkeys(inner) if other and other not in found]
    return found


def _sockets(tree: bpy.types.NodeTree) -> Iterator[bpy.types.NodeSocket]:
    return (socket for each in trees(tree) for node in each.nodes for socket in node.inputs)


def _named(modifier: bpy.types.Modifier, kind: str) -> Iterator[bpy.types.ID]:
    for pointer in modifier.bl_rna.properties:
        if pointer.type == "POINTER" and pointer.fixed_type.identifier == kind:
            value = getattr(modifier, pointer.identifier)
            if value:
                yield value


def _given(modifier: bpy.types.NodesModifier) -> list[bpy.types.Object]:
    """The objects given to a node tree. Blender 5.2 keeps inputs as properties, those before as ID properties."""
    sockets = [item for item in modifier.node_group.interface.items_tree if item.item_type == "SOCKET"]
    kinds = ("NodeSocketObject", "NodeSocketCollection")
    names = [s.identifier for s in sockets if s.in_out == "INPUT" and s.socket_type in kinds]
    if hasattr(modifier, "properties"):
        inputs = [getattr(modifier.properties.inputs, name, None) for name in names]
        values = [getattr(given, "value", None) for given in inputs]
    else:
        values = [modifier.get(name) for name in names]
    found: list[bpy.types.Object] = []
    for value in values:
        found += value.all_objects if isinstance(value, bpy.types.Collection) else [value] if value else []
    return found
