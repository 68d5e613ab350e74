"""Records without their truth, for detectors (`exam`): a folder of records, a key elsewhere,
answers, and their opening.
"""
