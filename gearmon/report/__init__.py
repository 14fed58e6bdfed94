"""Reports: pictures, text and HTML."""
