"""Interactive viewers: a running scene in a page, with a body in the hand."""
