"""Claims of the literature about learned and other detectors, each rebuilt and judged on loops that
its authors did not have.
"""
