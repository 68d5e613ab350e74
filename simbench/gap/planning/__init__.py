"""Recommend the next tests on the plant in a fixed order, each sized for the loop
(`simbench gap plan`).
"""
