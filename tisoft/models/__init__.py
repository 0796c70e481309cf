"""The models of the lectures, one file each."""
