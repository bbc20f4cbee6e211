"""Long work whose objects change while it goes on: refused in a sentence, and nothing is written anywhere."""

from importlib import import_module

import builders
import pytest

bpy = pytest.importorskip("bpy", reason="needs the bpy wheel")

pytestmark = pytest.mark.usefixtures("native", "scene")


def grow(obj):
    obj.data.vertices.add(2)


def rebuild(obj):
    obj.data.clear_geometry()
    obj.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])


def edit(obj):
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")


def delete(obj):
    bpy.data.objects.remove(obj)


def unrig(obj):
    bpy.data.objects.remove(bpy.data.objects["Arm Rig"])


CHANGES = [grow, rebuild, edit, delete, unrig]


@pytest.fixture
def arm():
    """A bound limb beside a donor's."""
    builders.limb("Donor")
    obj, _ = builders.limb("Arm", length=2.4)
    builders.select(obj)
    bpy.context.view_layer.update()
    return obj


def work(addon, name, obj, folder):
    """The steps of an operation on the limb."""

    def part(module):
        return import_module(f"{addon.__name__}.{module}")

    donor, context = bpy.data.objects["Donor"], bpy.context
    match name:
        case "transfer":
            return part("transfer").steps(context, donor, [obj], part("transfer").TransferParams())
        case "automatic":
            return part("autoskin").steps([obj], None, part("autoskin").AutoskinParams(resolution=16))
        case "retarget":
            return part("retarget").steps(context, donor, [obj], part("retarget").RetargetParams())
        case "embed":
            rig = bpy.data.objects["Donor Rig"]
            return part("embed").steps(context, rig, [obj], part("embed").EmbedParams())
        case "correctives":
            params = part("refine.params").CorrectiveParams(samples=1, twist=0)
            return part("refine.correctives").steps(obj, params)
    params = part("refine.params").RefineParams()
    return part("refine.cache").steps(obj, params, folder / "arm.pc2", (1, 2))


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
@pytest.mark.parametrize("name", ["transfer", "automatic", "retarget", "embed", "correctives", "cache"])
def test_nothing_is_written(addon, arm, tmp_path, name, change):
    if change is unrig and name in ("transfer", "embed"):
        pytest.skip("its own armature takes no part")
    runner = addon.jobs.Runner(work(addon, name, arm, tmp_path))
    runner.wait(20)
    change(arm)
    before = builders.weights(arm) if change in (grow, rebuild, unrig) else None
    with pytest.raises(ValueError, match=r"(Arm|Arm Rig) (was|is) .*, so nothing was written"):
        while not runner.poll():
            runner.wait(20)
    assert before is None or builders.weights(arm) == before
    assert not list(tmp_path.iterdir())
    assert len([obj for obj in bpy.data.objects if obj.type == "ARMATURE"]) == 2 - (change is unrig)
    if change is not delete:
        assert arm.data.shape_keys is None and len(arm.modifiers) == 1
