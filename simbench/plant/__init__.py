"""Apply the benchmark to one loop of a plant: which detector to trust on it."""
