"""The answer as data, text, pictures and page."""
