"""One substep, a file for each of its pieces; `substep` is the page to read first."""
