"""Random loops, effects and foreign kinds made with our own simulator; the diagnosis learns its probabilities on them."""

from simbench.gap.decide.training.draw import TrainingCase, draw_case
from simbench.gap.decide.training.foreign import FOREIGN

__all__ = ["FOREIGN", "TrainingCase", "draw_case"]
