"""Write pages: documents of text, sortable tables, and pictures as inline SVG in one style."""
