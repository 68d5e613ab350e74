"""From the benchmark to the plant: whom to trust on a loop, what could have been seen, where to go
first.
"""
