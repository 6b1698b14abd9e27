"""Reports as one HTML file that needs nothing else: made of parts, written by templates, drawn by plotly."""
