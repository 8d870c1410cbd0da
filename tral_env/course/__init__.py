"""What a corridor is: layout, geometry, scene."""
