"""Verdicts for people and programs: text, JSON, tables, notebook cells."""
