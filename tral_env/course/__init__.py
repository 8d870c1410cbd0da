"""What a course is: a layout that a person writes or a generator draws, its geometry, its route, its scene."""
