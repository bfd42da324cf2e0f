"""The tables of primitives; a new one is one module and one row here."""

from services.synthesis.primitives.arc import Arc
from services.synthesis.primitives.compound import Compound
from services.synthesis.primitives.eight import Eight
from services.synthesis.primitives.helix import Helix
from services.synthesis.primitives.line import Line
from services.synthesis.primitives.shape import Shape
from services.synthesis.primitives.sine import Sine
from services.synthesis.primitives.spiral import Spiral
from services.synthesis.primitives.zigzag import Zigzag

PRIMITIVES: dict[str, type[Shape]] = {shape.name: shape for shape in (Line, Arc, Helix, Sine)}
"""The thesis' four, which a classifier knows."""
EXTENDED: dict[str, type[Shape]] = {
    shape.name: shape for shape in (Spiral, Eight, Zigzag, Compound)
}
"""More of them, which geometry tells, in the order they are tried: the simpler ones first."""
