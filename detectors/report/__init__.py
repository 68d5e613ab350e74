"""Show verdicts as text, JSON, tables and notebook cells."""
