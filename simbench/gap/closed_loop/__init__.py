"""Simulate the closed loop before and after an effect is added, and measure the gap to the
record.
"""
