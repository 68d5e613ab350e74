"""Build HTML pages: documents of text, tiles, sortable tables, and pictures as inline SVG."""
