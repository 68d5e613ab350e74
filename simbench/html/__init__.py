"""Build HTML pages: templates, sortable tables, and pictures as inline SVG."""
