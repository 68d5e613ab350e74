"""Scores for people: text tables, tables and pictures for a paper, and what is asked of a run."""
