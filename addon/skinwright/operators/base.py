"""What every operator has in common: refusal in a sentence, targets, and one net under all of its work."""

from collections.abc import Callable, Sequence

from bpy.types import Context, Object, Operator

from .. import native, reporting
from ..errors import sentence
from ..stored import keeping
from .modal import brush_session

# The modes of operators that work on meshes as they are selected.
MESH_MODES = {"OBJECT", "EDIT_MESH", "PAINT_WEIGHT"}
# What can be converted to a mesh.
_SURFACES = {"CURVE", "SURFACE", "META", "FONT", "CURVES"}
_NAMED = 5


class SkinwrightOperator(Operator):
    """Base of the operators: `refusal` says why not, `work` does it, and no exception leaves `attempt`."""

    @classmethod
    def refusal(cls, context: Context) -> str:
        """Why the operator cannot run now, or nothing. Cheap, as it runs on every redraw."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Blender shows the sentence as the tooltip of the greyed button."""
        reason = cls.refusal(context)
        cls.poll_message_set(reason)
        return not reason

    def work(self, context: Context) -> set[str]:
        """What `execute` does; may raise."""
        raise NotImplementedError

    def execute(self, context: Context) -> set[str]:
        """Work, or say why not."""
        return self.attempt(lambda: self.work(context))

    def attempt(self, work: Callable[[], set[str]]) -> set[str]:
        """What `work` returns; an exception becomes a sentence."""
        try:
            return work()
        except Exception as error:
            self._fail(sentence(self.bl_label, error))
        return {"CANCELLED"}

    def _fail(self, text: str) -> None:
        reporting.remember(self.bl_label, text, failed=True)
        self.report({"ERROR"}, text)

    def keep_before(self, objects: Sequence[Object]) -> None:
        """Keep the weights of `objects` in the file, as they are before this operator writes."""
        keeping.keep_before(objects, self.bl_label)

    def tell(self, text: str, warnings: list[str]) -> set[str]:
        """The result, and then what is worth a look, as the status bar shows the last report."""
        reporting.remember(self.bl_label, text, warnings)
        self.report({"INFO"}, text)
        for warning in warnings:
            self.report({"WARNING"}, warning)
        return {"FINISHED"}


def selected_meshes(context: Context, *, without: Object | None = None) -> list[Object]:
    """The selected meshes; while painting or editing the active one is always among them."""
    meshes = [obj for obj in context.selected_objects if obj.type == "MESH"]
    active = context.active_object
    if context.mode != "OBJECT" and active and active.type == "MESH" and active not in meshes:
        meshes.append(active)
    return [obj for obj in meshes if obj != without]


def passed_over(context: Context) -> list[str]:
    """A sentence about selected objects that show a surface but are no meshes, as belts made of a curve."""
    if context.mode != "OBJECT":
        return []
    objects = context.selected_objects
    others = [obj.name for obj in objects if obj.type in _SURFACES or obj.instance_type == "COLLECTION"]
    if not others:
        return []
    named = ", ".join(others[:_NAMED]) + (", ..." if len(others) > _NAMED else "")
    are = "is no mesh and was" if len(others) == 1 else "are no meshes and were"
    return [f"{named} {are} passed over: convert it to a mesh, or make an instance real"]


def refusal_in_mode(context: Context, purpose: str) -> str:
    """Why nothing can be done to meshes now, or nothing; `purpose` ends the sentence."""
    if native.problem():
        return native.problem()
    if brush_session.refusal():
        return brush_session.refusal()
    if context.mode not in MESH_MODES:
        return f"Go to Object, Edit or Weight Paint mode to {purpose}"
    return ""
