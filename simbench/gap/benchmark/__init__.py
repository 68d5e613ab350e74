"""The gap of a whole benchmark: how a grid's records differ from recorded loops."""
