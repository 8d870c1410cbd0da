"""ROS 2 messages as dataclasses: the names, fields and order of the official definitions, which the tests compare."""
