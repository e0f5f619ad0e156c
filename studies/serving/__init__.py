"""Results in a browser, over HTTP on this machine alone, and live while a study runs."""
