"""Exams: records of a benchmark without labels, the answers to them, and the key to the labels."""
