"""The benchmark: simulate grids of scenarios with known truth, judge them by detectors, score and
compare the results.
"""
