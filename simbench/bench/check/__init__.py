"""Compare a run with a baseline: which loops flipped, and whether a detector became worse."""
