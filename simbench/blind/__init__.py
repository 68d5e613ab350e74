"""Blind checks of the gap diagnosis: records with hidden effects from independent simulators,
sealed answers, their scoring.
"""
