"""What every HTML page here is made of: the page itself, sortable tables, pictures as inline
SVG.
"""
