"""Modifiers that leave a body nothing to take weights from, and nodes that give a garment other vertices."""

import builders
import figure
import numpy as np
import pytest
from transferring import said

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def nodes(obj, *kinds):
    """Geometry Nodes, one after the other, before all other modifiers; returns the tree."""
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    chain = [tree.nodes.new(kind) for kind in ("NodeGroupInput", *kinds, "NodeGroupOutput")]
    for first, second in zip(chain, chain[1:], strict=False):
        tree.links.new(first.outputs[0], second.inputs[0])
    obj.modifiers.new("Maker", "NODES").node_group = tree
    obj.modifiers.move(len(obj.modifiers) - 1, 0)
    return tree


def before_the_pose(obj, kind):
    modifier = obj.modifiers.new("Maker", kind)
    obj.modifiers.move(len(obj.modifiers) - 1, 0)
    return obj.modifiers[modifier.name]


def instance(body):
    nodes(body, "GeometryNodeGeometryToInstance")


def through_a_volume(body):
    nodes(body, "GeometryNodeMeshToVolume", "GeometryNodeVolumeToMesh")


def curves(body):
    nodes(body, "GeometryNodeMeshToCurve")


def remesh(body):
    before_the_pose(body, "REMESH").voxel_size = 0.05


def build(body):
    before_the_pose(body, "BUILD")


@pytest.mark.parametrize("spoil", [instance, through_a_volume, curves, remesh, build])
@pytest.mark.parametrize("subdivided", [False, True])
def test_a_body_without_faces_or_weights_is_taken_as_it_was_before(plain, body, boot, spoil, subdivided):
    spoil(body)
    if subdivided:
        body.modifiers.new("Subdivision", "SUBSURF")
    assert "With the modifier Maker of Body there are no faces that have weights" in said(plain(body, boot))
    truth = figure.weights_at(figure.rest(boot))
    assert np.abs(builders.dense(boot, figure.BONES) - truth).mean() < 0.02


def test_nodes_that_keep_the_weights_count(plain, body, boot):
    """Blender 4.2 loses groups where it makes instances real."""
    nodes(body, "GeometryNodeGeometryToInstance", "GeometryNodeRealizeInstances")
    assert ("With the modifier Maker" in said(plain(body, boot))) == (bpy.app.version < (4, 3))


class TestVerticesInAnotherOrder:
    """Nodes that leave as many vertices as there were, but not the same."""

    def test_sorted(self, plain, body):
        trousers = figure.trousers()
        tree = nodes(trousers, "GeometryNodeSortElements")
        index, negative = tree.nodes.new("GeometryNodeInputIndex"), tree.nodes.new("ShaderNodeMath")
        negative.operation = "MULTIPLY"
        negative.inputs[1].default_value = -1
        tree.links.new(index.outputs[0], negative.inputs[0])
        tree.links.new(negative.outputs[0], tree.nodes["Sort Elements"].inputs["Sort Weight"])
        report = plain(body, trousers)
        truth = figure.weights_at(figure.rest(trousers))
        assert np.abs(builders.dense(trousers, figure.BONES) - truth).mean() < 0.02
        assert "What the modifier Maker of Trousers makes was not taken into account" in said(report)

    def test_turned_over_they_are_the_same(self, plain, body):
        trousers = figure.trousers()
        nodes(trousers, "GeometryNodeFlipFaces")
        assert "Maker" not in said(plain(body, trousers))
