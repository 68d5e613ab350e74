"""Predict the accuracy of each method over the axes of a grid from a random sample of its scenarios
(`simbench map`).
"""
