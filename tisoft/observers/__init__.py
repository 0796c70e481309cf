"""What watches a run: tables, films, progress, the summary."""
