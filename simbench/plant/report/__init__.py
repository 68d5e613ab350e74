"""Rank the loops of a plant on one page (`simbench report`)."""
