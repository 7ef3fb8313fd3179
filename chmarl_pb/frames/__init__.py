"""Frames: what a film, the page of an episode and ``render()`` show: pictures, map, words and the panel around them."""
