"""How a plug-in's file is located, kept apart and judged."""
