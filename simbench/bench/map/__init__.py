"""Map of a grid: from a random sample of its scenarios to the accuracy of each method over its
axes.
"""
