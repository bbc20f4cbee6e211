"""The error that this layer raises."""

from ..errors import Refused


class SceneError(Refused):
    """What Blender's data cannot give or take: one sentence that names the object, the problem and the cure."""
