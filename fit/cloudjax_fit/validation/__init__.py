"""Whether the clouds of an image are those of its weather, as a meteorologist asks."""
