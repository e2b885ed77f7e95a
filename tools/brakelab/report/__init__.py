"""Report: one self-contained HTML page on a result."""
