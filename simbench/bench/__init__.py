"""Who can be trusted? Grids of scenarios simulated with their truth, judged by detectors, scored,
compared, defended.
"""
