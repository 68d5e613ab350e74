"""Tests that every detector must pass, on plain, rescaled and dead records; `simbench contract
FILE` runs them.
"""
