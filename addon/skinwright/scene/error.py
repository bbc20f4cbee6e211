"""What the scene cannot give or take, as a sentence for the artist."""


class SceneError(ValueError):
    """One sentence that names the object, the problem and the cure; raised before anything is written."""
