"""Exams: records of a benchmark without labels, the answers to them, and the key that opens them."""
