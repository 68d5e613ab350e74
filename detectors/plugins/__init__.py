"""How a plug-in's file is found, kept apart and judged."""
