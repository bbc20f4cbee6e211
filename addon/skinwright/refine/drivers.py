"""Expressions that give each key its value from the joint's rotation, so that keys share every pose among themselves.

A swing by w about an axis between X and Z gives the keys about X and about Z the shares cos^2 and sin^2, which add up
to one; along each direction the values are hats over the sampled angles, which add up to one as well. No pose counts
twice. Twist is measured apart from the swing, about the bone.
"""

from .sampling import Sample

# Variables of an expression: rotation channels of the bone against rest, swing and twist about Y apart. W is the angle
# of the whole swing; X and Z are twice the arc sine of its quaternion's parts; Y is the angle of the twist. Radians.
CHANNELS = {"w": "ROT_W", "x": "ROT_X", "z": "ROT_Z", "t": "ROT_Y"}


def expression(sample: Sample) -> tuple[str, str]:
    """The expression, one of Blender's simple ones, and the letters of its variables."""
    if sample.axis == "Y":
        sign = "" if sample.sign > 0 else "-"
        return hat(f"{sign}t", sample.angles, sample.k), "t"
    letter = sample.axis.lower()
    other = "z" if letter == "x" else "x"
    signed = letter if sample.sign > 0 else f"-{letter}"
    along, across = f"pow(max(sin({signed} / 2), 0), 2)", f"pow(sin({other} / 2), 2)"
    share = f"{along} / (pow(sin({letter} / 2), 2) + {across} + 0.000000001)"
    return f"{hat('w', sample.angles, sample.k)} * {share}", f"w{letter}{other}"


def hat(variable: str, angles: tuple[float, ...], k: int) -> str:
    """1 at the angle k, 0 at its neighbours and straight between; the last stays at 1."""
    before = angles[k - 1] if k else 0.0
    rising = f"({variable} - {before:.5g}) / {angles[k] - before:.5g}" if before else f"{variable} / {angles[k]:.5g}"
    if k + 1 == len(angles):
        return f"clamp({rising}, 0, 1)"
    falling = f"({angles[k + 1]:.5g} - {variable}) / {angles[k + 1] - angles[k]:.5g}"
    return f"max(min({rising}, {falling}), 0)"
