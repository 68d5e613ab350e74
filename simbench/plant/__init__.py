"""Apply the benchmark to a plant: which detector to trust on a loop, and which loop to work on
first.
"""
