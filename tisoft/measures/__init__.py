"""What can be read off a running scene: strain, stress, volume, momentum."""
