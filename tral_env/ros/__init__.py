"""ROS 2 without ROS: messages, nodes and the car as one of them, spoken by Cyclone DDS; see docs/ros.md."""
