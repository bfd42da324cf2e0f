"""The table of primitives; a new one is one module and one row here."""

from services.synthesis.primitives.arc import Arc
from services.synthesis.primitives.helix import Helix
from services.synthesis.primitives.line import Line
from services.synthesis.primitives.shape import Shape
from services.synthesis.primitives.sine import Sine

PRIMITIVES: dict[str, type[Shape]] = {shape.name: shape for shape in (Line, Arc, Helix, Sine)}
