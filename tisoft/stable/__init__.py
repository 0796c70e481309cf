"""The stable step: its bound, its sharp limit, what a run takes, and the guard."""
