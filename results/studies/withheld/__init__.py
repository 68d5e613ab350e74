"""Test the gap diagnosis on records with hidden effects from independent simulators: make, answer
and score such records.
"""
