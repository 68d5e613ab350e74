"""Apply the benchmark to a plant: which detector to trust on a loop, which loop to work on first,
and how a plant differs from a grid.
"""
