"""Run a grid: divide it into pieces, distribute them over workers, host plug-ins, and count
failures.
"""
