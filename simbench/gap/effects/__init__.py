"""How an effect is recognised: each fitted on top of a base, with its numbers, its size and what it is confused with."""
