"""Records without their truth, for detectors (`exam`) and for the gap diagnosis (`withheld`): a
folder of records, a key elsewhere, answers, and their opening.
"""
