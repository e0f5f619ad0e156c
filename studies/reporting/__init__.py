"""What is made of stored rows: tables next to published values, claims and verdicts, pages, files."""
