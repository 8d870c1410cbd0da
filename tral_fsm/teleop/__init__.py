"""A person drives: from a gamepad or a keyboard to a command, by laws that stop the car when the hand is gone."""
