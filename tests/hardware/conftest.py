"""What all tests of the car share; it also puts `fakes` on the path of the folders below."""
