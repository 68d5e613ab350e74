"""An exam: records of a benchmark without their truth, the answers to them, and the key that opens
it.
"""
