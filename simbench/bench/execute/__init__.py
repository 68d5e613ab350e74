"""A grid run: chunks, workers, plug-in processes, what failed."""
