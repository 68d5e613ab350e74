"""Describe an effect that the library does not contain by an empirical model: where it acts, in
which form, and how far it shrinks the gap (`simbench gap discover`).
"""
