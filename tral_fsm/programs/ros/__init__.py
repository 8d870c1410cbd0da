"""The three nodes of ROS 2: which car drives, which policy, and all of them in one process."""
