"""Compute the likelihood of PV, given OP or MV, for a model of valve, plant, load and noise."""
